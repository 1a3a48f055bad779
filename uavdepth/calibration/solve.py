"""From corners in many pictures to the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.calibration.board import Board
from uavdepth.calibration.detection import Refusal, View
from uavdepth.camera import CameraModel
from uavdepth.errors import CalibrationError

FEWEST_VIEWS = 4
"""Three are enough for the equations; the fourth shows whether they agree."""

_OUTLIER_FACTOR = 3.0
_OUTLIER_FLOOR_PX = 0.5
"""A picture whose error is this many times the median's, and this large, is left out."""

_LEAST_FOCAL = 0.05
"""Of the picture's width: a pinhole camera with less would see 169 degrees."""

_OUTLIER_ROUNDS = 6
_LEFT_OUT_AT_MOST = 1 / 3
"""Of the pictures: if more disagree, it is the others that may be wrong."""


class Distortion(StrEnum):
    """The lens model: how many of OpenCV's coefficients are estimated."""

    NONE = "none"
    BROWN5 = "brown5"
    RATIONAL8 = "rational8"


_FLAGS = {
    Distortion.NONE: cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    Distortion.BROWN5: 0,
    Distortion.RATIONAL8: cv2.CALIB_RATIONAL_MODEL,
}
_COEFFICIENTS = {Distortion.NONE: 0, Distortion.BROWN5: 5, Distortion.RATIONAL8: 8}


@dataclass(frozen=True)
class SolvedView:
    """One picture and how well the camera explains it.

    Args:
        view: what was seen.
        error_px: (N, 2) float64, seen minus explained.
        rms_px: root mean square length of `error_px`.
        tilt_deg: angle between the board's normal and the optical axis; 0 faces the camera.
    """

    view: View
    error_px: NDArray[np.float64]
    rms_px: float
    tilt_deg: float


@dataclass(frozen=True)
class Calibration:
    """A camera and what it is worth.

    Args:
        camera: pixel centres at whole numbers.
        distortion: the lens model that was estimated.
        sigma: one standard deviation of fx, fy, cx, cy in pixels, then of the distortion's coefficients.
        rms_px: root mean square re-projection error over all corners.
        views: the pictures that were used.
        left_out: pictures that disagree with all others.
    """

    camera: CameraModel
    distortion: Distortion
    sigma: tuple[float, ...]
    rms_px: float
    views: tuple[SolvedView, ...]
    left_out: tuple[Refusal, ...]


def solve(
    views: Sequence[View],
    size: tuple[int, int],
    board: Board,
    distortion: Distortion = Distortion.BROWN5,
) -> Calibration:
    """The camera that explains the corners best (Zhang 2000), without pictures that contradict the others.

    Args:
        views: corners by picture.
        size: width and height of every picture, pixels.
        board: the printed one.
        distortion: lens model.

    Raises:
        CalibrationError: too few pictures, or corners that no camera explains.
    """
    if len(views) < FEWEST_VIEWS:
        raise CalibrationError(
            f"{len(views)} pictures show the board well enough, at least {FEWEST_VIEWS} are needed"
        )
    kept = list(views)
    left_out: list[Refusal] = []
    may_leave_out = min(int(len(views) * _LEFT_OUT_AT_MOST), len(views) - FEWEST_VIEWS)
    calibration = _solve_once(kept, size, board, distortion)
    for _ in range(_OUTLIER_ROUNDS):
        worst = _outliers(calibration.views)[: may_leave_out - len(left_out)]
        if not worst:
            break
        # A bad picture bends the fit and raises the others' errors: only those near the worst go at once.
        gone = [solved for solved in worst if solved.rms_px > 0.5 * worst[0].rms_px]
        left_out += [
            Refusal(
                solved.view.name,
                f"its corners miss by {solved.rms_px:.2f} pixels, those of the other pictures by "
                f"{_median_rms(calibration.views):.2f}: moved, bent or mistaken",
            )
            for solved in gone
        ]
        names = {id(solved.view) for solved in gone}
        kept = [view for view in kept if id(view) not in names]
        calibration = _solve_once(kept, size, board, distortion)
    return Calibration(
        calibration.camera,
        distortion,
        calibration.sigma,
        calibration.rms_px,
        calibration.views,
        tuple(left_out),
    )


def _median_rms(views: Sequence[SolvedView]) -> float:
    return float(np.median([solved.rms_px for solved in views]))


def _outliers(views: Sequence[SolvedView]) -> list[SolvedView]:
    """Worst first."""
    limit_px = max(_OUTLIER_FACTOR * _median_rms(views), _OUTLIER_FLOOR_PX)
    over = [solved for solved in views if solved.rms_px > limit_px]
    return sorted(over, key=lambda solved: solved.rms_px, reverse=True)


def _solve_once(
    views: Sequence[View], size: tuple[int, int], board: Board, distortion: Distortion
) -> Calibration:
    corners = board.corners_m
    objects = [corners[view.ids] for view in views]
    pixels = [view.pixels.reshape(-1, 1, 2) for view in views]
    optimise: Any = cv2.calibrateCameraExtended  # its stub refuses None, which stands for "no guess"
    try:
        _, matrix, coefficients, turns, shifts, sigma, _, _ = optimise(
            objects, pixels, size, None, None, flags=_FLAGS[distortion]
        )
    except cv2.error as error:
        raise CalibrationError(f"no camera explains the {len(views)} pictures: {error.err}") from error
    count = _COEFFICIENTS[distortion]
    lens = np.asarray(coefficients, np.float64).ravel()[:count]
    width, height = size
    focal_px = float(min(matrix[0, 0], matrix[1, 1]))
    if not (np.isfinite(matrix).all() and np.isfinite(lens).all() and focal_px > _LEAST_FOCAL * width):
        raise CalibrationError(
            f"no camera explains the {len(views)} pictures: the focal length came out as {focal_px:.3g} "
            "pixels; if all pictures face the board squarely, tilt it by 20 to 45 degrees to all sides"
        )
    camera = CameraModel(
        width,
        height,
        float(matrix[0, 0]),
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
        tuple(lens.tolist()),
    )
    solved = tuple(
        _explained(view, points, camera, turn, shift)
        for view, points, turn, shift in zip(views, objects, turns, shifts, strict=True)
    )
    squares = np.concatenate([np.sum(each.error_px**2, axis=1) for each in solved])
    return Calibration(
        camera,
        distortion,
        tuple(np.asarray(sigma, np.float64).ravel()[: 4 + count].tolist()),
        float(np.sqrt(squares.mean())),
        solved,
        (),
    )


def _explained(
    view: View,
    points_m: NDArray[np.float32],
    camera: CameraModel,
    turn: NDArray[np.float64],
    shift: NDArray[np.float64],
) -> SolvedView:
    projected, _ = cv2.projectPoints(points_m, turn, shift, camera.matrix, np.array(camera.distortion))
    error_px = view.pixels.astype(np.float64) - projected.reshape(-1, 2)
    facing = abs(float(cv2.Rodrigues(turn)[0][2, 2]))
    return SolvedView(
        view,
        error_px,
        float(np.sqrt(np.mean(np.sum(error_px**2, axis=1)))),
        float(np.degrees(np.arccos(min(1.0, facing)))),
    )
