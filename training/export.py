"""From a checkpoint to the ONNX file that flies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from itertools import product
from pathlib import Path

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from pydantic import JsonValue
from torch import Tensor, nn

from training.checkpoint import Checkpoint
from training.errors import ExportError
from training.half_weights import rounded_network, store_in_half
from training.networks.depth_network import DepthNetwork
from training.networks.hint_levels import HintLevels
from training.networks.hint_levels import hint_levels as training_levels
from training.normalization import FOCAL_REFERENCE_PX, IMAGE_MEAN, IMAGE_STD, MAX_DEPTH_M
from training.onnx_file import trace, write_checked
from uavdepth.model.card import ModelCard
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hint_levels import hint_levels, hint_shapes
from uavdepth.model.point_pixels import PointPixels

LARGEST_DIFFERENCE = 1e-3
"""Of log inverse depth between PyTorch and ONNX Runtime: 0.1 % of depth."""

LICENCE = "Apache-2.0"

INTENDED_USE = (
    "Distances of obstacles 2 to 20 m ahead of a slow drone, from a calibrated camera of 60 to 110 degrees, "
    "1 to 60 m above ground, pitch and roll to 30 degrees, with the ground's hint and measured points where "
    "they are known; as an aid beside a pilot."
)
LIMITS = (
    "Taught by rendered pictures, photographs on some surfaces apart. Without hints its metres are a guess. "
    "Thin things (wires, twigs), glass, water, night and fog are missed or misjudged. It says its doubt as "
    "sigma: heed it."
)

EXPORT_SIZES = ((384, 192), (640, 320))
"""Width and height of the files that ship."""

_KNOWN_DEPTH_Q = 0.1
_KNOWN_EVERY = 37


class _TwoOutputs(nn.Module):
    """The network with its outputs as a plain tuple: ONNX knows no dataclasses.

    The picture comes with its channels last, as cameras have it and OpenVINO computes with it. The outputs
    stay at half the picture's size; `DepthModel` enlarges them as the network would, in single precision and
    0.1 ms, where OpenVINO with AMX took 0.7 ms at 384x192 and 2 ms at 640x320 (23 November 2026).
    """

    def __init__(self, network: DepthNetwork, sigma_factor: float = 1.0) -> None:
        super().__init__()
        self.network = network
        self._log_factor = math.log(sigma_factor)

    def forward(self, image: Tensor, *hints: Tensor) -> tuple[Tensor, Tensor]:
        output = self.network.at_half_size(image.permute(0, 3, 1, 2), HintLevels.of_inputs(hints))
        return output.log_inverse_depth, output.log_sigma + self._log_factor


def export_checkpoint(
    checkpoint: Checkpoint,
    path: Path,
    name: str,
    measured: Mapping[str, JsonValue] | None = None,
    size: tuple[int, int] | None = None,
    sigma_factor: float = 1.0,
    further_data: str = "",
) -> ModelCard:
    """Write the averaged weights of a run, in half precision, as an ONNX file with its card.

    Normalisation of the picture is not part of the graph, `DepthModel` does it as the card says. The file
    is read back with `DepthModel` and its output compared with PyTorch's, with and without hints, before it
    takes its place at `path`.

    Args:
        checkpoint: of the run.
        path: the ONNX file to write; a failure leaves an old one whole.
        name: of the network, for status and records.
        measured: errors on frames it was not trained on, for the card.
        size: width and height of the input, divisible by 32; None takes those of the run's last phase.
        sigma_factor: what the network's sigma is multiplied by, see `training.doubt_calibration`.
        further_data: what else than its frames it learnt from, with licences, for the card.

    Returns:
        The card that was written.

    Raises:
        ExportError: a size that the network cannot take, a factor that is not above 0, a weight that half
            precision cannot hold, or a written network that does not compute what PyTorch does.
        CheckpointError: weights that do not fit the network.
    """
    if not (math.isfinite(sigma_factor) and sigma_factor > 0):
        raise ExportError(f"the factor of sigma is {sigma_factor}: a finite number above 0 is needed")
    last = checkpoint.settings.phases[-1]
    card = make_card(checkpoint, name, measured or {}, size or (last.width, last.height), further_data)
    network = _TwoOutputs(rounded_network(checkpoint.averaged_network()), sigma_factor).eval()
    model = _to_onnx(network, card)
    store_in_half(model)
    write_checked(model, card, path, lambda file: _check_same_output(network, file))
    return card


def make_card(
    checkpoint: Checkpoint,
    name: str,
    measured: Mapping[str, JsonValue],
    size: tuple[int, int],
    further_data: str = "",
) -> ModelCard:
    """What the file will say about itself. Raises ExportError for a size that the network cannot take."""
    if any(side % 32 or side < 64 for side in size):
        raise ExportError(f"the input is {size[0]}x{size[1]}: multiples of 32 from 64 are needed")
    return ModelCard(
        card_version=2,
        name=name,
        input_width=size[0],
        input_height=size[1],
        hints=("ground", "points"),
        layout="nhwc",
        hint_layout="levels",
        mean=IMAGE_MEAN,
        std=IMAGE_STD,
        output="log_inverse_depth",
        metric=True,
        uncertainty=True,
        focal_px=FOCAL_REFERENCE_PX,
        max_depth_m=MAX_DEPTH_M,
        training_data=(
            f"{checkpoint.frames} rendered frames with exact depth of {checkpoint.worlds} worlds of "
            "uavdepth.scenes; encoder EfficientNet-Lite0 from ImageNet weights (Apache-2.0)"
            f"{'; ' if further_data else ''}{further_data}"
        ),
        effort=(
            f"{checkpoint.images} pictures in {checkpoint.step} steps, {checkpoint.trained_s / 3600:.1f} "
            "hours; runs that it started from not counted"
        ),
        intended_use=INTENDED_USE,
        limits=LIMITS,
        licence=LICENCE,
        measured=dict(measured),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def _to_onnx(network: _TwoOutputs, card: ModelCard) -> onnx.ModelProto:
    shapes = {
        card.input_name: (1, card.input_height, card.input_width, 3),
        **hint_shapes(card.input_width, card.input_height),
    }
    inputs = tuple(torch.zeros(shape) for shape in shapes.values())
    return trace(network, inputs, tuple(shapes), (card.output_name, card.uncertainty_name))


def _check_same_output(network: _TwoOutputs, path: Path) -> None:
    """Compare ONNX Runtime with PyTorch on a smooth and a noisy picture, with each subset of hints.

    Each side makes the levels of the hints with its own code.
    """
    import onnxruntime

    card = DepthModel.load(path, provider="cpu").card
    names = [card.output_name, card.uncertainty_name]
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    for image, ground, points in product(_pictures(card), *_hint_maps(card)):
        with torch.no_grad():
            hints = training_levels(torch.from_numpy(ground), torch.from_numpy(points))
            wanted = network(torch.from_numpy(image), *hints.inputs)
        outputs = session.run(
            names, {card.input_name: image, **hint_levels(ground[0, 0], PointPixels.of_planes(points[0]))}
        )
        for name, want, output in zip(
            (card.output_name, card.uncertainty_name), wanted, outputs, strict=True
        ):
            difference = float(np.abs(want.numpy() - output).max())
            if not difference <= LARGEST_DIFFERENCE:
                raise ExportError(
                    f"the exported output '{name}' differs from PyTorch's by {difference:.2g}, "
                    f"at most {LARGEST_DIFFERENCE:g} is allowed"
                )


def _pictures(card: ModelCard) -> list[NDArray[np.float32]]:
    shape = (1, card.input_height, card.input_width, 3)
    noise = np.random.default_rng(0).normal(0.0, 1.0, shape).astype(np.float32)
    slope = np.linspace(-1.0, 1.0, card.input_height, dtype=np.float32)[None, :, None, None]
    return [noise, np.ascontiguousarray(np.broadcast_to(slope, shape))]


def _hint_maps(card: ModelCard) -> tuple[list[NDArray[np.float32]], list[NDArray[np.float32]]]:
    """The ground's and the points' input, each without and with a hint."""
    size = (card.input_height, card.input_width)
    ground, points = np.zeros((1, 1, *size), np.float32), np.zeros((1, 2, *size), np.float32)
    known_ground, known_points = ground.copy(), points.copy()
    known_ground[..., size[0] // 2 :, :] = np.linspace(0.01, 1.0, size[0] - size[0] // 2)[:, None]
    known_points[0, 0].flat[::_KNOWN_EVERY] = _KNOWN_DEPTH_Q
    known_points[0, 1].flat[::_KNOWN_EVERY] = np.linspace(
        0.1, 1.0, known_points[0, 1].flat[::_KNOWN_EVERY].size
    )
    return [ground, known_ground], [points, known_points]
