"""Where the autopilot's clock stands against the service's."""

from __future__ import annotations

_DRIFT = 0.001
"""Seconds a second by which bounds are loosened: crystals part by 100e-6, ArduPilot's SITL by 200e-6."""

_SLOW_CLOCK_DRIFT = 0.03
"""The same for the upper bound while nothing reaches it and no round trip tells better: PX4's simulator
ran 1.6 % slow for minutes."""

_UNREACHED_NS = 1_000_000_000
_LONGEST_GAP_NS = 250_000_000
"""A silent link loosens the bounds by no more than a gap of this length would."""

_ANSWER_BIAS_NS = 15_000_000
"""ArduPilot takes the time that a request needs at the port's baud off its stamp, on a network too: its
answers put the offset up to 10 ms too high."""

_STEP_NS = 100_000_000
"""Bounds that contradict each other by less are drift and noise; by more, a clock has stepped."""

_MAX_WIDTH_NS = 50_000_000
"""Widest bracket whose middle is taken: beyond it the way up is too slow to say anything."""

_SYNCED_WIDTH_NS = 15_000_000
"""Widest bracket that counts as synchronised: its middle is at most 7.5 ms off, a degree at 130 deg/s."""

_MAX_ROUND_TRIP_NS = 1_000_000_000
"""Slower round trips are not looked at."""

_SYNCED_FOR_NS = 10_000_000_000
"""Without a round trip for this long the clocks no longer count as synchronised."""

_LATE_NS = 150_000_000
"""A message that is later than the best by more than this is held up, or the clock has stepped."""

_STEADY_NS = 50_000_000
_STEADY_FOR_NS = 3_000_000_000
"""Lateness that stays within 50 ms for 3 s is no queue running empty."""


