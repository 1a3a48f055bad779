"""From a run of self-supervised training to an ONNX file that the service flies as a relative network."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from training.errors import ExportError
from training.networks.disparity import SIZE_STEP, SMALLEST_SIDE, DisparityNetwork, disparity_to_depth
from training.onnx_file import trace, write_checked
from training.selfsupervised.run_state import RunState
from training.selfsupervised.trained_network import trained_network
from uavdepth.model.card import ModelCard
from uavdepth.model.depth_model import DepthModel

LARGEST_DIFFERENCE = 1e-3
"""Of inverse depth between PyTorch and ONNX Runtime, relative."""

OUTPUT_NAME = "inverse_depth"

LIMITS = (
    "Taught by video alone: depth up to one unknown factor a picture, no uncertainty. Its metres come from "
    "the service's scale estimator."
)


class _InverseDepth(nn.Module):
    """The finest disparity as inverse depth, in the unit of the pose network."""

    def __init__(self, network: DisparityNetwork, min_depth_m: float, max_depth_m: float) -> None:
        super().__init__()
        self.network = network
        self._limits = (min_depth_m, max_depth_m)

    def forward(self, image: Tensor) -> Tensor:
        disparities: tuple[Tensor, ...] = self.network(image)
        return 1.0 / disparity_to_depth(disparities[0], *self._limits)


def export_run(state: RunState, path: Path, name: str, size: tuple[int, int] | None = None) -> ModelCard:
    """Write the depth network of a run, in single precision, as ONNX with its card.

    Args:
        state: of the run.
        path: the ONNX file to write; a failure leaves an old one whole.
        name: of the network, for status and records.
        size: width and height of the input; None takes the run's.

    Returns:
        The card that was written.

    Raises:
        ExportError: a size that the network cannot take, or a written network that does not compute what
            PyTorch does.
        CheckpointError: weights that do not fit the network.
    """
    settings = state.settings
    width, height = size or (settings.width, settings.height)
    if any(side % SIZE_STEP or side < SMALLEST_SIDE for side in (width, height)):
        raise ExportError(
            f"the input is {width}x{height}: multiples of {SIZE_STEP} from {SMALLEST_SIDE} are needed"
        )
    limits = settings.loss.min_depth_m, settings.loss.max_depth_m
    network = _InverseDepth(trained_network(state), *limits).eval()
    card = ModelCard(
        card_version=2,
        name=name,
        input_width=width,
        input_height=height,
        mean=(0.0, 0.0, 0.0),
        std=(1.0, 1.0, 1.0),
        output="relative_inverse_depth",
        output_name=OUTPUT_NAME,
        training_data="video: " + ", ".join(sorted({source.kind for source in settings.sources})),
        effort=f"{state.images} pictures in {state.step} steps, {state.trained_s / 3600:.1f} hours",
        intended_use=f"Relative depth by {settings.network.name} with {settings.network.encoder}.",
        limits=LIMITS,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    picture = torch.zeros(1, 3, height, width)
    model = trace(network, (picture,), (card.input_name,), (card.output_name,))
    write_checked(model, card, path, lambda file: _check_same_output(network, file))
    return card


def _check_same_output(network: nn.Module, path: Path) -> None:
    """Compare ONNX Runtime with PyTorch on a smooth and on a noisy picture."""
    import onnxruntime

    card = DepthModel.load(path, provider="cpu").card
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    for picture in _pictures(card.input_width, card.input_height):
        with torch.no_grad():
            wanted = network(torch.from_numpy(picture)).numpy()
        (output,) = session.run([card.output_name], {card.input_name: picture})
        difference = float(np.abs(output / wanted - 1.0).max())
        if not difference <= LARGEST_DIFFERENCE:
            raise ExportError(
                f"the exported depth differs from PyTorch's by {difference:.2g}, relative: "
                f"at most {LARGEST_DIFFERENCE:g} is allowed"
            )


def _pictures(width: int, height: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    noise = np.random.default_rng(0).random((1, 3, height, width), dtype=np.float32)
    slope = np.linspace(0.0, 1.0, height, dtype=np.float32)[None, None, :, None]
    return noise, np.ascontiguousarray(np.broadcast_to(slope, noise.shape))
