"""What the perception thread has done, for whoever judges or shows it."""

from __future__ import annotations

import threading
from collections import deque

import numpy as np

from service.autopilot.rate_meter import RateMeter
from service.latency_advice import Latency
from service.perception_result import PerceptionResult

_REMEMBERED_DELAYS = 450
"""Half a minute of messages at 15 Hz."""

_STEP_MEMORY = 0.9
"""Share of the old mean in the running mean of the step's time."""


class Progress:
    """Counts, rates and the newest result. Written by one thread, read by any.

    Args:
        started_ns: when the service started; rates look no further back.
    """

    def __init__(self, started_ns: int) -> None:
        self._lock = threading.Lock()
        self._started_ns = started_ns
        self._frame_meter = RateMeter()
        self._delays_ms: deque[float] = deque(maxlen=_REMEMBERED_DELAYS)
        self.frames = 0
        """Pictures measured."""
        self.messages = 0
        """Trusted scans that the autopilot link took."""
        self.step_ms: float | None = None
        """Running mean of one measurement's time, milliseconds."""
        self.result: PerceptionResult | None = None
        """What became of the newest picture."""
        self.result_ns: int | None = None
        """When that was."""
        self.sent_ns: int | None = None
        """When the link took a trusted scan last."""

    def measured(self, result: PerceptionResult, begun_ns: int, done_ns: int) -> None:
        """Note a picture that was measured from `begun_ns` to `done_ns`."""
        step_ms = (done_ns - begun_ns) / 1e6
        with self._lock:
            self._frame_meter.add(done_ns)
            self.frames += 1
            old_ms = step_ms if self.step_ms is None else self.step_ms
            self.step_ms = _STEP_MEMORY * old_ms + (1 - _STEP_MEMORY) * step_ms
            self.result, self.result_ns = result, done_ns

    def sent(self, captured_ns: int, at_ns: int) -> None:
        """Note that the scan of the picture captured at `captured_ns` left at `at_ns`."""
        with self._lock:
            self.messages += 1
            self.sent_ns = at_ns
            self._delays_ms.append((at_ns - captured_ns) / 1e6)

    def frames_per_s(self, now_ns: int) -> float:
        """Pictures measured a second, over the last two."""
        with self._lock:
            return self._frame_meter.per_second(now_ns, self._started_ns)

    @property
    def latency(self) -> Latency | None:
        """From capture to wire, over the last messages; None before the first."""
        with self._lock:
            delays_ms = list(self._delays_ms)
        if not delays_ms:
            return None
        p50, p95 = np.percentile(delays_ms, [50, 95])
        return Latency(float(p50), float(p95))