class ClockSync:
    """Bounds on the offset = service clock - autopilot clock.

    A message cannot arrive before it was stamped: each arrival is an upper bound. The autopilot cannot
    answer a TIMESYNC request before it was sent: each round trip is a lower bound too. The tightest bounds
    are kept and slowly loosened, so a message that was held up (a stall, a burst) says nothing and cannot
    make old data look fresh. Bounds that contradict each other grossly mean that one of the clocks has
    stepped: then only the newest word counts.
    """

    def __init__(self) -> None:
        self.steps = 0
        """Times that one of the two clocks was seen to step."""
        self._forget()

    def restart(self) -> None:
        """Forget the bounds: the autopilot has rebooted or is another one."""
        self._forget()

    def _forget(self) -> None:
        self._upper_ns: float | None = None
        self._lower_ns: float | None = None
        self._loosened_at_ns = 0
        self._unreached_ns = 0
        self._round_trip_at_ns: int | None = None
        self._late_since_ns: int | None = None
        self._late_least_ns = 0

    @property
    def offset_ns(self) -> int | None:
        """Service clock minus autopilot clock in nanoseconds; None before the first message."""
        if self._upper_ns is None:
            return None
        width_ns = self.width_ns
        if self._lower_ns is None or width_ns is None or width_ns > _MAX_WIDTH_NS:
            return round(self._upper_ns)
        return round((self._upper_ns + self._lower_ns) / 2)

    @property
    def width_ns(self) -> int | None:
        """How far apart the bounds are, nanoseconds; None while no round trip has closed them."""
        if self._upper_ns is None or self._lower_ns is None:
            return None
        return max(0, round(self._upper_ns - self._lower_ns))

    def is_synced(self, now_ns: int) -> bool:
        """Whether a recent round trip binds the clocks closely enough to send stamps to the autopilot."""
        width_ns = self.width_ns
        return self._has_round_trip(now_ns) and width_ns is not None and width_ns <= _SYNCED_WIDTH_NS

    def on_arrival(self, boot_ns: int, arrival_ns: int) -> bool:
        """Take a message stamped `boot_ns` by the autopilot; True if it shows that a clock has stepped."""
        self._loosen(arrival_ns)
        bound = arrival_ns - boot_ns
        if self._upper_ns is None:
            self._tighten(bound)
            return False
        if self._lower_ns is not None and bound < self._lower_ns - _STEP_NS:
            return self._step_to(bound, arrival_ns)
        if bound > self._upper_ns + _LATE_NS:
            self._unreached_ns = 0
            return self._on_late(bound, arrival_ns)
        self._late_since_ns = None
        self._tighten(bound)
        return False

    def on_round_trip(self, sent_ns: int, boot_ns: int, received_ns: int) -> bool:
        """Take a TIMESYNC answer; True if it shows that a clock has stepped.

        Args:
            sent_ns, received_ns: when the request left and the answer came, on the service's clock.
            boot_ns: the autopilot's clock in between.
        """
        if not 0 <= received_ns - sent_ns <= _MAX_ROUND_TRIP_NS:
            return False
        self._loosen(received_ns)
        low, high = sent_ns - boot_ns, received_ns - boot_ns
        stepped = (self._upper_ns is not None and low > self._upper_ns + _STEP_NS) or (
            self._lower_ns is not None and high < self._lower_ns - _STEP_NS
        )
        if stepped:
            self._step_to(high, received_ns)
        self._round_trip_at_ns = received_ns
        self._tighten(high)
        if self._upper_ns is None or low > self._upper_ns + _ANSWER_BIAS_NS:
            self._reach(high)  # the autopilot's clock runs slow
        upper_ns = high if self._upper_ns is None else self._upper_ns
        self._lower_ns = min(upper_ns, low if self._lower_ns is None else max(self._lower_ns, low))
        return stepped

    def _tighten(self, bound: float) -> None:
        """The offset is no larger than `bound`."""
        if self._upper_ns is None or bound <= self._upper_ns:
            self._reach(bound)
        if self._lower_ns is not None and self._upper_ns is not None:
            self._lower_ns = min(self._lower_ns, self._upper_ns)

    def _reach(self, upper_ns: float) -> None:
        self._upper_ns, self._unreached_ns = upper_ns, 0

    def _on_late(self, bound: int, arrival_ns: int) -> bool:
        """A queue that runs empty gets less late; lateness that stays is a clock that has stepped."""
        if self._late_since_ns is None or bound < self._late_least_ns - _STEADY_NS:
            self._late_since_ns, self._late_least_ns = arrival_ns, bound
            return False
        self._late_least_ns = min(self._late_least_ns, bound)
        if arrival_ns - self._late_since_ns < _STEADY_FOR_NS or self._denies_steps(arrival_ns):
            return False  # too early to tell, or a round trip has said lately that the old offset holds
        return self._step_to(self._late_least_ns, arrival_ns)

    def _denies_steps(self, now_ns: int) -> bool:
        width_ns = self.width_ns
        return self._has_round_trip(now_ns) and width_ns is not None and width_ns <= _MAX_WIDTH_NS

    def _step_to(self, upper_ns: int, at_ns: int) -> bool:
        self._forget()
        self._loosened_at_ns = at_ns
        self._tighten(upper_ns)
        self.steps += 1
        return True

    def _loosen(self, now_ns: int) -> None:
        gap_ns = min(max(0, now_ns - self._loosened_at_ns), _LONGEST_GAP_NS)
        self._loosened_at_ns = now_ns
        self._unreached_ns += gap_ns
        if self._lower_ns is not None:
            self._lower_ns -= gap_ns * _DRIFT
        if self._upper_ns is not None:
            slow = self._unreached_ns > _UNREACHED_NS and not self._has_round_trip(now_ns)
            self._upper_ns += gap_ns * (_SLOW_CLOCK_DRIFT if slow else _DRIFT)

    def _has_round_trip(self, now_ns: int) -> bool:
        return self._round_trip_at_ns is not None and now_ns - self._round_trip_at_ns <= _SYNCED_FOR_NS
