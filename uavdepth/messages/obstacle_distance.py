"""MAVLink OBSTACLE_DISTANCE (330): the one place where a scan becomes words on the wire."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError
from uavdepth.messages.autopilot_profile import ARDUPILOT, AutopilotProfile
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState

if TYPE_CHECKING:
    from pymavlink.dialects.v20.ardupilotmega import MAVLink_obstacle_distance_message

UNKNOWN_WORD = 65535
"""UINT16_MAX: not measured. PX4 lets the bin expire; ArduPilot takes it as open."""

MAV_DISTANCE_SENSOR_UNKNOWN = 4
"""MAVLink has no value for a camera."""

MAV_FRAME_BODY_FRD = 12
"""PX4 reads 0 and 1 as north-aligned and drops all others but 12; ArduPilot ignores the field."""

LARGEST_MAX_CM = 60_000
"""Keeps max + 1 ("clear") away from 65534, which ArduPilot and PX4 read differently, and from 65535."""


def obstacle_words(scan: ObstacleScan, profile: AutopilotProfile = ARDUPILOT) -> NDArray[np.uint16]:
    """The 72 distances of the message in the profile's layout, in centimetres and special values.

    An obstacle is min + 1 to max - 1, rounded down; nearer ones are raised to min + 1, because at or
    below min ArduPilot drops them and PX4 v1.18's set point becomes NaN (measured). Clear, and an
    obstacle at max or beyond, is max + 1: at exactly max ArduPilot sees an obstacle and PX4 does not.
    Everything else is unknown: a state that is none of the three, an obstacle without a distance or
    with a negative one.

    Returns:
        (72,) uint16.

    Raises:
        ScanError: arrays that are not numbers or not 72 long, or limits outside 1 cm <= min,
            min + 2 cm <= max <= 600 m.
    """
    min_cm, max_cm = limits_cm(scan)
    distance = _seventy_two("distance_m", scan.distance_m)
    state = _seventy_two("state", scan.state)

    with np.errstate(over="ignore"):
        centimetres = np.floor(np.nan_to_num(distance, nan=-1.0, posinf=1e9, neginf=-1.0) * 100.0 + 1e-3)
    located = distance >= 0.0
    obstacle = (state == SectorState.OBSTACLE) & located
    clear = (state == SectorState.CLEAR) | (obstacle & (centimetres >= max_cm))

    words = np.full(SECTOR_COUNT, UNKNOWN_WORD, dtype=np.uint16)
    words[obstacle] = np.clip(centimetres[obstacle], min_cm + 1, max_cm - 1).astype(np.uint16)
    words[clear] = max_cm + 1
    return profile.merge(words, max_cm + 1)


def encode_obstacle_distance(
    scan: ObstacleScan, time_usec: int = 0, profile: AutopilotProfile = ARDUPILOT
) -> MAVLink_obstacle_distance_message:
    """OBSTACLE_DISTANCE in body FRD, in the layout that the autopilot reads without loss.

    No float in it can be NaN or infinite.

    Args:
        scan: what stands round the vehicle.
        time_usec: capture time on the autopilot's clock in microseconds, 0 where it is not known.
        profile: the autopilot's layout; the default, 72 elements of 5 degrees from -155, is safe on
            ArduPilot and on PX4 from 1.18 on.

    Raises:
        ScanError: see `obstacle_words`; a time that is negative or does not fit 64 bits.
    """
    # 100 ms and more of import: paid by those who send, not by those who only look.
    from pymavlink.dialects.v20.ardupilotmega import MAVLink_obstacle_distance_message

    if not 0 <= time_usec < 2**64:
        raise ScanError(f"time_usec is {time_usec}: 0 to 2^64 - 1 microseconds is needed")
    min_cm, max_cm = limits_cm(scan)
    return MAVLink_obstacle_distance_message(
        time_usec=int(time_usec),
        sensor_type=MAV_DISTANCE_SENSOR_UNKNOWN,
        distances=[int(word) for word in obstacle_words(scan, profile)],
        increment=int(profile.increment_deg),
        min_distance=min_cm,
        max_distance=max_cm,
        increment_f=profile.increment_deg,
        angle_offset=profile.first_bearing_deg,
        frame=MAV_FRAME_BODY_FRD,
    )


def limits_cm(scan: ObstacleScan) -> tuple[int, int]:
    """min_distance and max_distance of the message.

    Raises:
        ScanError: see `obstacle_words`.
    """
    limits = []
    for name in ("min_distance_m", "max_distance_m"):
        metres = float(getattr(scan, name))
        if not math.isfinite(metres):
            raise ScanError(f"{name} is {metres}: a finite distance is needed")
        limits.append(round(metres * 100))
    min_cm, max_cm = limits
    if min_cm < 1:
        raise ScanError(f"min_distance_m is {scan.min_distance_m}: at least 0.01 m is needed")
    if not min_cm + 2 <= max_cm <= LARGEST_MAX_CM:
        raise ScanError(
            f"max_distance_m is {scan.max_distance_m}: at least 0.02 m above min_distance_m "
            f"({scan.min_distance_m}) and at most {LARGEST_MAX_CM / 100:.0f} m is needed"
        )
    return min_cm, max_cm


def _seventy_two(name: str, values: Any) -> NDArray[np.float64]:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ScanError(f"{name} is not an array of numbers: {error}") from error
    if array.shape != (SECTOR_COUNT,):
        raise ScanError(f"{name} has the shape {array.shape}: ({SECTOR_COUNT},) is needed")
    return array
