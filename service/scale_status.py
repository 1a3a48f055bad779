"""How far a picture's metres are to be trusted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ScaleStatus:
    """The metric scale that a picture was measured with.

    Args:
        factor: network units to metres; 1 for a network that is told the height and answers in metres.
        relative_sigma: its relative standard deviation. Of a network that answers in metres it is the
            one that half of the pixels below the horizon keep to, together with the age of the height.
        age_s: time since the ground was seen, or the height was heard, seconds; 0 if on this picture.
    """

    factor: float
    relative_sigma: float
    age_s: float
