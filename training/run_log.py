"""What a training run tells: means over the steps since it last spoke, for the terminal and as JSON lines."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from training.trainer import StepReport


@dataclass(frozen=True)
class RunSummary:
    """Means over some steps.

    Args:
        step, images, trained_s, progress: at the last of them.
        images_per_s: pictures trained on per second of training.
        rate_factor: learning rate as a share of the highest.
        absolute, shape, edges, sigma, uncorrected, total: loss terms, unweighted, and their weighted sum.
        frames: size of the training set.
    """

    step: int
    images: int
    trained_s: float
    progress: float
    images_per_s: float
    rate_factor: float
    absolute: float
    shape: float
    edges: float
    sigma: float
    uncorrected: float
    total: float
    frames: int

    @property
    def left_s(self) -> float:
        """Seconds of training that are left if the rest goes as the run has so far."""
        return self.trained_s * (1.0 - self.progress) / max(self.progress, 1e-9)

    def line(self) -> str:
        """One line for people."""
        return (
            f"{100 * self.progress:5.1f} %  {self.left_s / 60:.1f} min left  "
            f"step {self.step}  {self.images} pictures  "
            f"{self.images_per_s:.1f}/s  loss {self.total:.3f}  absolute {self.absolute:.3f}  "
            f"shape {self.shape:.3f}  edges {self.edges:.3f}  sigma {self.sigma:.3f}  frames {self.frames}"
        )


class RunLog:
    """Collects step reports and summarises them every `every_s` seconds of training.

    Args:
        path: file that gets one JSON object per line, appended.
        every_s: seconds of training between summaries.
    """

    def __init__(self, path: Path, every_s: float = 20.0) -> None:
        self._path = path
        self._every_s = every_s
        self._reports: list[StepReport] = []
        self._since: tuple[int, float] | None = None

    def add(self, report: StepReport, batch: int, step_s: float, frames: int) -> RunSummary | None:
        """Take in a step; returns a summary when one is due, or at the end of the run.

        Args:
            report: of the step.
            batch: pictures in it.
            step_s: seconds it took.
            frames: size of the training set.
        """
        if self._since is None:
            self._since = (report.images - batch, report.trained_s - step_s)
        self._reports.append(report)
        images, trained_s = self._since
        if report.trained_s - trained_s < self._every_s and report.progress < 1.0:
            return None
        names = ("absolute", "shape", "edges", "sigma", "uncorrected", "total")
        means = {
            name: sum(getattr(item.terms, name).item() for item in self._reports) / len(self._reports)
            for name in names
        }
        summary = RunSummary(
            step=report.step,
            images=report.images,
            trained_s=report.trained_s,
            progress=report.progress,
            images_per_s=(report.images - images) / max(report.trained_s - trained_s, 1e-9),
            rate_factor=report.rate_factor,
            frames=frames,
            **means,
        )
        self._reports, self._since = [], (report.images, report.trained_s)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(summary)) + "\n")
        return summary


def read_log(path: Path) -> list[RunSummary]:
    """Summaries of a run's log file, oldest first."""
    names = {field.name for field in fields(RunSummary)}
    lines = path.read_text(encoding="utf-8").splitlines()
    return [RunSummary(**{k: v for k, v in json.loads(line).items() if k in names}) for line in lines]
