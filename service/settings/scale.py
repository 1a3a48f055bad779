"""`[scale]`: where metres come from, and when they are no longer trusted."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.settings.section import Section


class ScaleSettings(Section):
    """Where metres come from, and when they are no longer trusted."""

    height_source: Literal["rangefinder", "ekf", "both"] = Field(
        default="both",
        title="Where the height above ground comes from",
        description="`rangefinder`: the downward one (orientation 25) alone. `ekf`: the autopilot's height "
        "above where it started. `both`: the rangefinder, and the EKF where it gives nothing. The EKF knows "
        "nothing of hills and roofs: its height counts as 0.5 m and a twentieth of the way flown since "
        "take-off, or since the last reading of the rangefinder, uncertain, and is given up at "
        "`max_relative_sigma`.",
    )
    max_relative_sigma: float = Field(
        default=0.25,
        gt=0.0,
        le=1.0,
        title="Largest uncertainty of the scale",
        description="Relative standard deviation of the metric scale above which no distances are sent. "
        "Nothing sent is a free path to ArduPilot 1 to 1.75 s later, and a stop to PX4.",
    )
    max_age_s: float = Field(
        default=2.0,
        ge=0.0,
        le=60.0,
        title="Oldest scale, seconds",
        description="Time without ground, height or measured points in view after which no distances are "
        "sent. A vehicle with a network that takes no hints, stopped before a wall that hides the ground, "
        "has none of them: after this time ArduPilot takes the silence for a free path, so keep the pilot's "
        "hands on the sticks, or fly a network that is told the height; longer means older metres.",
    )
