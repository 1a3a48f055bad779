"""What is wrong with a calibration, in words, and what to do about it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from uavdepth.calibration.coverage import Coverage
from uavdepth.calibration.detection import Refusal
from uavdepth.calibration.solve import Calibration, Distortion
from uavdepth.camera import CameraModel

_GOOD_PICTURES = 10
_GOOD_PICTURES_RATIONAL = 20
_TILTED_DEG = 15.0
_GOOD_TILTED_SHARE = 0.25
_FRONTAL_DEG = 8.0
"""If no picture is tilted by more, focal length and distance cannot be told apart (Zhang 2000, 3.4)."""

_GOOD_FOCAL_SIGMA = 0.005
_WORST_FOCAL_SIGMA = 0.03
_GOOD_ERROR_PX = 0.5
_WORST_ERROR_PX = 2.0
_GOOD_SHARE = 0.6
_FOV_DEG = (10.0, 150.0)
_ASPECT = 0.03
_OFF_CENTRE = 0.12
_ROUND_TRIP_PX = 0.5


@dataclass(frozen=True)
class Advice:
    """One remark.

    Args:
        text: what is wrong and what helps.
        serious: the camera should not fly with this calibration.
    """

    text: str
    serious: bool = False


def advise(
    calibration: Calibration, coverage: Coverage, refused: Sequence[Refusal] = ()
) -> tuple[Advice, ...]:
    """What to better, serious remarks first; empty for a good calibration.

    Args:
        calibration: what was solved.
        coverage: of the same.
        refused: pictures in which no usable board was found.
    """
    remarks = [
        *_about_focal_length(calibration),
        *_about_pictures(calibration, refused),
        *_about_coverage(coverage),
        *_about_error(calibration),
        *_about_camera(calibration.camera),
    ]
    return tuple(sorted(remarks, key=lambda remark: not remark.serious))


def horizontal_fov_deg(camera: CameraModel) -> float:
    """Angle between the picture's left and right edge without distortion, degrees."""
    left, right = (camera.cx + 0.5) / camera.fx, (camera.width - 0.5 - camera.cx) / camera.fx
    return math.degrees(math.atan(left) + math.atan(right))


def _about_focal_length(calibration: Calibration) -> list[Advice]:
    tilts = [solved.tilt_deg for solved in calibration.views]
    how = (
        f"tilt the board by 20 to 45 degrees, to all four sides, in at least {_GOOD_TILTED_SHARE:.0%} of them"
    )
    if max(tilts) < _FRONTAL_DEG:
        return [
            Advice(
                f"all pictures face the board squarely: the focal length cannot be told; {how}", serious=True
            )
        ]
    sigma = max(calibration.sigma[0] / calibration.camera.fx, calibration.sigma[1] / calibration.camera.fy)
    if sigma > _GOOD_FOCAL_SIGMA:
        return [
            Advice(
                f"the focal length is known to {sigma:.1%} only (one standard deviation): "
                f"take more pictures, {how}",
                serious=sigma > _WORST_FOCAL_SIGMA,
            )
        ]
    tilted = sum(tilt >= _TILTED_DEG for tilt in tilts)
    if tilted < _GOOD_TILTED_SHARE * len(tilts):
        return [
            Advice(
                f"{tilted} of {len(tilts)} pictures are tilted by more than {_TILTED_DEG:g} degrees; {how}"
            )
        ]
    return []


def _about_pictures(calibration: Calibration, refused: Sequence[Refusal]) -> list[Advice]:
    count, remarks = len(calibration.views), []
    if count < _GOOD_PICTURES:
        remarks.append(Advice(f"only {count} pictures were used: take 20 or more"))
    elif calibration.distortion is Distortion.RATIONAL8 and count < _GOOD_PICTURES_RATIONAL:
        remarks.append(
            Advice(f"{count} pictures are few for rational8: take {_GOOD_PICTURES_RATIONAL}, or use brown5")
        )
    blurred = sum("blurred:" in refusal.reason for refusal in refused)
    if blurred:
        remarks.append(
            Advice(
                f"{blurred} pictures were refused because they are blurred: more light, hold still, "
                "check the focus"
            )
        )
    if calibration.left_out:
        remarks.append(
            Advice(
                f"{len(calibration.left_out)} pictures contradict the others and were left out: "
                "is the board flat and was it still?"
            )
        )
    return remarks


