"""Whether the camera sits as configured, checked now and then in flight by the ground in its pictures."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import structlog

from service.frame import Frame
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.depth.depth_map import DepthMap
from uavdepth.mount_check import MountState, MountVerdict, check_mount
from uavdepth.scale.ground_plane import GroundPlane, find_ground_plane

log = structlog.get_logger()

_MOST_PLANES = 120
_FEWEST_PLANES = 20


class MountWatch:
    """Gathers the ground's plane from single pictures and says once when it contradicts the mount.

    Args:
        settings: the configuration; `[mount] check_every_s` is the time between two pictures looked at.
        infer: depth of a picture up to one factor, by a network that was not told where the ground is.
    """

    def __init__(self, settings: Settings, infer: Callable[[Frame], DepthMap]) -> None:
        self._camera, self._mount = settings.camera.model, settings.mount.mount
        self._period_ns = round(settings.mount.check_every_s * 1e9)
        self._infer = infer
        self._planes: deque[GroundPlane] = deque(maxlen=_MOST_PLANES)
        self._looked_ns: int | None = None
        self._failed = False
        self._told: MountState | None = None
        self.verdict: MountVerdict | None = None
        """The newest one; None while there are too few pictures."""

    def look(self, frame: Frame, telemetry: Telemetry) -> str | None:
        """Look at a picture if it is time to; never raises.

        Args:
            frame: the picture.
            telemetry: the vehicle at its capture; only a vehicle in the air with a known attitude is judged.

        Returns:
            What the pilot should read, once, in at most 50 characters; None if there is nothing new.
        """
        attitude = telemetry.attitude
        if not self._period_ns or self._failed or attitude is None or telemetry.armed is not True:
            return None
        waited_ns = None if self._looked_ns is None else frame.captured_ns - self._looked_ns
        if waited_ns is not None and 0 <= waited_ns < self._period_ns:
            return None
        self._looked_ns = frame.captured_ns
        try:
            depth = self._infer(frame)
            plane = find_ground_plane(depth.depth_m, self._camera, self._mount, attitude, frame.index)
            if plane is None:
                return None
            self._planes.append(plane)
            if len(self._planes) < _FEWEST_PLANES:
                return None
            self.verdict = check_mount(list(self._planes), self._mount)
        except Exception:
            # A help for the pilot, and nothing that distances depend on.
            self._failed = True
            log.exception("the mount's check failed and is not tried again")
            return None
        return self._tell(self.verdict)

    def _tell(self, verdict: MountVerdict) -> str | None:
        """What is new: a mount that differs is told again only after it has agreed."""
        if verdict.state not in (MountState.AGREES, MountState.DIFFERS) or verdict.state is self._told:
            return None
        self._told = verdict.state
        if verdict.state is MountState.AGREES:
            log.info(verdict.text)
            return None
        log.warning(verdict.text)
        return f"uavdepth: mount pitch {verdict.pitch_deg:.0f} roll {verdict.roll_deg:.0f} by ground"
