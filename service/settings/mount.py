"""`[mount]`: where the camera sits on the vehicle and which way it looks."""

from __future__ import annotations

from pydantic import Field

from service.settings.section import Section
from uavdepth.camera import CameraMount


class MountSettings(Section):
    """Where the camera sits on the vehicle and which way it looks."""

    roll_deg: float = Field(
        default=0.0,
        ge=-180.0,
        le=180.0,
        title="Roll, degrees",
        description="Turn of the camera about its line of sight, clockwise seen from behind.",
    )
    pitch_deg: float = Field(
        default=0.0, ge=-90.0, le=90.0, title="Pitch, degrees", description="Below 0 the camera looks down."
    )
    yaw_deg: float = Field(
        default=0.0,
        ge=-180.0,
        le=180.0,
        title="Yaw, degrees",
        description="Above 0 the camera looks to the right of the nose.",
    )
    forward_m: float = Field(
        default=0.0,
        ge=-5.0,
        le=5.0,
        title="Forward, metres",
        description="Position of the camera before the vehicle's centre.",
    )
    right_m: float = Field(
        default=0.0,
        ge=-5.0,
        le=5.0,
        title="Right, metres",
        description="Position of the camera right of the vehicle's centre.",
    )
    down_m: float = Field(
        default=0.0,
        ge=-5.0,
        le=5.0,
        title="Down, metres",
        description="Position of the camera below the vehicle's centre.",
    )
    check_every_s: float = Field(
        default=10.0,
        ge=0.0,
        le=600.0,
        title="Time between two looks at the mount, seconds",
        description="In flight, one picture in so long is measured without any hint and its ground held "
        "against the mount; pitch or roll more than 2 degrees off are told once, as STATUSTEXT and in "
        "the log. It takes 20 pictures of level ground with the vehicle turning. 0: never.",
    )

    @property
    def mount(self) -> CameraMount:
        """The mount as the library knows it."""
        return CameraMount(
            self.roll_deg, self.pitch_deg, self.yaw_deg, self.forward_m, self.right_m, self.down_m
        )
