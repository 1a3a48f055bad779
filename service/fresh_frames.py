"""The picture to measure next: the newest, or the one that is about to come."""

from __future__ import annotations

from service.clock import Clock
from service.frame import Frame
from service.latest_slot import LatestSlot
from service.settings.camera import CameraSettings

_LATE_SHARE = 0.2
"""Of the time between two pictures: a picture is waited for so much longer than it should take."""

_GIVES_WAY = 0.8
"""Of the time between two pictures. Where measuring takes longer than that time, giving way after half of it
costs up to half a step each time: 12.9 instead of 14.5 pictures/s, and 86 instead of 76 ms in the median
(`uavdepth benchmark`, two runs each in turns)."""

_LONGEST_PERIOD_NS = 200_000_000
"""A camera that is slower than this is not waited for: a picture at hand is worth more."""


class FreshFrames:
    """Takes pictures out of the camera's slot; one thread.

    Where measuring takes about as long as the camera from picture to picture, each picture would be measured
    when the next is about to come, and be sent that much later. So a picture that has waited for four fifths
    of that time gives way to the next.

    Args:
        clock: the service's, by which pictures are stamped.
        camera: the `[camera]` section.
    """

    def __init__(self, clock: Clock, camera: CameraSettings) -> None:
        self.slot: LatestSlot[Frame] = LatestSlot()
        """Where the camera puts its pictures."""
        self._clock = clock
        self._delivery_ns = round(camera.latency_ms * 1e6)
        self._last: Frame | None = None
        self._passed_over = 0

    @property
    def dropped_count(self) -> int:
        """Pictures that were never measured."""
        return self.slot.dropped_count + self._passed_over

    def close(self) -> None:
        """Wake the taker; nothing comes any more."""
        self.slot.close()

    def take(self, timeout_s: float) -> Frame | None:
        """The picture to measure, or None if none came within `timeout_s`."""
        frame = self.slot.take(timeout_s)
        if frame is None:
            return None
        patience_ns = self._patience_ns(frame)
        newer = self.slot.take(patience_ns / 1e9) if patience_ns > 0 else None
        if newer is not None:
            self._passed_over += 1
        self._last = newer or frame
        return self._last

    def _patience_ns(self, frame: Frame) -> int:
        """How long the next picture is worth waiting for; 0 where this one is to be measured at once."""
        last = self._last
        if last is None or frame.index <= last.index:
            return 0
        period_ns = (frame.captured_ns - last.captured_ns) // (frame.index - last.index)
        waited_ns = self._clock.now_ns() - frame.captured_ns - self._delivery_ns
        if period_ns > _LONGEST_PERIOD_NS or not _GIVES_WAY * period_ns < waited_ns < period_ns:
            return 0
        return period_ns - waited_ns + round(_LATE_SHARE * period_ns)
