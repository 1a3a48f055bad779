"""What the service needs of an autopilot link."""

from __future__ import annotations

from typing import Protocol

from service.autopilot.link_status import LinkStatus
from service.autopilot.service_state import ServiceState
from service.telemetry import Telemetry
from uavdepth.scan.obstacle_scan import ObstacleScan


class Link(Protocol):
    """The autopilot, live or played; every method returns at once."""

    def start(self) -> None:
        """Begin to talk."""

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        """What the vehicle did at a moment."""

    def newest_pose(self) -> Telemetry:
        """What the vehicle did last."""

    def predicted_pose(self, at_ns: int) -> Telemetry:
        """What the vehicle will do at a moment that is about to come; empty if that is too far off."""

    def send_obstacles(self, scan: ObstacleScan, captured_ns: int) -> bool:
        """Take a scan as of its capture and send it as it is true when it leaves; False if not taken."""

    def set_state(self, state: ServiceState) -> None:
        """Tell the state in HEARTBEAT."""

    def say(self, severity: int, text: str) -> None:
        """Send a STATUSTEXT."""

    def hold(self) -> str:
        """Ask the vehicle once to stop and stay; the mode that is asked for, empty if none is known."""

    def status(self) -> LinkStatus:
        """How the link is doing."""

    def close(self) -> None:
        """Stop talking."""
