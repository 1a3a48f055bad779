"""What a run shows in TensorBoard: the loss, and pictures of what the network sees."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import torch
from torch import Tensor
from torch.utils.tensorboard import SummaryWriter

from training.selfsupervised.trainer import SelfSupervisedStep

if TYPE_CHECKING:
    from types import TracebackType

SCALARS_EVERY = 20
PICTURES_EVERY = 500
_PICTURES = 4


class RunBoard:
    """Writes TensorBoard events. Steps are counted in pictures shown, so that runs of any batch compare.

    Args:
        folder: of the events.
    """

    def __init__(self, folder: Path) -> None:
        self._writer = SummaryWriter(str(folder))

    def __enter__(self) -> RunBoard:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()

    def add(self, report: SelfSupervisedStep) -> None:
        """Take in a step; most steps write nothing."""
        if report.step % SCALARS_EVERY == 0:
            terms = report.terms
            values = {
                "loss/total": terms.total,
                "loss/reprojection": terms.reprojection,
                "loss/smoothness": terms.smoothness,
            }
            for name, value in values.items():
                self._scalar(name, float(value.detach()), report.images)
            self._scalar("rate/learning_rate", report.rate, report.images)
            self._scalar("rate/images_per_s", report.images / max(report.trained_s, 1e-9), report.images)
        if report.step % PICTURES_EVERY == 1:
            self._pictures(report)

    def _scalar(self, name: str, value: float, images: int) -> None:
        self._writer.add_scalar(name, value, images)

    def _pictures(self, report: SelfSupervisedStep) -> None:
        disparity = shown(report.prediction.disparities[0][:_PICTURES].detach())
        rows = {
            "frame/target": report.batch.target[:_PICTURES],
            "frame/disparity": disparity,
            "frame/auto_mask": report.terms.auto_mask[:_PICTURES].float(),
        }
        for name, pictures in rows.items():
            self._writer.add_images(name, pictures.cpu(), report.images)


def shown(disparity: Tensor) -> Tensor:
    """(N, 1, H, W) in 0 to 1, lighter = nearer; each picture from its own 2nd to 98th percentile."""
    flat = disparity.flatten(1).float()
    low, high = (torch.quantile(flat, q, dim=1)[:, None, None, None] for q in (0.02, 0.98))
    return ((disparity.float() - low) / (high - low).clamp_min(1e-6)).clamp(0.0, 1.0)
