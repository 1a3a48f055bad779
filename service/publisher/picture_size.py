"""How large a picture may be, and the ladder of sizes and qualities that gets it there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

FRAME_S: Final = 0.05
"""Largest picture in seconds of the budget: scans wait behind it, and Zenoh may drop what takes longer."""

_MARGIN = 0.8
_UP_NS: Final = 500_000_000


@dataclass(frozen=True)
class Step:
    """One rung.

    Args:
        divisor: the picture's sides are divided by it.
        quality: JPEG quality, 1 to 100; not used for depth.
        relative_bytes: rough size against the first rung.
    """

    divisor: int
    quality: int
    relative_bytes: float


def depth_ladder() -> tuple[Step, ...]:
    """Rungs of lossless depth: smaller sides only."""
    return tuple(Step(divisor, 100, divisor**-1.7) for divisor in (1, 2, 3, 4, 6, 8))


def camera_ladder(quality: int) -> tuple[Step, ...]:
    """Rungs of the camera picture, from the configured JPEG quality on down."""
    medium, low = max(quality * 2 // 3, 1), max(quality * 2 // 5, 1)
    return (
        Step(1, quality, 1.0),
        Step(1, medium, 0.68),
        Step(2, quality, 0.3),
        Step(2, medium, 0.21),
        Step(2, low, 0.15),
        Step(4, medium, 0.065),
        Step(4, low, 0.045),
        Step(8, low, 0.015),
    )


class Ladder:
    """Chooses the rung on which pictures fit; goes down at once, and up after half a second of quiet.

    Args:
        steps: best first.
    """

    def __init__(self, steps: tuple[Step, ...]) -> None:
        self._steps = steps
        self._index = 0
        self._changed_ns = 0

    @property
    def step(self) -> Step:
        """The rung for the next picture."""
        return self._steps[self._index]

    @property
    def is_at_top(self) -> bool:
        """Whether pictures are as good as they can be."""
        return self._index == 0

    def written(self, size_bytes: int, allowed_bytes: float, now_ns: int) -> bool:
        """Take note of a picture's size; whether it may be sent (if not, the next will be smaller)."""
        whole = size_bytes / self.step.relative_bytes
        fitting = next(
            (
                i
                for i, step in enumerate(self._steps)
                if whole * step.relative_bytes <= _MARGIN * allowed_bytes
            ),
            len(self._steps) - 1,
        )
        fits = size_bytes <= allowed_bytes or self._index == len(self._steps) - 1
        if not fits:
            self._index = max(self._index + 1, fitting)
            self._changed_ns = now_ns
        elif fitting < self._index and now_ns - self._changed_ns >= _UP_NS:
            self._index = fitting
            self._changed_ns = now_ns
        return fits
