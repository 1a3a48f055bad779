"""`[scan]`: which obstacles count."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from service.settings.section import Section


class ScanSettings(Section):
    """Which obstacles count."""

    min_distance_m: float = Field(
        default=0.2,
        ge=0.05,
        le=5.0,
        title="Nearest distance, metres",
        description="Sent as OBSTACLE_DISTANCE.min_distance; nearer obstacles are reported just above it. "
        "Keep it small: PX4 treats it as a keep-out radius.",
    )
    max_distance_m: float = Field(
        default=20.0,
        ge=2.0,
        le=100.0,
        title="Farthest distance, metres",
        description="Sent as OBSTACLE_DISTANCE.max_distance; farther obstacles count as clear. "
        "Constant while the service runs: PX4 remembers the largest it ever saw.",
    )
    below_m: float = Field(
        default=2.0,
        ge=0.1,
        le=50.0,
        title="Height band below, metres",
        description="Obstacles count down to so far below the vehicle's flight level.",
    )
    above_m: float = Field(
        default=1.5,
        ge=0.1,
        le=50.0,
        title="Height band above, metres",
        description="Obstacles count up to so far above the vehicle's flight level.",
    )
    sigma_factor: float = Field(
        default=0.25,
        ge=0.0,
        le=5.0,
        title="Caution about distances, standard deviations",
        description="Distances are told as d * (1 - sigma_factor * sigma), sigma being the network's own "
        "relative uncertainty, a quarter nearer at most, and a direction is clear only if it would be at "
        "d * (1 - sigma) too. 0 shortens nothing and frees by d alone.",
    )
    max_ground_slope_deg: float = Field(
        default=15.0,
        ge=0.0,
        le=25.0,
        title="Steepest ground, degrees",
        description="Ground that rises no steeper is no obstacle while it stays below the flight level. "
        "0 takes all ground for level.",
    )
    memory_s: float = Field(
        default=0.5,
        ge=0.0,
        le=0.5,
        title="Memory for obstacles, seconds",
        description="How long an obstacle that has left the picture stays in the scan, carried along with "
        "the vehicle's motion. It needs LOCAL_POSITION_NED. 0 switches it off.",
    )

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        if self.max_distance_m <= self.min_distance_m + 1.0:
            raise ValueError(
                f"max_distance_m: {self.max_distance_m:g} must be at least 1 m above "
                f"min_distance_m {self.min_distance_m:g}"
            )
        return self
