"""The depth network: a picture in, depth at the camera's pixels out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.errors import ImageSizeError, ModelCardError, ModelFileError
from uavdepth.inference import InferenceSession, open_session
from uavdepth.model_card import CARD_FILE_SUFFIX, CARD_METADATA_KEY, ModelCard

WEIGHTS_FOLDER = Path(__file__).parent / "weights"
"""Networks that ship with the package: `<name>.onnx`."""


class DepthModel:
    """A loaded depth network with its card. Made by `DepthModel.load`.

    Example:
        model = DepthModel.load()
        depth = model.infer(image_bgr, camera).depth_m
    """

    def __init__(self, inference: InferenceSession, card: ModelCard, source: str) -> None:
        self._session: Any = inference.session
        self._output_names = [card.output_name] + ([card.uncertainty_name] if card.uncertainty else [])
        self._gain = tuple(1.0 / (255.0 * std) for std in card.std)
        self._offset = tuple(-mean / std for mean, std in zip(card.mean, card.std, strict=True))
        self.card = card
        self.source = source
        self.provider = inference.provider
        """ "cpu" or "openvino": what really runs the network."""
        self.fallback_reason = inference.fallback_reason
        """Why provider "auto" did not take OpenVINO, or None."""

    @classmethod
    def load(
        cls, path_or_name: str | Path = "default", provider: str = "auto", threads: int | None = None
    ) -> DepthModel:
        """Load a network and its card.

        Args:
            path_or_name: an ONNX file, or the name of a network that ships with the package.
            provider: "auto", "cpu" or "openvino".
            threads: threads for inference; None: one for each core.

        Raises:
            ModelFileError: the file is missing, is not an ONNX network, or the provider cannot run it.
            ModelCardError: no card in the file or beside it, a card with a missing, unknown or
                impossible key, or a card that does not describe this network.
        """
        path = _find(path_or_name)
        inference = open_session(path, provider, threads)
        card = _read_card(inference.session, path)
        _check_network(inference.session, card, path)
        return cls(inference, card, str(path))

    def infer(self, image_bgr: NDArray[np.uint8], camera: CameraModel) -> DepthMap:
        """Depth of one picture.

        Depth is clipped to the card's max_depth_m, so that a value of max_depth_m reads "there or
        beyond": the network never claims that nothing stands somewhere, and +inf never leaves it. A
        prediction that is not finite is unknown.

        The answer is brought to the camera's pixels by nearest neighbour: between an obstacle at 5 m
        and a background at 50 m interpolation would invent surfaces at 16 m.

        Args:
            image_bgr: (H, W, 3) uint8 picture of this camera, not undistorted.
            camera: the camera, in the pixels of the picture.

        Raises:
            ImageSizeError: the picture's size is not the camera's, or it is not an 8-bit BGR picture.
        """
        _check_picture(image_bgr, camera)
        outputs = self._session.run(self._output_names, {self.card.input_name: self._prepare(image_bgr)})

        focal_px = camera.fx * self.card.input_width / camera.width
        depth = self._metres(outputs[0][0, 0], focal_px)
        sigma = None
        if self.card.uncertainty:
            with np.errstate(over="ignore"):
                sigma = np.exp(outputs[1][0, 0], dtype=np.float32)
            sigma[~np.isfinite(sigma) | np.isnan(depth)] = np.nan
            sigma = _to_pixels_of(camera, sigma)
        return DepthMap(_to_pixels_of(camera, depth), sigma)

    def _prepare(self, image_bgr: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(1, 3, h, w) float32 input: resized, RGB, normalised as the card says."""
        width, height = self.card.input_width, self.card.input_height
        if image_bgr.shape[:2] != (height, width):
            # Area averaging: the only resize that does not alias fine texture when shrinking.
            image_bgr = np.asarray(cv2.resize(image_bgr, (width, height), interpolation=cv2.INTER_AREA))
        picture = np.empty((1, 3, height, width), dtype=np.float32)
        for channel in range(3):
            plane = picture[0, channel]
            np.multiply(image_bgr[:, :, 2 - channel], np.float32(self._gain[channel]), out=plane)
            plane += np.float32(self._offset[channel])
        return picture

    def _metres(self, output: NDArray[np.float32], focal_px: float) -> NDArray[np.float32]:
        """(h, w) float32 z-depth of the raw depth output; the three formulas of `ModelCard`."""
        ratio = np.float32(focal_px / self.card.focal_px)
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            if self.card.output == "log_inverse_depth":
                depth = np.exp(-output) * ratio
            elif self.card.output == "inverse_depth":
                depth = ratio / output
            else:
                depth = output * ratio
            np.minimum(depth, np.float32(self.card.max_depth_m), out=depth)
            # Depth 0 is where a prediction ran off the scale: no more to be believed than NaN.
            depth[~(np.isfinite(output) & (depth > 0))] = np.nan
        return np.asarray(depth, dtype=np.float32)


