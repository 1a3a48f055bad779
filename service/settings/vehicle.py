"""`[vehicle]`: which vehicle this is."""

from __future__ import annotations

from pydantic import Field

from service.settings.section import Section

VEHICLE_NAME_PATTERN = r"^[A-Za-z0-9_-]+$"
"""Letters that are legal in a Zenoh key without being a wildcard, a separator or a verbatim chunk."""

MAX_VEHICLE_NAME = 64


class VehicleSettings(Section):
    """Which vehicle this is."""

    name: str = Field(
        default="uav1",
        min_length=1,
        max_length=MAX_VEHICLE_NAME,
        pattern=VEHICLE_NAME_PATTERN,
        title="Vehicle name",
        description="Second part of every Zenoh key, `uavdepth/<name>/...`: letters, digits, `_` and `-`. "
        "Give each vehicle of a fleet its own.",
    )
