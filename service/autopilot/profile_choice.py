"""Which layout of OBSTACLE_DISTANCE the autopilot gets: by its HEARTBEAT and version, unless it is set."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uavdepth.messages.autopilot_profile import ARDUPILOT, PROFILES, PX4, PX4_LEGACY, AutopilotProfile

AUTO = "auto"

Version = tuple[int, int, int]
"""Major, minor, patch."""

PX4_FINE_BINS_SINCE: Version = (1, 18, 0)
"""First release measured to have 5 degree bins; 1.15.4 has 10. What lies between was not measured, and the
10 degree layout loses nothing on any."""

_FIRST_GAP_NS = 1_000_000_000
_LAST_GAP_NS = 16_000_000_000
"""Time between two questions for the version; it doubles."""


class ProfileChoice:
    """Chooses the profile, and asks a PX4 for its version as long as that decides.

    Until a PX4 has told its version it gets the layout that every measured version reads without loss.

    Args:
        setting: "auto" or the name of a profile.
    """

    def __init__(self, setting: str) -> None:
        self._fixed = None if setting == AUTO else PROFILES[setting]
        self._autopilot: str | None = None
        self._gap_ns = _FIRST_GAP_NS
        self._asked_ns: int | None = None
        self.version: Version | None = None
        """The autopilot's release, or None before it was told."""

    def __str__(self) -> str:
        release = "" if self.version is None else " for version " + ".".join(map(str, self.version))
        profile = self.profile
        layout = f"{profile.element_count} elements of {profile.increment_deg:g} degrees"
        return f"profile {profile.name}{release} ({layout})"

    def on_vehicle(self, autopilot: str) -> None:
        """Another autopilot is listened to: "ardupilot", "px4", ..."""
        self._autopilot, self.version = autopilot, None
        self.restart()

    def restart(self) -> None:
        """Ask again: the autopilot is back or has rebooted, perhaps with other firmware."""
        self._gap_ns, self._asked_ns = _FIRST_GAP_NS, None

    def on_version(self, message: mavlink.MAVLink_autopilot_version_message) -> bool:
        """Take AUTOPILOT_VERSION; True if it tells another version than was known. 0.0.0 tells none."""
        word = message.flight_sw_version
        version = (word >> 24 & 0xFF, word >> 16 & 0xFF, word >> 8 & 0xFF)
        if not any(version) or version == self.version:
            return False
        self.version = version
        return True

    def request(self, system_id: int, now_ns: int) -> mavlink.MAVLink_command_long_message | None:
        """MAV_CMD_REQUEST_MESSAGE for AUTOPILOT_VERSION, if it is time to ask."""
        if self._fixed is not None or self._autopilot != "px4" or self._is_answered:
            return None
        if self._asked_ns is not None:
            if now_ns - self._asked_ns < self._gap_ns:
                return None
            self._gap_ns = min(2 * self._gap_ns, _LAST_GAP_NS)
        self._asked_ns = now_ns
        return mavlink.MAVLink_command_long_message(
            system_id,
            mavlink.MAV_COMP_ID_AUTOPILOT1,
            mavlink.MAV_CMD_REQUEST_MESSAGE,
            0,
            float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION),
            *[0.0] * 6,
        )

    @property
    def _is_answered(self) -> bool:
        return self.version is not None and self._asked_ns is not None

    @property
    def profile(self) -> AutopilotProfile:
        """The layout to send in now."""
        if self._fixed is not None:
            return self._fixed
        if self._autopilot != "px4":
            return ARDUPILOT
        if self.version is not None and self.version >= PX4_FINE_BINS_SINCE:
            return PX4
        return PX4_LEGACY
