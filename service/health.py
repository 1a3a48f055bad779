"""What the service says of itself: state for the HEARTBEAT and words for the pilot."""

from __future__ import annotations

from dataclasses import dataclass

from service.autopilot.service_state import ServiceState
from service.cameras.reader import CameraState
from service.trouble import Trouble

STALL_NS = 400_000_000
"""After so long without a message obstacles are off: ArduPilot's sensor is unhealthy after 0.5 s, PX4
stops accelerating after 0.53 s (measured), and the pilot reads why by then."""

FIRST_FRAME_NS = 10_000_000_000
"""Longest start of a camera, a rendered scene included, that is not yet called trouble."""

SEVERITY_CRITICAL = 2
SEVERITY_WARNING = 4
SEVERITY_INFO = 6
"""MAV_SEVERITY. Ground stations read critical aloud."""


@dataclass(frozen=True)
class Vitals:
    """What the state is judged by.

    Args:
        now_ns, started_ns: the moment, and when the service started.
        camera: state of the camera.
        link_connected: the autopilot is heard.
        armed: the vehicle's motors; None if not known.
        frame_ns: when the newest picture arrived, None before the first.
        result_ns: when the newest picture was measured, None before the first.
        result_trouble: what was wrong with that one.
        sent_ns: when distances were sent last, None if never.
        armed_ns: when the vehicle was armed last, None if it was so from the start or never.
        mavlink1: the autopilot speaks MAVLink 1, which has no OBSTACLE_DISTANCE.
    """

    now_ns: int
    started_ns: int
    camera: CameraState
    link_connected: bool
    armed: bool | None
    frame_ns: int | None
    result_ns: int | None
    result_trouble: Trouble | None
    sent_ns: int | None
    armed_ns: int | None = None
    mavlink1: bool = False

    @property
    def protected(self) -> bool:
        """Whether the vehicle is armed and has been given distances since it was."""
        return bool(self.armed) and self.sent_ns is not None and self.sent_ns >= (self.armed_ns or 0)


def trouble_of(vitals: Vitals) -> Trouble | None:
    """The first cause of silence along the way of the data, or None while distances are sent."""
    if vitals.sent_ns is not None and vitals.now_ns - vitals.sent_ns <= STALL_NS:
        return None
    if vitals.camera in (CameraState.LOST, CameraState.FAILED, CameraState.ENDED):
        return Trouble.CAMERA_LOST
    if not vitals.link_connected:
        return Trouble.STARTING if vitals.sent_ns is None else Trouble.LINK_LOST
    if vitals.mavlink1:
        return Trouble.NOT_SENT
    if vitals.frame_ns is None and vitals.now_ns - vitals.started_ns > FIRST_FRAME_NS:
        return Trouble.CAMERA_LOST
    if vitals.frame_ns is not None and vitals.now_ns - vitals.frame_ns > STALL_NS:
        return Trouble.CAMERA_LOST
    if vitals.result_ns is None:
        return Trouble.STARTING
    if vitals.now_ns - vitals.result_ns > STALL_NS:
        return Trouble.STALLED
    return vitals.result_trouble or Trouble.NOT_SENT


def state_of(trouble: Trouble | None, vitals: Vitals) -> ServiceState:
    """The HEARTBEAT's state: CRITICAL when what protected the vehicle, or should in the air, is gone."""
    if trouble is None:
        return ServiceState.ACTIVE
    if trouble is Trouble.STARTING:
        return ServiceState.BOOT
    if trouble.is_fault or vitals.protected:
        return ServiceState.CRITICAL
    return ServiceState.STANDBY


@dataclass(frozen=True)
class Announcement:
    """One STATUSTEXT."""

    severity: int
    text: str


class Announcer:
    """Turns changes of trouble into texts: each once, and not while it flickers.

    The loss of what protected the vehicle is told at once: silence has lasted by then, and ArduPilot opens
    the way soon.

    Args:
        settle_ns: how long another trouble, or its end, must last before it is announced.
    """

    def __init__(self, settle_ns: int = 300_000_000) -> None:
        self._settle_ns = settle_ns
        self._said: Trouble | None = Trouble.STARTING
        self._seen: Trouble | None = Trouble.STARTING
        self._seen_since_ns = 0

    def hear(self, trouble: Trouble | None, state: ServiceState, now_ns: int) -> Announcement | None:
        """What to say now, if anything."""
        if trouble is not self._seen:
            self._seen, self._seen_since_ns = trouble, now_ns
        is_loss = self._said is None and state is ServiceState.CRITICAL
        settle_ns = 0 if is_loss else self._settle_ns
        if trouble is self._said or now_ns - self._seen_since_ns < settle_ns:
            return None
        self._said = trouble
        if trouble is None:
            return Announcement(SEVERITY_INFO, "uavdepth: obstacles ON")
        if trouble is Trouble.ON_GROUND:
            return Announcement(SEVERITY_INFO, "uavdepth ready: distances after take-off")
        severity = SEVERITY_CRITICAL if state is ServiceState.CRITICAL else SEVERITY_WARNING
        return Announcement(severity, f"uavdepth OFF: {trouble.value}")
