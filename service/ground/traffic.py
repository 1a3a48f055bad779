"""What comes in of one vehicle a second."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

_SLICE_NS = 250_000_000
_SLICES = 8
_WINDOW_S = _SLICES * _SLICE_NS / 1e9


@dataclass
class _Slice:
    number: int
    size_bytes: int = 0
    samples: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class TrafficView:
    """Over the last two seconds.

    Args:
        bytes_per_s: of all topics, payloads and attachments.
        samples_per_s: by topic.
    """

    bytes_per_s: float
    samples_per_s: dict[str, float]


class Traffic:
    """Counts samples in slices of a quarter of a second, so that its memory is bounded."""

    def __init__(self) -> None:
        self._slices: deque[_Slice] = deque(maxlen=_SLICES + 1)

    def hear(self, topic: str, size_bytes: int, now_ns: int) -> None:
        """Count one sample."""
        number = now_ns // _SLICE_NS
        if not self._slices or self._slices[-1].number != number:
            self._slices.append(_Slice(number))
        current = self._slices[-1]
        current.size_bytes += size_bytes
        current.samples[topic] += 1

    def view(self, now_ns: int) -> TrafficView:
        """The rates over the whole slices of the last two seconds."""
        number = now_ns // _SLICE_NS
        whole = [part for part in self._slices if number - _SLICES <= part.number < number]
        samples: Counter[str] = Counter()
        for part in whole:
            samples.update(part.samples)
        return TrafficView(
            sum(part.size_bytes for part in whole) / _WINDOW_S,
            {topic: count / _WINDOW_S for topic, count in samples.items()},
        )
