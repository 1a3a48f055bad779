"""`on_loss = "hold"`: when the autopilot is asked to stop because perception is lost, and when never."""

from __future__ import annotations

from dataclasses import dataclass

from service.doctor.flight_modes import Effect, find_mode
from service.trouble import Trouble

HOLD_AFTER_NS = 700_000_000
"""After the last message: a dropped picture or two is no loss, and ArduPilot opens the way 1.0 s after it at
the earliest (measured)."""

_WATCHED_NS = 5_000_000_000
"""A vehicle that begins to move so soon after the loss was held by what is lost."""

_NEVER_STOPPED = frozenset({"LAND"})
"""Every landing loses its metres near the ground: stopped there, the vehicle would hang in the air."""

_MOVING_MPS = 0.5
_RECOVERED_NS = 3_000_000_000
"""Distances must have been sent for so long before a new loss may lead to a new request."""


@dataclass(frozen=True)
class Moment:
    """What the decision is made by.

    Args:
        now_ns: the moment.
        trouble: why no distances are sent, None if they are.
        sent_ns: when distances were sent last; None if never.
        protected: armed, and given distances since.
        armed: the vehicle's motors.
        autopilot, mode: of the vehicle; None if not heard.
        speed_mps: over ground; None if not known.
    """

    now_ns: int
    trouble: Trouble | None
    sent_ns: int | None
    protected: bool
    armed: bool | None
    autopilot: str | None
    mode: str | None
    speed_mps: float | None


class HoldOnLoss:
    """Asks once for each loss, for a moving armed vehicle in a mode that distances act in.

    Who has chosen another mode since flies: nothing is asked of a pilot who has taken over, until the vehicle
    has been armed again or distances have been sent for 3 s.
    """

    def __init__(self) -> None:
        self._mode_before: str | None = None
        """The mode that distances acted in while they were sent; None if none did."""
        self._is_over = False
        self._well_since_ns: int | None = None

    def hear(self, moment: Moment) -> bool:
        """Whether to ask now."""
        if moment.armed is False:
            self._mode_before, self._is_over, self._well_since_ns = None, False, None
            return False
        if moment.trouble is None:
            self._on_well(moment)
            return False
        self._well_since_ns = None
        if self._is_over or not self._was_protecting(moment):
            return False
        if moment.mode != self._mode_before:
            self._is_over = True  # the pilot has acted
            return False
        silent_ns = moment.now_ns - (moment.sent_ns or 0)
        if silent_ns > _WATCHED_NS:
            self._is_over = True
            return False
        is_moving = moment.speed_mps is not None and moment.speed_mps >= _MOVING_MPS
        if silent_ns < HOLD_AFTER_NS or not is_moving:
            return False
        self._is_over = True
        return True

    def _on_well(self, moment: Moment) -> None:
        if self._well_since_ns is None:
            self._well_since_ns = moment.now_ns
        if moment.now_ns - self._well_since_ns >= _RECOVERED_NS:
            self._is_over = False
        self._mode_before = moment.mode if _acts(moment.autopilot, moment.mode) else None

    def _was_protecting(self, moment: Moment) -> bool:
        return (
            self._mode_before is not None
            and moment.protected
            and moment.mode is not None
            and moment.trouble is not Trouble.LINK_LOST
        )


def _acts(autopilot: str | None, mode: str | None) -> bool:
    """Whether distances do anything in a mode that may be left for a stop."""
    if mode in _NEVER_STOPPED:
        return False
    row = find_mode(autopilot, mode) if autopilot is not None and mode is not None else None
    return row is not None and row.effect is not Effect.NOTHING
