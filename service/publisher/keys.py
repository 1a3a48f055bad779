"""Zenoh keys of a vehicle: `uavdepth/<vehicle>/<topic>`."""

from __future__ import annotations

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


def key(vehicle: str, topic: str) -> str:
    """Key of one topic of one vehicle; `*` as vehicle stands for all."""
    return f"{ROOT}/{vehicle}/{topic}"


def vehicle_of(text: str) -> str | None:
    """Vehicle of a key, or None if it is not one of ours."""
    parts = text.split("/")
    return parts[1] if len(parts) == 3 and parts[0] == ROOT else None
