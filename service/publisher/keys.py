"""Zenoh keys of a vehicle: `uavdepth/<vehicle>/<topic>`."""

from __future__ import annotations

import re

ROOT = "uavdepth"
DEPTH = "depth"
SCAN = "scan"
STATUS = "status"
CAMERA = "camera"
VIDEO = "video"
RECEIVED = "received"
"""What a ground station says has arrived: the one key that viewers write."""

ALIVE = "alive"
"""Liveliness token: there while the vehicle's session lives."""

VEHICLE_NAME_PATTERN = r"^[A-Za-z0-9_-]+$"
"""Letters that are legal in a Zenoh key without being a wildcard, a separator or a verbatim chunk."""

MAX_VEHICLE_NAME = 64

_NAME = re.compile(VEHICLE_NAME_PATTERN)


def key(vehicle: str, topic: str) -> str:
    """Key of one topic of one vehicle; `*` as vehicle stands for all."""
    return f"{ROOT}/{vehicle}/{topic}"


def vehicle_of(text: str) -> str | None:
    """Vehicle of a key, or None if it is not one of ours or names none that a configuration could."""
    parts = text.split("/")
    if len(parts) != 3 or parts[0] != ROOT:
        return None
    name = parts[1]
    return name if len(name) <= MAX_VEHICLE_NAME and _NAME.fullmatch(name) else None