def _find(path_or_name: str | Path) -> Path:
    text = str(path_or_name)
    if isinstance(path_or_name, str) and text and not Path(text).suffix and Path(text).name == text:
        path = WEIGHTS_FOLDER / f"{text}.onnx"
        if not path.is_file() and not Path(text).is_file():
            known = sorted(file.stem for file in WEIGHTS_FOLDER.glob("*.onnx"))
            raise ModelFileError(
                f"there is no network named {text!r}; named ones are: {', '.join(known) or 'none'}; "
                "give a file by its path, with its suffix"
            )
        return path if path.is_file() else Path(text)
    return Path(path_or_name)


def _read_card(session: Any, path: Path) -> ModelCard:
    text = session.get_modelmeta().custom_metadata_map.get(CARD_METADATA_KEY)
    if text is not None:
        return ModelCard.from_json(text, str(path))
    beside = Path(f"{path}{CARD_FILE_SUFFIX}")
    try:
        return ModelCard.from_json(beside.read_bytes(), str(beside))
    except FileNotFoundError as error:
        raise ModelCardError(
            f"{path}: the metadata key '{CARD_METADATA_KEY}' is missing, "
            f"and there is no {beside.name} beside it"
        ) from error
    except OSError as error:
        raise ModelCardError(f"{beside}: cannot be read: {error.strerror}") from error


def _check_network(session: Any, card: ModelCard, path: Path) -> None:
    """Refuse a card that was written for another network."""
    inputs = {item.name: item for item in session.get_inputs()}
    outputs = {item.name for item in session.get_outputs()}
    if set(inputs) != {card.input_name}:
        raise ModelCardError(
            f"{path}: the card's input_name is '{card.input_name}', the network's inputs are {sorted(inputs)}"
        )
    needed = [("output_name", card.output_name)]
    if card.uncertainty:
        needed.append(("uncertainty_name", card.uncertainty_name))
    for key, name in needed:
        if name not in outputs:
            raise ModelCardError(
                f"{path}: the card's {key} is '{name}', the network's outputs are {sorted(outputs)}"
            )
    picture = inputs[card.input_name]
    if picture.type != "tensor(float)":
        raise ModelCardError(f"{path}: the network's input is {picture.type}: float32 is needed")
    wanted = [1, 3, card.input_height, card.input_width]
    fits = len(picture.shape) == 4 and all(
        not isinstance(size, int) or size == want for size, want in zip(picture.shape, wanted, strict=True)
    )
    if not fits:
        raise ModelCardError(
            f"{path}: the card asks for an input of {wanted}, the network's is {picture.shape}"
        )


def _check_picture(image_bgr: NDArray[np.uint8], camera: CameraModel) -> None:
    shape = np.shape(image_bgr)
    if len(shape) != 3 or shape[2] != 3 or image_bgr.dtype != np.uint8:
        kind = getattr(image_bgr, "dtype", type(image_bgr).__name__)
        raise ImageSizeError(f"the picture is {kind} {shape}: uint8 (height, width, 3) is needed")
    if shape[:2] != (camera.height, camera.width):
        raise ImageSizeError(
            f"the picture is {shape[1]}x{shape[0]} pixels, the camera is {camera.width}x{camera.height}"
        )


def _to_pixels_of(camera: CameraModel, values: NDArray[np.float32]) -> NDArray[np.float32]:
    if values.shape == (camera.height, camera.width):
        return values
    size = (camera.width, camera.height)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_NEAREST_EXACT), dtype=np.float32)
