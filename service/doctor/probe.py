"""A trial: does the autopilot take OBSTACLE_DISTANCE? On the ground, disarmed, and never otherwise.

In the air a message without obstacles would wipe those that the autopilot knows, and ArduPilot takes
"unknown" for a free way. So before every single message the newest HEARTBEAT must be fresh and
say "disarmed", and the first "armed" ends the trial for good.
HEARTBEAT comes once a second, so messages may go on for a second after arming on the ground; they take
nothing away, since there is no trial where somebody else sends obstacles. For 2 s they let an ArduPilot pass
its arming check "PRX1: No Data".
"""

from __future__ import annotations

from service.doctor.observation import ARDUPILOT, Probe

_BEGIN_NS = 1_000_000_000
_LENGTH_NS = 1_600_000_000
_PERIOD_NS = 100_000_000
_SETTLED_NS = 400_000_000
"""A SYS_STATUS counts as one with the trial's messages this long after the first."""

_NEWEST_HEARTBEAT_S = 1.6


class ObstacleProbe:
    """Decides when an empty message may be sent, and judges SYS_STATUS.

    Args:
        wanted: the user allows it.
    """

    def __init__(self, wanted: bool) -> None:
        self._outcome: Probe | None = None if wanted else Probe.UNWANTED
        self._known_ns: int | None = None
        self._first_ns: int | None = None
        self._next_ns = 0
        self.before: bool | None = None
        self.during: bool | None = None

    @property
    def outcome(self) -> Probe:
        """What became of it."""
        if self._outcome is not None:
            return self._outcome
        return Probe.SENT if self._first_ns is not None else Probe.NO_TIME

    def on_proximity(self, healthy: bool, arrival_ns: int) -> None:
        """Take the proximity bit of a SYS_STATUS."""
        if self._first_ns is None:
            self.before = healthy
        elif _SETTLED_NS <= arrival_ns - self._first_ns <= _LENGTH_NS + _PERIOD_NS:
            # One healthy word is enough: it cannot come from anywhere else.
            self.during = healthy or bool(self.during)

    def may_send(
        self,
        autopilot: str | None,
        armed: bool | None,
        heartbeat_age_s: float | None,
        other_sender: bool,
        now_ns: int,
    ) -> bool:
        """Whether an empty OBSTACLE_DISTANCE may leave now."""
        if self._outcome is not None or autopilot is None:
            return False
        if self._known_ns is None:
            self._known_ns = now_ns
        if autopilot != ARDUPILOT:
            self._outcome = Probe.NO_ANSWER_EXPECTED
        elif armed is not False:
            self._outcome = Probe.ARMED
        elif other_sender or self.before:
            self._outcome = Probe.OTHER_SENDER
        if self._outcome is not None:
            return False
        if heartbeat_age_s is None or heartbeat_age_s > _NEWEST_HEARTBEAT_S:
            return False
        if self.before is None or now_ns - self._known_ns < _BEGIN_NS or now_ns < self._next_ns:
            return False
        if self._first_ns is None:
            self._first_ns = now_ns
        if now_ns - self._first_ns > _LENGTH_NS:
            return False
        self._next_ns = now_ns + _PERIOD_NS
        return True

    def wants_status(self, now_ns: int) -> bool:
        """Whether SYS_STATUS should be asked for now, being needed to judge the trial."""
        return self._first_ns is not None and now_ns - self._first_ns <= _LENGTH_NS
