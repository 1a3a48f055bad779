"""All checks, in the order of the report."""

from __future__ import annotations

from collections.abc import Callable

from service.doctor.ardupilot_checks import check_ardupilot
from service.doctor.finding import Finding, Level
from service.doctor.flight_checks import (
    check_arming,
    check_mode,
    check_obstacles_arrive,
    check_parameters_answered,
    check_speed,
)
from service.doctor.link_checks import (
    check_budget,
    check_clock,
    check_heartbeat,
    check_latency,
    check_others,
    check_protocol,
    check_signing,
)
from service.doctor.observation import ARDUPILOT, PX4, Observation, Plan
from service.doctor.px4_checks import check_px4
from service.doctor.stream_checks import check_rangefinder, check_rates

Check = Callable[[Observation, Plan], list[Finding]]


def check_flavor(seen: Observation, plan: Plan) -> list[Finding]:
    """Only ArduPilot and PX4 are known to act on obstacles."""
    if seen.autopilot in (None, ARDUPILOT, PX4):
        return []
    text = f"{seen.autopilot} is neither ArduPilot nor PX4: what it does with obstacles is not known"
    return [Finding(Level.WARNING, "autopilot", text, "try it in its simulator first")]


CHECKS: tuple[Check, ...] = (
    check_heartbeat,
    check_flavor,
    check_others,
    check_protocol,
    check_signing,
    check_budget,
    check_clock,
    check_rates,
    check_rangefinder,
    check_latency,
    check_parameters_answered,
    check_ardupilot,
    check_px4,
    check_obstacles_arrive,
    check_mode,
    check_arming,
    check_speed,
)


def examine(seen: Observation, plan: Plan) -> list[Finding]:
    """What is right and wrong; a pure function of what was seen."""
    return [finding for check in CHECKS for finding in check(seen, plan)]
