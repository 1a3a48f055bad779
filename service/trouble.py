"""Why no distances are sent, in words that a pilot understands."""

from __future__ import annotations

from enum import Enum


class Trouble(Enum):
    """Why depth cannot be trusted. The values are read by pilots, as STATUSTEXT of 50 characters at most."""

    STARTING = "starting"
    ON_GROUND = "on the ground"
    """Disarmed, with a rangefinder: too low for a scale, and nothing is wrong."""
    CAMERA_LOST = "no pictures from the camera"
    STALE_FRAME = "pictures are too old"
    STALLED = "depth computation stalled"
    MODEL_FAILED = "depth network failed"
    LINK_LOST = "autopilot not heard"
    NO_ATTITUDE = "no attitude at picture time"
    NO_POSITION = "position is not known or was reset"
    """A further camera's sight cannot be carried to the main picture's place."""
    NO_HEIGHT = "no height above ground"
    NO_GROUND = "no ground seen to scale depth"
    NO_POINTS = "no points measured by motion"
    BAD_SCALE = "metric scale is uncertain"
    OLD_SCALE = "metric scale is too old"
    NOT_SENT = "autopilot link takes no distances"
    NO_DEPTH = "depth is unknown everywhere"

    @property
    def is_fault(self) -> bool:
        """Whether a part of the service has failed, as against a vehicle that is where depth has no scale."""
        return self in _FAULTS

    @property
    def is_lack_of_scale(self) -> bool:
        """Whether metres are missing, as they may where a vehicle stands on the ground."""
        return self in _LACKS_OF_SCALE


_LACKS_OF_SCALE = frozenset(
    {Trouble.NO_HEIGHT, Trouble.NO_GROUND, Trouble.NO_POINTS, Trouble.BAD_SCALE, Trouble.OLD_SCALE}
)

_FAULTS = frozenset(
    {
        Trouble.CAMERA_LOST,
        Trouble.STALE_FRAME,
        Trouble.STALLED,
        Trouble.MODEL_FAILED,
        Trouble.LINK_LOST,
        Trouble.NOT_SENT,
    }
)
