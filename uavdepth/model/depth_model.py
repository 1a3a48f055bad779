"""The depth network: a picture and what the vehicle knows in, depth at the camera's pixels out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.errors import ImageSizeError, ModelCardError, ModelFileError
from uavdepth.model.card import ModelCard
from uavdepth.model.hint_levels import hint_levels
from uavdepth.model.hint_planes import ground_plane, point_pixels
from uavdepth.model.hints import Hints
from uavdepth.model.inference import InferenceSession, open_session
from uavdepth.model.network_file import WEIGHTS_FOLDER, find_network, network_problems, read_card
from uavdepth.model.point_fit import fit_to_points
from uavdepth.model.point_pixels import PointPixels

__all__ = ["WEIGHTS_FOLDER", "DepthModel"]

RELATIVE_REACH = 1e4
"""Relative inverse depth of 0 is "as far as can be": it is taken for so many times the nearest depth."""


class DepthModel:
    """A loaded depth network with its card. Made by `DepthModel.load`.

    Example:
        model = DepthModel.load()
        depth = model.infer(image_bgr, camera).depth_m
    """

    def __init__(self, inference: InferenceSession, card: ModelCard, source: str) -> None:
        self._session: Any = inference.session
        self._output_names = [card.output_name] + ([card.uncertainty_name] if card.uncertainty else [])
        # What each of a pixel's 256 values becomes, for the channels in the network's order.
        levels = np.arange(256, dtype=np.float32)[:, None] / np.float32(255.0)
        normalised = (levels - np.array(card.mean, np.float32)) / np.array(card.std, np.float32)
        ordered = normalised if card.channel_order == "rgb" else normalised[:, ::-1]
        self._pixel_table = np.asarray(ordered[None].copy(), np.float32)
        self._channel_tables = np.asarray(ordered.T.copy(), np.float32)
        self._is_half = any(
            item.name == card.input_name and item.type == "tensor(float16)"
            for item in inference.session.get_inputs()
        )
        self.card = card
        self.source = source
        self.provider = inference.provider
        """ "tensorrt", "cuda", "openvino" or "cpu": what really runs the network."""
        self.precision = inference.precision
        """ "fp32", "bf16" or "int8": the number format that it computes in."""
        self.fallback_reason = inference.fallback_reason
        """Why provider "auto" did not take a better one that is installed, or None."""

    @classmethod
    def load(
        cls,
        path_or_name: str | Path = "default",
        provider: str = "auto",
        threads: int | None = None,
        card: str | Path | None = None,
        precision: str = "auto",
    ) -> DepthModel:
        """Load a network and its card.

        Args:
            path_or_name: an ONNX file, or the name of a network that ships with the package.
            provider: "auto", "tensorrt", "cuda", "openvino" or "cpu".
            threads: threads for inference; None: one for each core.
            card: a TOML card for a foreign network. None: the card inside the file, else `FILE.onnx.toml`.
            precision: "float", "int8" for the network's 8-bit file (`uavdepth.model.int8_file`), or "auto"
                for the faster of the two.

        Raises:
            ModelFileError: the file is missing, is not an ONNX network, or the provider cannot run it.
            ModelCardError: no card in the file or beside it, a card with a missing, unknown or
                impossible key, or a card that does not describe this network.
        """
        path = find_network(path_or_name)
        inference = open_session(path, provider, threads, precision)
        read = read_card(inference.session, path, None if card is None else Path(card))
        problems = network_problems(inference.session, read)
        if problems:
            raise ModelCardError(f"{path}: " + "; ".join(problem.text for problem in problems))
        return cls(inference, read, str(path))

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        """Depth of one picture.

        Depth is clipped to the card's max_depth_m, so that a value of max_depth_m reads "there or
        beyond": the network never claims that nothing stands somewhere, and +inf never leaves it. A
        prediction that is not finite is unknown. Depth of a network that is not metric is in a unit of
        its own, and inverse depth up to scale and shift is no depth yet: see `DepthMap`.

        The answer is brought to the camera's pixels by nearest neighbour: between an obstacle at 5 m
        and a background at 50 m interpolation would invent surfaces at 16 m.

        Args:
            image_bgr: (H, W, 3) uint8 picture of this camera, not undistorted.
            camera: the camera, in the pixels of the picture.
            hints: what the vehicle knows. Those that the network does not take are left out, and it
                works without those that are not given. The answer of one that takes points is drawn to
                them (`uavdepth.model.point_fit`).

        Raises:
            ImageSizeError: the picture's size is not the camera's, or it is not an 8-bit BGR picture.
            ModelFileError: an output that is no picture of numbers.
        """
        _check_picture(image_bgr, camera)
        width, height = self.card.input_size(camera)
        inputs: dict[str, NDArray[Any]] = {self.card.input_name: self._prepare(image_bgr, width, height)}
        ground, points = self._at_its_pixels(hints or Hints(), camera)
        inputs.update(self._hint_inputs(ground, points))
        outputs = self._session.run(self._output_names, inputs)

        values = self._rows_and_columns(outputs[0])
        if self.card.output == "affine_inverse_depth":
            values = np.where(np.isfinite(values), values, np.float32(np.nan))
            return DepthMap.from_affine(_to_pixels_of(camera, values))
        logs = self._rows_and_columns(outputs[1]) if self.card.uncertainty else None
        if self.card.output == "log_inverse_depth":
            if logs is not None and len(points):
                values = fit_to_points(values, _exponential(logs), points)
            values = _enlarged(values, (width, height))
            logs = None if logs is None else _enlarged(logs, (width, height))
        sigma = None if logs is None else _exponential(logs)
        depth = _to_pixels_of(camera, self._depth(values, camera.fx * width / camera.width))
        if sigma is not None:
            sigma = _to_pixels_of(camera, sigma)
            sigma[~np.isfinite(sigma) | np.isnan(depth)] = np.nan
        return DepthMap(depth, sigma)

    def _prepare(self, image_bgr: NDArray[np.uint8], width: int, height: int) -> NDArray[Any]:
        """(1, 3, h, w) or (1, h, w, 3) input: resized and normalised as the card says."""
        if image_bgr.shape[:2] != (height, width):
            # Area averaging: the only resize that does not alias fine texture when shrinking.
            image_bgr = np.asarray(cv2.resize(image_bgr, (width, height), interpolation=cv2.INTER_AREA))
        if self.card.channel_order == "rgb":
            image_bgr = np.asarray(cv2.cvtColor(image_bgr, cv2.COLOR_BGR2RGB))
        if self.card.layout == "nhwc":
            picture = np.asarray(cv2.LUT(image_bgr, self._pixel_table), np.float32)
        else:
            picture = np.empty((3, height, width), dtype=np.float32)
            for number, channel in enumerate(cv2.split(image_bgr)):
                cv2.LUT(channel, self._channel_tables[number], dst=picture[number])
        return picture[None].astype(np.float16) if self._is_half else picture[None]

    def _at_its_pixels(self, hints: Hints, camera: CameraModel) -> tuple[NDArray[np.float32], PointPixels]:
        """(h, w) q of the ground, and the points; what is not given or not taken is known nowhere."""
        card = self.card
        width, height, focal_px = card.input_width, card.input_height, card.focal_px or 1.0
        ground, points = np.zeros((height, width), np.float32), PointPixels.none(width, height)
        if "ground" in card.hints and hints.ground is not None:
            ground = ground_plane(hints.ground, camera, width, height, focal_px)
        if "points" in card.hints and hints.points is not None:
            points = point_pixels(hints.points, camera, width, height, focal_px)
        return ground, points

    def _hint_inputs(
        self, ground: NDArray[np.float32], points: PointPixels
    ) -> dict[str, NDArray[np.float32]]:
        """The network's inputs for hints."""
        card = self.card
        if card.hint_layout == "levels":
            return hint_levels(ground, points)
        inputs = {}
        if "ground" in card.hints:
            inputs[card.ground_name] = ground[None, None]
        if "points" in card.hints:
            inputs[card.points_name] = points.planes[None]
        return inputs

    def _rows_and_columns(self, output: NDArray[Any]) -> NDArray[np.float32]:
        """(h, w) float32 of an output, whatever axes of length 1 it has."""
        sides = [side for side in np.shape(output) if side != 1]
        if len(sides) != 2 or 0 in sides:
            raise ModelFileError(
                f"{self.source}: the network's output is {np.shape(output)}: rows and columns are needed"
            )
        return np.asarray(output, dtype=np.float32).reshape(sides)

    def _depth(self, output: NDArray[np.float32], focal_px: float) -> NDArray[np.float32]:
        """(h, w) float32 z-depth of the raw depth output; the formulas of `ModelCard`."""
        card = self.card
        ratio = np.float32(1.0 if card.focal_px is None else focal_px / card.focal_px)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            if card.output == "log_inverse_depth":
                depth = np.exp(-output) * ratio
            elif card.output == "inverse_depth":
                depth = ratio / output
            elif card.output == "depth":
                depth = output * ratio
            else:
                depth = _relative_depth(output)
            if card.max_depth_m is not None:
                np.minimum(depth, np.float32(card.max_depth_m), out=depth)
            # Depth 0 is where a prediction ran off the scale: no more to be believed than NaN.
            depth[~(np.isfinite(output) & np.isfinite(depth) & (depth > 0))] = np.nan
        return np.asarray(depth, dtype=np.float32)


