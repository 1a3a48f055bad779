"""Faults of the autopilot and its link, each at a moment after the start: `kind@second[:value]`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from uavdepth.errors import UavDepthError


class FaultError(UavDepthError, ValueError):
    """A fault specification that cannot be read."""


class FaultKind(StrEnum):
    """What can go wrong."""

    REBOOT = "reboot"
    """The autopilot starts again: links drop, streams are lost, time since boot begins at 0."""

    PAUSE = "pause"
    """Everything in both directions is lost for so many seconds."""

    BURST = "burst"
    """Everything in both directions waits for so many seconds, and then arrives at once."""

    CLOCK = "clock"
    """The autopilot's time since boot jumps by so many seconds, which may be negative."""

    STREAMS = "streams"
    """The message intervals asked for are forgotten."""


_WITH_DURATION = (FaultKind.PAUSE, FaultKind.BURST)
_FORMS = "reboot@SECOND, pause@SECOND:DURATION, burst@SECOND:DURATION, clock@SECOND:STEP, streams@SECOND"


@dataclass(frozen=True)
class Fault:
    """One fault.

    Args:
        kind: what goes wrong.
        at_s: seconds after the start of the autopilot, 0 or more.
        value_s: duration of a pause or burst (above 0), step of a clock (not 0); 0 for the others.

    Raises:
        FaultError: a number that the kind cannot have.
    """

    kind: FaultKind
    at_s: float
    value_s: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.at_s) or self.at_s < 0.0:
            raise FaultError(f"fault {self.kind}: second {self.at_s} must be 0 or more")
        if not math.isfinite(self.value_s):
            raise FaultError(f"fault {self.kind}: {self.value_s} is not a finite number of seconds")
        if self.kind in _WITH_DURATION and self.value_s <= 0.0:
            raise FaultError(
                f"fault {self.kind}: duration {self.value_s} s must be above 0, as in {self.kind}@30:5"
            )
        if self.kind is FaultKind.CLOCK and self.value_s == 0.0:
            raise FaultError("fault clock: needs a step in seconds that is not 0, as in clock@30:-1.5")
        if self.kind in (FaultKind.REBOOT, FaultKind.STREAMS) and self.value_s != 0.0:
            raise FaultError(f"fault {self.kind}: takes no value after the second, got {self.value_s}")

    @property
    def end_s(self) -> float:
        """When a pause or burst is over, seconds after the start."""
        return self.at_s + self.value_s


def parse_fault(text: str) -> Fault:
    """Read `reboot@20`, `pause@30:5`, `burst@40:3`, `clock@50:-1.5` or `streams@60`.

    Raises:
        FaultError: anything else; the text says what was wrong and which forms there are.
    """
    name, found, rest = text.partition("@")
    if not found or name not in [kind.value for kind in FaultKind]:
        raise FaultError(f"fault {text!r} is none of {_FORMS}")
    numbers = rest.split(":")
    if len(numbers) > 2:
        raise FaultError(f"fault {text!r} has too many parts: {_FORMS}")
    try:
        at_s, *value = (float(number) for number in numbers)
    except ValueError:
        raise FaultError(f"fault {text!r}: {rest!r} is not a number of seconds: {_FORMS}") from None
    return Fault(FaultKind(name), at_s, value[0] if value else 0.0)


class FaultPlan:
    """The faults of a flight, in the order of their time."""

    def __init__(self, faults: Sequence[Fault] = ()) -> None:
        self._faults = sorted(faults, key=lambda fault: fault.at_s)
        self._waiting = list(self._faults)

    def add(self, fault: Fault) -> None:
        """One more fault, while the autopilot runs."""
        self._faults.append(fault)
        self._waiting = sorted([*self._waiting, fault], key=lambda waiting: waiting.at_s)

    def starting(self, now_s: float) -> list[Fault]:
        """Faults that have begun since the last call."""
        started = [fault for fault in self._waiting if fault.at_s <= now_s]
        self._waiting = [fault for fault in self._waiting if fault.at_s > now_s]
        return started

    def is_active(self, kind: FaultKind, now_s: float) -> bool:
        """Whether a pause or burst goes on now."""
        return any(fault.kind is kind and fault.at_s <= now_s < fault.end_s for fault in self._faults)
