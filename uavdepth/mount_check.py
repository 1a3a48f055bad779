"""Whether the camera sits on the vehicle as configured: its tilt against level ground in flight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import BODY_FROM_CAMERA_AXES, CameraMount
from uavdepth.scale.ground_plane import GroundPlane

DIFFERENCE_DEG = 2.0
"""Mounts that differ by more are reported: at 10 m, 2 degrees are 0.35 m of height."""

_FEWEST_PLANES = 20
_LARGEST_SLOPE_DEG = 1.5
_LARGEST_SCATTER_DEG = 2.5
_LARGEST_SIGMA_DEG = 0.7
_LARGEST_RESULTANT = 0.8
"""Length of the mean of the headings' unit vectors: 1 if all are one, 0 over a full turn. Two headings 75
degrees apart have 0.8. With less turning, a slope and a tilted camera look alike."""

_ROUNDS = 5
_TUKEY = 4.685
"""Of the scatter: 95 % efficiency on normal errors (Holland and Welsch 1977)."""

_LEAST_SCATTER_RAD = 1e-5


class MountState(Enum):
    """What is known of the mount."""

    AGREES = "agrees"
    DIFFERS = "differs"
    NOT_LEVEL = "not level ground"
    TURN_NEEDED = "turn needed"
    UNCERTAIN = "uncertain"
    TOO_FEW = "too few"


@dataclass(frozen=True)
class MountVerdict:
    """The mount by the ground.

    Args:
        state: the verdict; the angles count with AGREES and DIFFERS only.
        text: the same in words, fit to show a pilot.
        pitch_deg, roll_deg: of the mount, as in `CameraMount`; NaN where they were not estimated.
        pitch_sigma_deg, roll_sigma_deg: one standard deviation, from the scatter between pictures.
        slope_deg: of the ground.
        planes: pictures that were used.
    """

    state: MountState
    text: str
    pitch_deg: float = math.nan
    roll_deg: float = math.nan
    pitch_sigma_deg: float = math.nan
    roll_sigma_deg: float = math.nan
    slope_deg: float = math.nan
    planes: int = 0


@dataclass(frozen=True)
class _Fit:
    """Least squares over all pictures.

    Args:
        tilt_rad: (2,) rotation about body x and y that takes the true mount to the assumed one.
        slope: (2,) of the ground, north and east.
        covariance: (4, 4) of both.
        scatter_rad: robust standard deviation of one picture's normal.
    """

    tilt_rad: NDArray[np.float64]
    slope: NDArray[np.float64]
    covariance: NDArray[np.float64]
    scatter_rad: float


def check_mount(planes: Sequence[GroundPlane], mount: CameraMount) -> MountVerdict:
    """Pitch and roll of the mount from the ground in many pictures, against the configured ones.

    The ground's normal, seen by the camera and turned by attitude and mount, is the world's down. What is
    left over is either fixed to the vehicle, a tilted camera, or fixed to the world, a slope. Only headings
    that differ tell them apart, so a full turn on the spot is the best flight for it, and without turning
    there is no verdict. Slopes and uneven ground give none either: where the ground is not level, nothing
    says that it is even. A yaw of the mount is not seen.

    Args:
        planes: in the order of time (`find_ground_plane`), made without ground hints.
        mount: as configured.
    """
    if len(planes) < _FEWEST_PLANES:
        return MountVerdict(
            MountState.TOO_FEW,
            f"mount: {len(planes)} pictures show the ground, {_FEWEST_PLANES} are needed: no verdict",
            planes=len(planes),
        )
    headings = np.array([plane.attitude.yaw_rad for plane in planes])
    resultant = float(np.abs(np.mean(np.exp(1j * headings))))
    if resultant > _LARGEST_RESULTANT:
        return MountVerdict(
            MountState.TURN_NEEDED,
            "mount: with so little turning a slope and a tilted camera look alike, perhaps not level ground, "
            "no verdict: turn once around above level ground",
            planes=len(planes),
        )
    found, fit = _estimate(planes, mount)
    slope_deg = math.degrees(math.atan(float(np.hypot(*fit.slope))))
    roll_sigma, pitch_sigma = _angle_sigmas_deg(fit, mount)
    scatter_deg = math.degrees(fit.scatter_rad)
    values = (found.pitch_deg, found.roll_deg, pitch_sigma, roll_sigma, slope_deg, len(planes))
    if slope_deg > _LARGEST_SLOPE_DEG or scatter_deg > _LARGEST_SCATTER_DEG:
        text = (
            f"mount: not level ground, no verdict (slope {slope_deg:.1f} degrees, "
            f"pictures differ by {scatter_deg:.1f} degrees)"
        )
        return MountVerdict(MountState.NOT_LEVEL, text, *values)
    angles = (
        f"pitch {found.pitch_deg:.1f} +- {pitch_sigma:.1f}, "
        f"roll {found.roll_deg:.1f} +- {roll_sigma:.1f} degrees"
    )
    if max(pitch_sigma, roll_sigma) > _LARGEST_SIGMA_DEG:
        return MountVerdict(MountState.UNCERTAIN, f"mount: too uncertain, no verdict ({angles})", *values)
    wrong = [
        f"{name} is {seen:.1f} degrees by the ground, configured {name}_deg is {configured:g}"
        for name, seen, configured in (
            ("pitch", found.pitch_deg, mount.pitch_deg),
            ("roll", found.roll_deg, mount.roll_deg),
        )
        if abs(_turned_deg(seen - configured)) > DIFFERENCE_DEG
    ]
    if wrong:
        return MountVerdict(MountState.DIFFERS, f"mount: {'; '.join(wrong)} ({angles})", *values)
    return MountVerdict(MountState.AGREES, f"mount: as configured ({angles})", *values)


def _estimate(planes: Sequence[GroundPlane], mount: CameraMount) -> tuple[CameraMount, _Fit]:
    """The mount, and the fit about it, by Gauss-Newton steps that start at `mount`."""
    normals = np.array([plane.normal_camera for plane in planes])
    levels = np.array([plane.attitude.level_from_body for plane in planes])
    headings = np.array([plane.attitude.yaw_rad for plane in planes])
    body_from_camera = mount.body_from_camera
    fit = _fit(normals, levels, headings, body_from_camera)
    for _ in range(_ROUNDS):
        turn = _small_rotation(np.array([fit.tilt_rad[0], fit.tilt_rad[1], 0.0]))
        body_from_camera = turn.T @ body_from_camera
        fit = _fit(normals, levels, headings, body_from_camera)
    turned = body_from_camera @ BODY_FROM_CAMERA_AXES.T
    return _mount_of(turned, mount), fit


def _fit(
    normals: NDArray[np.float64],
    levels: NDArray[np.float64],
    headings: NDArray[np.float64],
    body_from_camera: NDArray[np.float64],
) -> _Fit:
    """One linear, robust step: leftover = tilt fixed to the body + slope fixed to the world."""
    count = len(normals)
    leftover = np.einsum("nij,nj->ni", levels, normals @ body_from_camera.T)[:, :2]
    design = np.zeros((count, 2, 4))
    # A small rotation e moves down (0, 0, 1) by e x down = (e_y, -e_x); e is in body axes, so levelled first.
    design[:, 0, :2] = levels[:, 1, :2]
    design[:, 1, :2] = -levels[:, 0, :2]
    cos, sin = np.cos(headings), np.sin(headings)
    # North and east seen along the nose: turned back by the heading.
    design[:, 0, 2], design[:, 0, 3] = cos, sin
    design[:, 1, 2], design[:, 1, 3] = -sin, cos
    weights = np.ones(count)
    solution, scatter = np.zeros(4), 0.0
    for _ in range(10):
        root = np.sqrt(weights)[:, None]
        solution = np.linalg.lstsq(
            (design * root[..., None]).reshape(-1, 4), (leftover * root).reshape(-1), rcond=None
        )[0]
        rest = leftover - design @ solution
        # 1.1774: median length of a two-dimensional normal error of unit standard deviation in each.
        length = np.linalg.norm(rest, axis=1)
        scatter = max(float(np.median(length)) / 1.1774, _LEAST_SCATTER_RAD)
        weights = np.maximum(0.0, 1 - (length / (_TUKEY * scatter)) ** 2) ** 2
    normal_matrix = np.einsum("n,nij,nik->jk", weights, design, design)
    covariance = np.linalg.pinv(normal_matrix) * scatter**2 * _correlation_length(rest)
    return _Fit(solution[:2], solution[2:], covariance, scatter)


def _correlation_length(rest: NDArray[np.float64]) -> float:
    """How many pictures in a row count as one: their errors are those of one network at one place (AR(1))."""
    centred = rest - np.median(rest, axis=0)
    power = float(np.sum(centred**2))
    if power == 0.0:
        return 1.0
    correlation = float(np.clip(np.sum(centred[1:] * centred[:-1]) / power, 0.0, 0.98))
    return (1 + correlation) / (1 - correlation)


def _small_rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) rotation about a vector by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def _mount_of(rotation: NDArray[np.float64], mount: CameraMount) -> CameraMount:
    """The mount with the angles of a rotation, at the place of another."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    roll = math.atan2(float(rotation[2, 1]), float(rotation[2, 2]))
    yaw = math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
    return CameraMount(
        math.degrees(roll),
        math.degrees(pitch),
        math.degrees(yaw),
        mount.forward_m,
        mount.right_m,
        mount.down_m,
    )


def _angle_sigmas_deg(fit: _Fit, mount: CameraMount) -> tuple[float, float]:
    """Standard deviations of the mount's roll and pitch: the tilt's, seen along the camera's own axes."""
    yaw, pitch = math.radians(mount.yaw_deg), math.radians(mount.pitch_deg)
    cos, sin = math.cos(yaw), math.sin(yaw)
    along = np.array([cos, sin]) / max(math.cos(pitch), 0.1)
    across = np.array([-sin, cos])
    of_tilt = fit.covariance[:2, :2]
    roll, pitch_sigma = (math.degrees(math.sqrt(float(axis @ of_tilt @ axis))) for axis in (along, across))
    return roll, pitch_sigma


def _turned_deg(angle_deg: float) -> float:
    """The same angle between -180 and 180 degrees."""
    return (angle_deg + 180.0) % 360.0 - 180.0
