"""A parameter held against what is right."""

from __future__ import annotations

from service.doctor.finding import Finding, Level
from service.doctor.observation import Observation


def number(value: float) -> str:
    """A parameter's value without the noise of single precision."""
    return f"{value:.6g}"


def judge(
    seen: Observation,
    name: str,
    fine: bool,
    level: Level,
    text: str,
    recommended: float | None,
    fix: str = "",
    fine_text: str = "",
) -> list[Finding]:
    """One finding about a parameter that has answered, none about one that has not.

    Args:
        fine: the value is right.
        level, text: how bad it is if not, and why.
        recommended: the right value, if there is one.
        fix: in place of "set NAME to RECOMMENDED".
        fine_text: what a right value means.
    """
    if name not in seen.parameters:
        return []
    value = seen.parameters[name]
    if fine:
        return [Finding(Level.OK, name, fine_text or f"is {number(value)}", "", name, value, value)]
    if not fix and recommended is not None:
        fix = f"set {name} to {number(recommended)}"
    return [Finding(level, name, f"is {number(value)}: {text}", fix, name, value, recommended)]
