"""PX4's map of what stands around it: 72 bins of 5 degrees, fed by OBSTACLE_DISTANCE.

Every rule here was measured on PX4 v1.18 in its simulator (v1.15's coarser map is not modelled). Not
modelled: DISTANCE_SENSOR as an input, more than one sender.
"""

from __future__ import annotations

from functools import lru_cache

from service.fake_autopilot.obstacle_words import UNKNOWN_WORD, ObstacleWords

BIN_COUNT = 72
BIN_WIDTH_DEG = 5.0
BIN_EXPIRY_S = 0.45
"""A bin goes this long after its last update (measured: between 0.4 and 0.5 s)."""

MESSAGE_WORDS = 72
PHANTOM_WORD = 0
"""What stands behind the 72 words, where PX4 reads on when the increment is below 5 degrees: memory
contents, mostly 0."""

FRAME_GLOBAL = 0
FRAME_LOCAL_NED = 1
FRAME_BODY_FRD = 12


class UnsupportedFrameError(ValueError):
    """An OBSTACLE_DISTANCE in a frame that PX4 refuses; the text is PX4's critical message."""


class ObstacleMap:
    """Distances in 72 bins, bin 0 round the nose, clockwise. Times are seconds of one steady clock."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything, as entering Position mode does."""
        self._distances_cm = [UNKNOWN_WORD] * BIN_COUNT
        self._ranges_cm = [0] * BIN_COUNT
        self._updated_s = [-1e9] * BIN_COUNT
        self._ever_known = [False] * BIN_COUNT
        self.min_distance_cm = UNKNOWN_WORD
        self.max_distance_cm = 0
        self.message_s: float | None = None

    def update(self, words: ObstacleWords, now_s: float, yaw_deg: float = 0.0) -> bool:
        """Take one message in; for each bin the overlapping elements are taken in their order, so the last
        wins.

        Args:
            yaw_deg: the vehicle's heading, for messages in a north-aligned frame (0 and 1).

        Returns:
            False if the message was ignored (no positive increment).

        Raises:
            UnsupportedFrameError: the frame is none of 0, 1 and 12.
        """
        increment = words.increment_f_deg if words.increment_f_deg > 0.0 else float(words.increment_deg)
        if not increment > 0.0:
            return False
        if words.frame == FRAME_BODY_FRD:
            overlaps = _overlaps(increment, words.offset_deg, int(360.0 / increment))
        elif words.frame in (FRAME_GLOBAL, FRAME_LOCAL_NED):
            # Only this frame has a bound at the end of the array.
            count = min(int(360.0 / increment), MESSAGE_WORDS)
            overlaps = _overlaps(increment, round(words.offset_deg - yaw_deg, 1), count)
        else:
            raise UnsupportedFrameError(f"Obstacle message received in unsupported frame {words.frame}")
        self.message_s = now_s
        self.max_distance_cm = max(self.max_distance_cm, words.max_distance_cm)
        self.min_distance_cm = min(self.min_distance_cm, words.min_distance_cm)
        available = words.distances_cm
        for bin_index, elements in enumerate(overlaps):
            for element in elements:
                word = available[element] if element < len(available) else PHANTOM_WORD
                if word != UNKNOWN_WORD and self._accepts(bin_index, word, words.max_distance_cm):
                    self._distances_cm[bin_index] = word
                    self._ranges_cm[bin_index] = words.max_distance_cm
                    self._updated_s[bin_index] = now_s
                    self._ever_known[bin_index] = True
        return True

    def tick(self, now_s: float) -> None:
        """Drop bins that were not updated for too long."""
        for bin_index in range(BIN_COUNT):
            if now_s - self._updated_s[bin_index] > BIN_EXPIRY_S:
                self._distances_cm[bin_index] = UNKNOWN_WORD

    @property
    def distances_cm(self) -> tuple[int, ...]:
        """The fused map as PX4 streams it back: 72 words from the nose, 65535 for unknown."""
        return tuple(self._distances_cm)

    def distance_m(self, bin_index: int) -> float | None:
        """What is known in a bin: metres to an obstacle, +inf for free, None for unknown."""
        word = self._distances_cm[bin_index % BIN_COUNT]
        if word == UNKNOWN_WORD:
            return None
        return word / 100.0 if word < self._ranges_cm[bin_index % BIN_COUNT] else float("inf")

    def was_ever_known(self, bin_index: int) -> bool:
        """Whether the bin ever held anything since the map was reset."""
        return self._ever_known[bin_index % BIN_COUNT]

    @property
    def knows_anything(self) -> bool:
        """Whether any bin holds anything, an obstacle or a free way."""
        return any(word != UNKNOWN_WORD for word in self._distances_cm)

    @property
    def nearest_m(self) -> float | None:
        """Nearest obstacle of all bins in metres."""
        found = [self.distance_m(bin_index) for bin_index in range(BIN_COUNT)]
        return min((d for d in found if d is not None and d != float("inf")), default=None)

    def _accepts(self, bin_index: int, word: int, range_cm: int) -> bool:
        """Whether a word may replace what the bin holds.

        The bin remembers the range of the sensor that wrote it, also after it has expired: a reading may
        come from a sensor of shorter or equal range, but only a sensor that sees as far may say that the way
        is clear. That is why "clear" is never accepted again once max_distance was lowered.
        """
        remembered = self._ranges_cm[bin_index]
        holds_obstacle = self._distances_cm[bin_index] < remembered
        if word < range_cm:
            return not holds_obstacle or range_cm <= remembered
        return range_cm == remembered if holds_obstacle else range_cm >= remembered


@lru_cache(maxsize=512)
def _overlaps(increment: float, offset: float, count: int) -> tuple[tuple[int, ...], ...]:
    """For each bin the elements that overlap it, in the order of the message.

    A range that crosses the nose is counted from below zero; one that only ends there is too, and so misses
    the bins at 355 degrees. That is how v1.18 loses elements whose edge lies on the nose.
    """
    spans = [_span(element * increment + offset, increment) for element in range(count)]
    table = []
    for bin_index in range(BIN_COUNT):
        lower, upper = _span(bin_index * BIN_WIDTH_DEG, BIN_WIDTH_DEG)
        table.append(tuple(e for e, (start, end) in enumerate(spans) if start < upper and end > lower))
    return tuple(table)


def _span(centre_deg: float, width_deg: float) -> tuple[float, float]:
    lower = (centre_deg - width_deg / 2) % 360.0
    upper = (centre_deg + width_deg / 2) % 360.0
    return (lower - 360.0 if lower > upper else lower), upper
