"""What the doctor has to say about one thing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How bad it is."""

    OK = "ok"
    """As it should be."""

    NOTE = "note"
    """Worth knowing; nothing to repair."""

    WARNING = "warning"
    """It works, but worse than it could, or not always."""

    FAILURE = "failure"
    """Nothing would show, or nothing would stop."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Args:
        level: how bad it is.
        topic: what it is about, in a word or a parameter's name.
        text: what is the case, and what follows from it.
        fix: what to do; empty where there is nothing to do.
        parameter: name of the autopilot's parameter that it is about, or None.
        value: the parameter's present value, or None if it was not read.
        recommended: value that the parameter should have; None if there is no single right one.
    """

    level: Level
    topic: str
    text: str
    fix: str = ""
    parameter: str | None = None
    value: float | None = None
    recommended: float | None = None


def has_failure(findings: Iterable[Finding]) -> bool:
    """Whether anything is wrong enough for exit code 1."""
    return any(finding.level is Level.FAILURE for finding in findings)
