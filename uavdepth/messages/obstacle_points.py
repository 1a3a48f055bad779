"""MAVLink OBSTACLE_DISTANCE_3D (11037): a scan's obstacles as points in the tilted body frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.errors import ScanError
from uavdepth.messages.obstacle_distance import (
    MAV_DISTANCE_SENSOR_UNKNOWN,
    MAV_FRAME_BODY_FRD,
    limits_cm,
    obstacle_words,
)
from uavdepth.scan.obstacle_scan import ObstacleScan

if TYPE_CHECKING:
    from pymavlink.dialects.v20.ardupilotmega import MAVLink_obstacle_distance_3d_message

OBSTACLE_ID_UNKNOWN = 65535
_BEYOND_M = 1.0


def obstacle_points(scan: ObstacleScan, attitude: Attitude, most: int) -> NDArray[np.float64]:
    """The scan's obstacles in body FRD, at the height of the vehicle's origin, the nearest first.

    ArduPilot's obstacle database takes OBSTACLE_DISTANCE for distances in the tilted body plane: 30 degrees
    nose-down, an obstacle 10 m ahead is stored 5 m low. These points are tilted back beforehand.

    Args:
        scan: what stands round the vehicle, in the level frame.
        attitude: the vehicle's when the picture was taken.
        most: the farther ones are left out.

    Returns:
        (N, 3) metres, as far as the words of OBSTACLE_DISTANCE tell; nearer than min is told as min + 1 cm.

    Raises:
        ScanError: see `uavdepth.messages.obstacle_distance.obstacle_words`; an attitude that is not finite.
    """
    if not np.isfinite([attitude.roll_rad, attitude.pitch_rad]).all():
        raise ScanError(f"roll {attitude.roll_rad} and pitch {attitude.pitch_rad} must be finite")
    words = obstacle_words(scan)
    _, max_cm = limits_cm(scan)
    order = np.argsort(words, kind="stable")
    nearest = order[words[order] < max_cm][:most]
    range_m = words[nearest] / 100.0
    bearing = np.deg2rad(scan.bearing_deg[nearest].astype(np.float64))
    level = np.column_stack([range_m * np.cos(bearing), range_m * np.sin(bearing), np.zeros(len(nearest))])
    points: NDArray[np.float64] = level @ attitude.level_from_body  # rows: body_from_level is its transpose
    return points


def encode_obstacle_points(
    scan: ObstacleScan, attitude: Attitude, time_boot_ms: int, most: int = 72
) -> list[MAVLink_obstacle_distance_3d_message]:
    """OBSTACLE_DISTANCE_3D for one scan: one time stamp, which makes ArduPilot take them as one picture.

    The message has no word for clear: what is not told is open. Without an obstacle one point beyond
    max_distance is sent, which ArduPilot leaves out, so that the new picture begins and the old one ends.

    Args:
        scan: what stands round the vehicle.
        attitude: the vehicle's when the picture was taken.
        time_boot_ms: another one for each scan; taken modulo 2^32.
        most: points at most; the nearest are told.

    Raises:
        ScanError: see `obstacle_points`.
    """
    from pymavlink.dialects.v20.ardupilotmega import MAVLink_obstacle_distance_3d_message

    points = obstacle_points(scan, attitude, most)
    min_cm, max_cm = limits_cm(scan)
    if not len(points):
        points = np.array([[max_cm / 100.0 + _BEYOND_M, 0.0, 0.0]])
    return [
        MAVLink_obstacle_distance_3d_message(
            time_boot_ms=time_boot_ms % 2**32,
            sensor_type=MAV_DISTANCE_SENSOR_UNKNOWN,
            frame=MAV_FRAME_BODY_FRD,
            obstacle_id=OBSTACLE_ID_UNKNOWN,
            x=float(x),
            y=float(y),
            z=float(z),
            min_distance=min_cm / 100.0,
            max_distance=max_cm / 100.0,
        )
        for x, y, z in points
    ]
