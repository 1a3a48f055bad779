"""A picture that waited gives way to the one that is about to come."""

from __future__ import annotations

import numpy as np
import pytest

from service.frame import Frame
from service.fresh_frames import FreshFrames
from service.latest_slot import LatestSlot
from service.settings import Settings

PERIOD_NS = 66_000_000


class Watch:
    """A clock that stands where it is put."""

    at_ns = 0

    def now_ns(self) -> int:
        return self.at_ns


def picture(index: int, captured_ns: int | None = None) -> Frame:
    at_ns = index * PERIOD_NS if captured_ns is None else captured_ns
    return Frame(np.zeros((2, 2, 3), np.uint8), at_ns, index)


class Slot(LatestSlot[Frame]):
    """A slot into which a picture comes while the taker waits for it."""

    coming: Frame | None = None

    def take(self, timeout_s: float | None = 0.0) -> Frame | None:
        if timeout_s and self.coming is not None:
            self.put(self.coming)
        return super().take(0.0)


def fresh_frames(latency_ms: float = 0.0) -> tuple[FreshFrames, Slot, Watch]:
    camera = {"source": "0", "horizontal_fov_deg": 90.0, "latency_ms": latency_ms}
    clock, slot = Watch(), Slot()
    frames = FreshFrames(clock, Settings.model_validate({"camera": camera}).camera)
    frames.slot = slot
    return frames, slot, clock


def taken(
    waited_ns: int, *, comes: bool = True, latency_ms: float = 0.0, period_ns: int = PERIOD_NS
) -> tuple[int, int]:
    """Which picture is measured after number 0 if 1 has waited so long, and how many never are."""
    frames, slot, clock = fresh_frames(latency_ms)
    slot.put(picture(0))
    frames.take(0.0)
    slot.put(picture(1, period_ns))
    slot.coming = picture(2, 2 * period_ns) if comes else None
    clock.at_ns = period_ns + waited_ns
    frame = frames.take(0.0)
    assert frame is not None
    return frame.index, frames.dropped_count


@pytest.mark.parametrize(
    ("waited_ms", "index"),
    [
        pytest.param(0, 1, id="fresh"),
        pytest.param(50, 1, id="less than four fifths of a period"),
        pytest.param(55, 2, id="the next is about to come"),
        pytest.param(90, 1, id="the next should be here already: it may never come"),
    ],
)
def test_a_picture_is_measured_unless_the_next_is_about_to_come(waited_ms: int, index: int) -> None:
    assert taken(waited_ms * 1_000_000) == (index, index - 1)


def test_what_the_camera_takes_to_deliver_is_no_waiting() -> None:
    assert taken(60_000_000, latency_ms=20.0) == (1, 0)


def test_a_slow_camera_is_not_waited_for() -> None:
    assert taken(300_000_000, period_ns=500_000_000) == (1, 0)


def test_the_picture_at_hand_is_measured_if_the_next_does_not_come() -> None:
    assert taken(60_000_000, comes=False) == (1, 0)