def _relative_depth(inverse: NDArray[np.float32]) -> NDArray[np.float32]:
    """Depth up to a factor; inverse depth of 0 and below is the far end, not infinity."""
    largest = np.max(inverse, where=np.isfinite(inverse), initial=0.0)
    if largest <= 0:
        return np.full_like(inverse, np.nan)
    return np.asarray(1.0 / np.maximum(inverse, largest / np.float32(RELATIVE_REACH)), dtype=np.float32)


def _check_picture(image_bgr: NDArray[np.uint8], camera: CameraModel) -> None:
    shape = np.shape(image_bgr)
    if len(shape) != 3 or shape[2] != 3 or image_bgr.dtype != np.uint8:
        kind = getattr(image_bgr, "dtype", type(image_bgr).__name__)
        raise ImageSizeError(f"the picture is {kind} {shape}: uint8 (height, width, 3) is needed")
    if shape[:2] != (camera.height, camera.width):
        raise ImageSizeError(
            f"the picture is {shape[1]}x{shape[0]} pixels, the camera is {camera.width}x{camera.height}"
        )


def _exponential(logs: NDArray[np.float32]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        return np.exp(logs, dtype=np.float32)


def _enlarged(logs: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """A smaller map at (width, height), bilinear: the last step of a network that was taught with it."""
    if logs.shape[1] >= size[0] or logs.shape[0] >= size[1]:
        return logs
    return np.asarray(cv2.resize(logs, size, interpolation=cv2.INTER_LINEAR), np.float32)


def _to_pixels_of(camera: CameraModel, values: NDArray[np.float32]) -> NDArray[np.float32]:
    if values.shape == (camera.height, camera.width):
        return values
    size = (camera.width, camera.height)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_NEAREST_EXACT), dtype=np.float32)
