"""`[vehicle]`: which vehicle this is."""

from __future__ import annotations

from pydantic import Field

from service.publisher.keys import MAX_VEHICLE_NAME, VEHICLE_NAME_PATTERN
from service.settings.section import Section


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
