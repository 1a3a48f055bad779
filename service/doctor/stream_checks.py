"""Does the vehicle tell what the service lives on?"""

from __future__ import annotations

from service.doctor.finding import Finding, Level
from service.doctor.observation import Observation, Plan

_ENOUGH = 0.7
"""Part of the wanted rate that is enough: ArduPilot quantises, links lose some."""

_WHAT_FOR = {
    "ATTITUDE": "without it nothing can be levelled and nothing is sent as clear",
    "LOCAL_POSITION_NED": "without it there is no speed: no metres from motion, no latency made good",
}
_WHY_NONE = {
    "LOCAL_POSITION_NED": "wait for GPS (some 40 s after start on ArduPilot) or give the vehicle another "
    "position source",
}


def check_rates(seen: Observation, plan: Plan) -> list[Finding]:
    """Rates of ATTITUDE and LOCAL_POSITION_NED; the rangefinder has its own check."""
    if seen.autopilot is None:
        return []
    return [_rate(name, seen.rates_hz.get(name, 0.0), plan.wanted_hz.get(name, 0.0)) for name in _WHAT_FOR]


def _rate(name: str, rate_hz: float, wanted_hz: float) -> Finding:
    if rate_hz >= _ENOUGH * wanted_hz and rate_hz > 0.0:
        return Finding(Level.OK, name, f"comes {rate_hz:.1f} times a second, wanted {wanted_hz:g}")
    fix = "raise the line's baud rate, or ask for less with [autopilot] attitude_rate_hz and position_rate_hz"
    if rate_hz > 0.0:
        text = f"comes {rate_hz:.1f} times a second only, wanted {wanted_hz:g}"
        return Finding(Level.WARNING, name, text, fix)
    level = Level.FAILURE if name == "ATTITUDE" else Level.WARNING
    fix = _WHY_NONE.get(name, "check that the line works in both directions: the service asks for it")
    return Finding(level, name, f"does not come: {_WHAT_FOR[name]}", fix)


def check_rangefinder(seen: Observation, plan: Plan) -> list[Finding]:
    """A downward rangefinder: DISTANCE_SENSOR with orientation 25, and no other."""
    if seen.autopilot is None:
        return []
    wanted_hz = plan.wanted_hz.get("DISTANCE_SENSOR", 0.0)
    if seen.rangefinder_hz >= _ENOUGH * wanted_hz and seen.rangefinder_hz > 0.0:
        reading = "" if seen.rangefinder_m is None else f", now {seen.rangefinder_m:.2f} m"
        return [
            Finding(
                Level.OK, "rangefinder", f"height comes {seen.rangefinder_hz:.1f} times a second{reading}"
            )
        ]
    if seen.rangefinder_hz > 0.0:
        text = f"height comes {seen.rangefinder_hz:.1f} times a second only, wanted {wanted_hz:g}"
        return [Finding(Level.WARNING, "rangefinder", text, "raise the line's baud rate")]
    fix = "fit a downward rangefinder; on ArduPilot set RNGFND1_TYPE and RNGFND1_ORIENT 25"
    text = "no height comes (DISTANCE_SENSOR with orientation 25): depth loses its surest scale"
    return [Finding(Level.WARNING, "rangefinder", text, fix)]