def _about_coverage(coverage: Coverage) -> list[Advice]:
    remarks = []
    if coverage.empty_corners:
        remarks.append(
            Advice(
                f"no corners of the board were seen {', '.join(coverage.empty_corners)} in the picture: "
                "there the lens is guessed; bring the board there"
            )
        )
    if coverage.share < _GOOD_SHARE:
        remarks.append(
            Advice(f"corners cover {coverage.share:.0%} of the picture: {_GOOD_SHARE:.0%} and more are good")
        )
    return remarks


def _about_error(calibration: Calibration) -> list[Advice]:
    if calibration.rms_px <= _GOOD_ERROR_PX:
        return []
    cause = "is the board flat, still and sharp?"
    if calibration.distortion is Distortion.NONE:
        cause = "a lens without distortion does not explain them: use --distortion brown5"
    elif calibration.distortion is Distortion.BROWN5:
        cause += " A very wide lens needs --distortion rational8"
    return [
        Advice(
            f"corners miss by {calibration.rms_px:.2f} pixels, at most {_GOOD_ERROR_PX:g} is good: {cause}",
            serious=calibration.rms_px > _WORST_ERROR_PX,
        )
    ]


def _about_camera(camera: CameraModel) -> list[Advice]:
    remarks = []
    fov_deg = horizontal_fov_deg(camera)
    low, high = _FOV_DEG
    if not low <= fov_deg <= high:
        remarks.append(
            Advice(
                f"a field of view of {fov_deg:.0f} degrees is implausible, {low:g} to {high:g} is not: "
                "is the board's size right, are there tilted pictures?",
                serious=True,
            )
        )
    if abs(camera.fx / camera.fy - 1) > _ASPECT:
        remarks.append(
            Advice(
                f"fx and fy differ by {abs(camera.fx / camera.fy - 1):.1%}: pixels are square, "
                "was the picture stretched or the board printed so?"
            )
        )
    off_x = abs(camera.cx - (camera.width - 1) / 2) / camera.width
    off_y = abs(camera.cy - (camera.height - 1) / 2) / camera.height
    if max(off_x, off_y) > _OFF_CENTRE:
        remarks.append(
            Advice(
                f"the principal point lies {max(off_x, off_y):.0%} of the picture off its middle: "
                "was the picture cut, or are pictures at the edges missing?"
            )
        )
    missed_px = _round_trip_px(camera)
    if not missed_px <= _ROUND_TRIP_PX:
        remarks.append(
            Advice(
                "the distortion cannot be undone at the picture's edge: bring the board to the edges "
                "and corners, or use a model with fewer coefficients",
                serious=True,
            )
        )
    return remarks


def _round_trip_px(camera: CameraModel) -> float:
    """Largest distance in pixels by which points of the picture's edge miss themselves, there and back."""
    if not any(camera.distortion):
        return 0.0
    x = np.linspace(0, camera.width - 1, 17)
    y = np.linspace(0, camera.height - 1, 17)
    edge = np.concatenate(
        [
            np.stack(np.meshgrid(x, (0.0, camera.height - 1.0)), axis=-1).reshape(-1, 2),
            np.stack(np.meshgrid((0.0, camera.width - 1.0), y), axis=-1).reshape(-1, 2),
        ]
    )
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-9)
    lens = np.array(camera.distortion)
    flat = cv2.undistortPoints(
        edge[:, None], camera.matrix, lens, R=np.eye(3), P=np.eye(3), criteria=criteria
    ).reshape(-1, 2)
    rays = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    back, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.matrix, lens)
    return float(np.max(np.linalg.norm(back.reshape(-1, 2) - edge, axis=1)))
