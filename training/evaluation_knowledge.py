"""What the vehicle knows beside the picture when a network is measured: as wrong as in flight."""

from __future__ import annotations

import math
import zlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from training.data.point_hints import sample_point_hints
from training.errors import EvaluationError
from training.evaluation_frames import EvaluationFrame
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hint_planes import MOST_POINTS
from uavdepth.model.hints import GroundHint, Hints, PointHints

TILT_SIGMA_RAD = math.radians(0.5)
"""Standard deviation of the error of roll and of pitch at the moment of the picture."""

HEIGHT_SIGMA = 0.02
"""Standard deviation of the rangefinder's relative error."""

LOWEST_HEIGHT_M = 0.3
"""Lower, a rangefinder gives no height."""

DEFAULT_POINTS = (100,)

_GROUND_STREAM, _POINT_STREAM = 0, 1
"""Each kind of knowledge has random numbers of its own: other counts of points leave the ground alone."""


@dataclass(frozen=True)
class HintMode:
    """Which hints a network is given.

    Args:
        ground: the ground's plane, where the height is known.
        points: at most so many points; 0 for none.
    """

    ground: bool = False
    points: int = 0

    @property
    def label(self) -> str:
        """Its name in tables and JSON: "none", "ground", "ground+100 points"."""
        parts = ["ground"] * self.ground + [f"{self.points} points"] * (self.points > 0)
        return "+".join(parts) or "none"


@dataclass(frozen=True)
class Knowledge:
    """What the vehicle knows of one picture.

    Args:
        camera, mount: exactly.
        attitude: as it was measured.
        height_m: of the vehicle's origin above the ground as it was measured; None where it is not known.
        points: by the number that was asked for.
    """

    camera: CameraModel
    mount: CameraMount
    attitude: Attitude
    height_m: float | None
    points: Mapping[int, PointHints] = field(default_factory=dict)

    @property
    def ground(self) -> GroundHint | None:
        """The ground's plane, or None without a height."""
        return None if self.height_m is None else GroundHint(self.mount, self.attitude, self.height_m)

    def hints(self, mode: HintMode) -> Hints:
        """The hints of a mode, as far as they are known."""
        return Hints(self.ground if mode.ground else None, self.points[mode.points] if mode.points else None)

    def without_points(self, truth_m: NDArray[np.float32]) -> NDArray[np.float32]:
        """(H, W) the truth, NaN at every pixel of which any mode was told the depth."""
        scored = truth_m.copy()
        for hints in self.points.values():
            column, row = _pixel(hints, self.camera)
            scored[row, column] = np.nan
        return scored


def hint_modes(known_to_model: Collection[str], point_counts: Sequence[int]) -> tuple[HintMode, ...]:
    """The modes in which a network is measured: without hints, and with what it takes.

    Args:
        known_to_model: hints of its card, "ground" and "points".
        point_counts: how many points.

    Raises:
        EvaluationError: a count that is not 1 to `MOST_POINTS`, or given twice.
    """
    if len(set(point_counts)) != len(point_counts):
        raise EvaluationError(f"counts of points are {list(point_counts)}: each only once")
    for count in point_counts:
        if not 1 <= count <= MOST_POINTS:
            raise EvaluationError(f"{count} points are asked for: 1 to {MOST_POINTS} are possible")
    ground = "ground" in known_to_model
    modes = [HintMode()]
    if ground:
        modes.append(HintMode(ground=True))
    if "points" in known_to_model:
        modes.extend(HintMode(ground, count) for count in point_counts)
    return tuple(modes)


def vehicle_knowledge(item: EvaluationFrame, point_counts: Sequence[int]) -> Knowledge:
    """What a vehicle would have known of a rendered frame; the same frame gives the same knowledge."""
    frame = item.frame
    rng = np.random.default_rng([*frame_key(item.scene, item.seed, item.index), _GROUND_STREAM])
    roll, pitch, height = rng.standard_normal(3) * (TILT_SIGMA_RAD, TILT_SIGMA_RAD, HEIGHT_SIGMA)
    attitude = frame.attitude
    measured = Attitude(attitude.roll_rad + roll, attitude.pitch_rad + pitch, attitude.yaw_rad)
    height_m = None if frame.height_m is None else float(frame.height_m * (1.0 + height))
    points = {}
    for count in point_counts:
        rng = np.random.default_rng([*frame_key(item.scene, item.seed, item.index), _POINT_STREAM, count])
        points[count] = sample_point_hints(rng, frame.image_bgr, frame.depth_m, frame.camera, count)
    known = height_m is not None and height_m >= LOWEST_HEIGHT_M
    return Knowledge(frame.camera, frame.mount, measured, height_m if known else None, points)


def frame_key(scene: str, seed: int, index: int) -> list[int]:
    """Numbers that stand for a frame, to seed a generator with."""
    return [zlib.crc32(scene.encode()), seed, index]


def points_ratio(points: PointHints, camera: CameraModel, depth_m: NDArray[np.float32]) -> float | None:
    """Median of the points' depth over the depth map's at their pixels; None where no point tells it."""
    column, row = _pixel(points, camera)
    there = depth_m[row, column]
    usable = np.isfinite(there) & (there > 0)
    return float(np.median(points.depth_m[usable] / there[usable])) if usable.any() else None


def _pixel(points: PointHints, camera: CameraModel) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Column and row of the pixels in which points lie, inside the picture."""
    limits = (camera.width - 1, camera.height - 1)
    column, row = np.clip(np.rint(points.pixels).astype(np.intp), 0, limits).T
    return column, row
