"""Intrinsics of pictures that bring none of their own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.pictures import read_picture, require_first_picture
from uavdepth.camera import CameraModel
from uavdepth.errors import CameraModelError


@dataclass(frozen=True)
class Calibration:
    """What a user says of a camera: its whole model, or its horizontal field of view.

    Args:
        camera: intrinsics of the pictures as they are.
        horizontal_fov_deg: angle between the picture's left and right edge; for square pixels and a
            principal point in the middle. Used where there is no `camera`.
    """

    camera: CameraModel | None = None
    horizontal_fov_deg: float | None = None

    def of(self, picture: Path) -> CameraModel:
        """The model for pictures like this one.

        Raises:
            TrainingDataError: nothing is known, the picture has another size, or it cannot be read where its
                size is needed.
        """
        if self.camera is not None:
            require_first_picture(picture, self.camera)
            return self.camera
        try:
            height, width = read_picture(picture).shape[:2]
        except BrokenFrameError as error:
            raise TrainingDataError(f"the camera's size is not known: {error}") from error
        return self.of_size(width, height, str(picture))

    def of_size(self, width: int, height: int, what: str) -> CameraModel:
        """The model for pictures of a size.

        Raises:
            TrainingDataError: nothing is known, or the calibration is for another size.
        """
        if self.camera is not None:
            if (self.camera.width, self.camera.height) != (width, height):
                raise TrainingDataError(
                    f"{what} is {width} x {height} pixels, its calibration is for "
                    f"{self.camera.width} x {self.camera.height}: give the calibration of these pictures"
                )
            return self.camera
        if self.horizontal_fov_deg is None:
            raise TrainingDataError(f"no intrinsics for {what}: give a calibration file or a field of view")
        try:
            return CameraModel.from_fov(width, height, self.horizontal_fov_deg)
        except CameraModelError as error:
            raise TrainingDataError(f"{what}: {error}") from error


NO_CALIBRATION = Calibration()
"""Nothing is known of the camera."""
