"""What the vehicle knows of the scene before the network has seen it: the ground, and measured points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraMount
from uavdepth.errors import HintError


@dataclass(frozen=True)
class GroundHint:
    """The ground as a level plane below the vehicle.

    Args:
        mount: the camera on the vehicle.
        attitude: of the vehicle when the picture was taken; yaw is not used.
        height_m: vertical height of the vehicle's origin above that plane, metres, above 0.

    Raises:
        HintError: roll, pitch or height that is not finite, or a height that is not above 0.
    """

    mount: CameraMount
    attitude: Attitude
    height_m: float

    def __post_init__(self) -> None:
        for name in ("roll_rad", "pitch_rad"):
            value = getattr(self.attitude, name)
            if not math.isfinite(value):
                raise HintError(f"the ground hint's {name} is {value}: a finite angle is needed")
        if not (math.isfinite(self.height_m) and self.height_m > 0):
            raise HintError(
                f"the ground hint's height_m is {self.height_m}: a finite height above 0 is needed"
            )

    @property
    def camera_height_m(self) -> float:
        """Vertical height of the camera above the plane, metres; may be below 0 where the plane is wrong."""
        return self.height_m - float(self.attitude.level_from_body[2] @ self.mount.position_body_m)


@dataclass(frozen=True, eq=False)
class PointHints:
    """Points of the picture whose depth is known: tracked and triangulated features, for example.

    Takes anything that numpy makes an array of, and keeps copies that cannot be written.

    Args:
        pixels: (N, 2) float32 x, y in the camera's pixels; the centre of the first pixel is (0, 0).
        depth_m: (N,) float32 z-depth along the optical axis in metres, above 0.
        relative_sigma: (N,) float32 one standard deviation of depth over depth, 0 or more.

    Raises:
        HintError: arrays of other shapes or lengths, numbers that are not finite, depth that is not
            above 0, or a sigma below 0.
    """

    pixels: NDArray[np.float32]
    depth_m: NDArray[np.float32]
    relative_sigma: NDArray[np.float32]

    def __post_init__(self) -> None:
        pixels = _array("pixels", self.pixels)
        if pixels.size == 0:
            pixels = pixels.reshape(0, 2)
        if pixels.ndim != 2 or pixels.shape[1] != 2:
            raise HintError(f"the point hints' pixels have the shape {pixels.shape}: (N, 2) is needed")
        object.__setattr__(self, "pixels", pixels)
        for name in ("depth_m", "relative_sigma"):
            values = _array(name, getattr(self, name))
            if values.shape != (len(pixels),):
                raise HintError(
                    f"the point hints' {name} has the shape {values.shape}: ({len(pixels)},) is needed, "
                    "one for each pixel"
                )
            object.__setattr__(self, name, values)
        _refuse("depth_m", self.depth_m, self.depth_m <= 0, "above 0 m")
        _refuse("relative_sigma", self.relative_sigma, self.relative_sigma < 0, "0 or more")
        for values in (self.pixels, self.depth_m, self.relative_sigma):
            values.flags.writeable = False

    def __len__(self) -> int:
        return len(self.depth_m)


@dataclass(frozen=True)
class Hints:
    """What a network gets besides the picture; None where nothing is known.

    Args:
        ground: the level ground below the vehicle.
        points: points of known depth.
    """

    ground: GroundHint | None = None
    points: PointHints | None = None


def _array(name: str, values: ArrayLike) -> NDArray[np.float32]:
    try:
        with np.errstate(over="ignore"):
            array = np.array(values, dtype=np.float32)
    except (TypeError, ValueError) as error:
        raise HintError(f"the point hints' {name} cannot be read as numbers: {error}") from error
    _refuse(name, array, ~np.isfinite(array), "finite")
    return array


def _refuse(name: str, values: NDArray[np.float32], bad: NDArray[np.bool_], needed: str) -> None:
    if bad.any():
        index = int(np.flatnonzero(bad)[0])
        number = index // 2 if values.ndim == 2 else index
        raise HintError(
            f"the point hints' {name} of point {number} is {float(values.flat[index]):g}: {needed} is needed"
        )
