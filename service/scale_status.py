"""How far a picture's metres are to be trusted."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ScaleStatus:
    """The metric scale that a picture was measured with.

    Args:
        factor: network units to metres; 1 for a network that is told the height and answers in metres.
        relative_sigma: its relative standard deviation. Of a network that answers in metres it is what the
            height and the points that it was told leave uncertain; what the network doubts of its own
            answer is in the depth map, pixel by pixel.
        age_s: time since the ground was seen, the height was heard or points were measured, seconds; 0 if on
            this picture.
        sources: what tells it: "ground" (a height above ground), "points" (measured by motion).
        suspicion: what seems to be wrong, in words; None if nothing.
    """

    factor: float
    relative_sigma: float
    age_s: float
    sources: tuple[str, ...] = ()
    suspicion: str | None = None
