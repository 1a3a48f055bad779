"""KITTI's inertial and satellite navigation (OXTS)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from training.sequences.errors import BrokenFrameError

_FIELDS = 30


@dataclass(frozen=True)
class Oxts:
    """The vehicle's motion at one frame.

    Args:
        roll_rad, pitch_rad, yaw_rad: as recorded: left side up, front down, counter-clockwise from east.
        forward_m_s, left_m_s, up_m_s: velocity along the vehicle over the earth's surface.
    """

    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    forward_m_s: float
    left_m_s: float
    up_m_s: float


def read_oxts(path: Path) -> Oxts:
    """One frame's file of 30 numbers (`dataformat.txt` of the raw set).

    Raises:
        BrokenFrameError: unreadable, or too few numbers.
    """
    try:
        values = np.array([float(word) for word in path.read_text(encoding="ascii").split()])
    except (OSError, ValueError) as error:
        raise BrokenFrameError(f"cannot read the motion {path}: {error}") from error
    if values.size != _FIELDS or not np.isfinite(values[3:11]).all():
        raise BrokenFrameError(f"{path} has {values.size} numbers: {_FIELDS} are needed")
    roll, pitch, yaw = (float(value) for value in values[3:6])
    forward, left, up = (float(value) for value in values[8:11])
    return Oxts(roll, pitch, yaw, forward, left, up)
