"""Pictures along a way, with what an autopilot said of it and what is true."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import GroundHint


@dataclass(frozen=True, eq=False)
class Said:
    """What the autopilot said at one time; None for what it did not.

    Args:
        at_ns: on the clock of the pictures.
        attitude: an ATTITUDE.
        position_ned_m, velocity_ned_mps: (3,) each, a LOCAL_POSITION_NED.
    """

    at_ns: int
    attitude: Attitude | None = None
    position_ned_m: NDArray[np.float64] | None = None
    velocity_ned_mps: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Moment:
    """One picture.

    Args:
        at_ns: when it was taken.
        image_bgr: (H, W, 3) uint8.
        truth_m: (H, W) float32 z-depth, +inf sky, NaN where nothing is known; None: nothing at all.
        said: what came from the autopilot since the picture before.
        ground: the ground as the rangefinder tells it, or None.
        speed_mps: true speed of the vehicle.
    """

    at_ns: int
    image_bgr: NDArray[np.uint8]
    truth_m: NDArray[np.float32] | None
    said: tuple[Said, ...]
    ground: GroundHint | None
    speed_mps: float


class Journey(Protocol):
    """A row of moments of one camera."""

    @property
    def name(self) -> str:
        """What it is called in the report."""

    @property
    def group(self) -> str:
        """What it is summed up with: "flight", "recorded", "kitti raw" or "kitti odometry"."""

    @property
    def camera(self) -> CameraModel:
        """The camera."""

    @property
    def mount(self) -> CameraMount:
        """How it sits on the vehicle."""

    def moments(self) -> Iterator[Moment]:
        """Every picture in turn."""
