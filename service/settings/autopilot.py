"""`[autopilot]`: the MAVLink link, what is asked of it and how old its words may be."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from service.autopilot.byte_budget import LEAST_BYTES_PER_S
from service.autopilot.endpoint import parse_endpoint
from service.errors import LinkError
from service.settings.section import Section


class AutopilotSettings(Section):
    """The MAVLink link, what is asked of it and how old its words may be."""

    endpoint: str = Field(
        default="udp:0.0.0.0:14550",
        title="Endpoint",
        description='`"udp:HOST:PORT"` listens, `"udpout:HOST:PORT"` sends there, `"tcp:HOST:PORT"` '
        'connects, `"serial:DEVICE:BAUD"` opens a port (`"serial:/dev/ttyAMA0:921600"`); always MAVLink 2.',
    )
    system_id: int = Field(
        default=0,
        ge=0,
        le=255,
        title="System id",
        description="Vehicle to listen to; 0 learns it from the first autopilot's HEARTBEAT.",
    )
    profile: Literal["auto", "ardupilot", "px4", "px4-legacy"] = Field(
        default="auto",
        title="Layout of OBSTACLE_DISTANCE",
        description="`ardupilot` and `px4` (from 1.18): 72 elements of 5 degrees from -155; `px4-legacy` "
        "(1.17 and older): 36 of 10 degrees from -180. `auto` takes it from the autopilot's HEARTBEAT and "
        "version; a PX4 that has not told its version gets `px4-legacy`, which every version reads.",
    )
    signing_key_file: str = Field(
        default="",
        title="MAVLink 2 signing key",
        description="File of exactly 32 bytes, or of one line `passphrase: WORDS` (its SHA-256 is the key), "
        "readable by this user only. With it every packet is signed, and unsigned or wrongly signed ones are "
        "not believed. Empty: no signing.",
    )
    obstacle_rate_hz: float = Field(
        default=15.0,
        ge=10.0,
        le=30.0,
        title="OBSTACLE_DISTANCE rate, hertz",
        description="At most this many messages a second, each made from a new frame. ArduPilot needs one "
        "every 0.5 s, and stops later the slower they come.",
    )
    obstacle_points: bool = Field(
        default=False,
        title="OBSTACLE_DISTANCE_3D",
        description="Sends ArduPilot's BendyRuler points, tilted as the vehicle is, instead of "
        "OBSTACLE_DISTANCE, which wipes them. Needs a network, or a line of 26000 bytes/s; other autopilots "
        "get OBSTACLE_DISTANCE in any case. Open and unknown are the same in it.",
    )
    bytes_per_s: int = Field(
        default=0,
        ge=0,
        le=2_000_000,
        title="Byte budget, bytes a second",
        description="What may leave for the autopilot. HEARTBEAT and OBSTACLE_DISTANCE go first, other "
        "messages wait and are dropped, and OBSTACLE_DISTANCE is sent at a lower rate rather than late. At "
        "least 2100, which carries 10 a second; 0 takes 80 % of a serial port's rate, and sets no limit on a "
        "network.",
    )
    on_loss: Literal["warn", "hold"] = Field(
        default="warn",
        title="When perception is lost",
        description="`warn`: STATUSTEXT and HEARTBEAT CRITICAL within 0.5 s. `hold`: besides, 0.7 s after "
        "the last distances, the autopilot is asked once for BRAKE (ArduCopter), HOLD (ArduRover) or Hold "
        "(PX4), if the vehicle is armed and flies in a mode that distances act in, as soon as it moves; "
        "where one of several cameras is lost, as soon as it moves into what that one saw. Nothing is asked "
        "of a pilot who has changed the mode since.",
    )
    max_frame_age_s: float = Field(
        default=0.3,
        ge=0.05,
        le=0.4,
        title="Oldest frame, seconds",
        description="A scan whose picture is older than this is never sent.",
    )
    attitude_rate_hz: float = Field(
        default=50.0,
        ge=10.0,
        le=200.0,
        title="ATTITUDE rate, hertz",
        description="Asked with SET_MESSAGE_INTERVAL, checked by what arrives, asked again.",
    )
    position_rate_hz: float = Field(
        default=30.0,
        ge=5.0,
        le=100.0,
        title="LOCAL_POSITION_NED rate, hertz",
        description="Asked like ATTITUDE.",
    )
    rangefinder_rate_hz: float = Field(
        default=20.0,
        ge=5.0,
        le=50.0,
        title="DISTANCE_SENSOR rate, hertz",
        description="Asked like ATTITUDE; only the downward one (orientation 25) gives the height.",
    )
    timesync_rate_hz: float = Field(
        default=1.0,
        ge=0.2,
        le=5.0,
        title="TIMESYNC rate, hertz",
        description="Round trips that bind the autopilot's clock to this computer's.",
    )
    heartbeat_timeout_s: float = Field(
        default=3.0,
        ge=1.5,
        le=10.0,
        title="Link loss, seconds",
        description="The link counts as lost when the autopilot has been silent for this long.",
    )
    attitude_gap_s: float = Field(
        default=0.2,
        ge=0.05,
        le=0.5,
        title="Widest gap, seconds",
        description="Attitude and position are not interpolated between messages further apart than this.",
    )
    extrapolation_s: float = Field(
        default=0.05,
        ge=0.0,
        le=0.1,
        title="Extrapolation, seconds",
        description="How far beyond the newest message attitude and position are carried by their rates.",
    )
    height_timeout_s: float = Field(
        default=0.5,
        ge=0.1,
        le=2.0,
        title="Oldest height, seconds",
        description="A rangefinder reading further than this from the frame's capture is not used.",
    )

    @field_validator("bytes_per_s")
    @classmethod
    def _carries_enough(cls, value: int) -> int:
        if 0 < value < LEAST_BYTES_PER_S:
            raise ValueError(f"{value} is neither 0 nor at least {LEAST_BYTES_PER_S}")
        return value

    @field_validator("endpoint")
    @classmethod
    def _endpoint_is_known(cls, value: str) -> str:
        try:
            parse_endpoint(value)
        except LinkError as error:
            raise ValueError(str(error)) from error
        return value
