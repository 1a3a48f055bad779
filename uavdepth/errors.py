"""Errors of the library. Each names the value and the limit in its text."""

from __future__ import annotations

from collections.abc import Sequence


class UavDepthError(Exception):
    """Base of every error that this project raises on purpose: its text is fit to show a user."""


class CameraModelError(UavDepthError, ValueError):
    """Intrinsics or a mount that no camera can have."""


class ImageSizeError(UavDepthError, ValueError):
    """An image or depth map whose size is not the camera's."""


class ImageMaskError(UavDepthError, ValueError):
    """A mask of the camera's picture that cannot be read or does not fit it."""


class CalibrationError(UavDepthError, ValueError):
    """A board, pictures or a solution from which no camera can be calibrated."""


class ModelCardError(UavDepthError, ValueError):
    """A network file without a card, or with a card that lacks a key or holds an impossible value.

    Args:
        text: what is wrong, with the file.
        complaints: the same one by one, without the file.
    """

    def __init__(self, text: str, complaints: Sequence[str] = ()) -> None:
        super().__init__(text)
        self.complaints = tuple(complaints) or (text,)


class ModelFileError(UavDepthError):
    """A network file that is missing or that ONNX Runtime cannot load."""


class ProviderFallbackWarning(UserWarning):
    """A network runs, but not on the fastest provider that is installed."""


class HintError(UavDepthError, ValueError):
    """A ground or point hint with numbers that no scene has."""


class DepthCodecError(UavDepthError, ValueError):
    """A depth picture that cannot be encoded or decoded."""


class ScanError(UavDepthError, ValueError):
    """Settings or input that the obstacle scanner cannot work with."""


class SceneError(UavDepthError, ValueError):
    """A rendered scene that is unknown or cannot be built on this platform."""
