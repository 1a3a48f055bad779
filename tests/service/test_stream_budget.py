"""Pictures fit the link: a radio in simulated time, and what the ground reports of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from service.publisher.budget import PictureBudget
from service.publisher.pacer import Pacer
from service.publisher.picture_size import FRAME_S, Ladder, camera_ladder, depth_ladder
from service.publisher.received import ReceivedReport, ReceivedReporter
from service.publisher.wire import Stamp

MS = 1_000_000
DEPTH_BYTES, CAMERA_BYTES = 25_000, 40_000
"""A 640x320 depth PNG and JPEG as measured."""


@dataclass
class Radio:
    """A vehicle that sends depth and camera over a radio of a given rate, in steps of 5 ms."""

    bytes_per_s: float
    reports: bool = True
    jitter_ms: int = 0
    limit: float = 1e6
    now_ns: int = 0
    free_ns: int = 0
    delays_ms: list[float] = field(default_factory=list)
    arrived: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.budget = PictureBudget(self.limit)
        self.pacer = Pacer({"depth": 0.6, "camera": 0.4})
        self.ladders = {"depth": Ladder(depth_ladder()), "camera": Ladder(camera_ladder(75))}
        self.sizes = {"depth": DEPTH_BYTES, "camera": CAMERA_BYTES}
        self.due = {"depth": 0, "camera": 0}
        self.on_air: list[tuple[int, str, int, int]] = []
        self.back: list[tuple[int, bytes]] = []
        self.reporter = ReceivedReporter(lambda report: self.back.append((self.now_ns + 20 * MS, report)))
        self.index = 0
        self.rng = np.random.default_rng(0)

    def run(self, seconds: float) -> None:
        end_ns = self.now_ns + round(seconds * 1e9)
        while self.now_ns < end_ns:
            self.now_ns += 5 * MS
            self._arrive()
            self._send()

    def _send(self) -> None:
        for topic in ("depth", "camera"):
            if self.now_ns < self.due[topic] or not self.budget.has_room:
                continue
            if not self.pacer.allows(topic, self.now_ns):
                continue
            ladder = self.ladders[topic]
            size = round(self.sizes[topic] * ladder.step.relative_bytes)
            if not ladder.written(size, FRAME_S * self.budget.bytes_per_s, self.now_ns):
                continue
            self.index += 1
            self.due[topic] = self.now_ns + 66 * MS
            self.free_ns = max(self.free_ns, self.now_ns) + round(1e9 * size / self.bytes_per_s)
            late_ns = round(self.rng.exponential(self.jitter_ms) * MS) if self.jitter_ms else 0
            self.delays_ms.append((self.free_ns - self.now_ns) / MS)
            self.on_air.append((self.free_ns + 10 * MS + late_ns, topic, size, self.index))
            self.budget.sent(topic, self.index, size, self.now_ns)
            self.pacer.sent(topic, size, self.budget.bytes_per_s, self.now_ns)

    def _arrive(self) -> None:
        for item in [item for item in self.on_air if item[0] <= self.now_ns]:
            self.on_air.remove(item)
            self.arrived.append(item[2])
            if self.reports:
                stamp = Stamp(index=item[3], captured_ns=0, age_ms=0.0)
                self.reporter.hear(item[1], stamp, item[2], self.now_ns)
        for at_ns, report in [pair for pair in self.back if pair[0] <= self.now_ns]:
            self.back.remove((at_ns, report))
            more = any(not ladder.is_at_top for ladder in self.ladders.values())
            self.budget.hear(ReceivedReport.decode(report), self.now_ns, wants_more=more)
        self.budget.tick(self.now_ns)


@pytest.mark.parametrize("kbit_per_s", [300, 1000, 2000])
def test_a_slow_link_is_filled_well_and_never_for_long(kbit_per_s: float) -> None:
    radio = Radio(kbit_per_s * 125.0)
    radio.run(30.0)
    radio.delays_ms.clear()
    radio.arrived.clear()
    radio.run(60.0)
    assert np.percentile(radio.delays_ms, 95) < 250.0
    assert max(radio.delays_ms) < 1000.0
    assert sum(radio.arrived) / 60.0 > 0.25 * radio.bytes_per_s


@pytest.mark.parametrize(("jitter_ms", "seconds"), [(0, 4.0), (30, 8.0)])
def test_a_fast_link_gets_full_pictures_in_seconds_on_a_busy_processor_too(
    jitter_ms: int, seconds: float
) -> None:
    radio = Radio(10e6, limit=2e6, jitter_ms=jitter_ms)
    radio.run(seconds)
    assert radio.ladders["depth"].is_at_top
    assert radio.ladders["camera"].is_at_top


@pytest.mark.parametrize("kbit_per_s", [1000, 2000])
def test_the_first_viewer_on_a_slow_link_does_not_wait_for_what_a_fast_one_would_take(
    kbit_per_s: float,
) -> None:
    radio = Radio(kbit_per_s * 125.0)
    radio.run(10.0)
    assert max(radio.delays_ms) < 500.0


def test_a_link_that_gets_slower_is_noticed_within_seconds() -> None:
    radio = Radio(250_000.0)
    radio.run(40.0)
    radio.bytes_per_s = 50_000.0
    radio.run(6.0)
    radio.delays_ms.clear()
    radio.run(20.0)
    assert np.percentile(radio.delays_ms, 95) < 400.0


def test_viewers_that_never_report_get_what_the_configuration_allows() -> None:
    radio = Radio(10e6, reports=False, limit=400_000.0)
    radio.run(1.9)
    assert radio.budget.bytes_per_s < 100_000.0
    radio.run(1.0)
    assert radio.budget.bytes_per_s == 400_000.0


def test_reports_that_stop_shrink_the_pictures() -> None:
    radio = Radio(10e6, limit=400_000.0)
    radio.run(10.0)
    before = radio.budget.bytes_per_s
    radio.reports = False
    radio.run(5.0)
    assert radio.budget.bytes_per_s <= before / 4


def test_reports_about_pictures_that_were_never_sent_change_nothing() -> None:
    budget = PictureBudget(1e6)
    before = budget.bytes_per_s
    for index in range(100):
        budget.hear(
            ReceivedReport(
                index=index, captured_ns=0, age_ms=0.0, station=str(index), topic="depth",
                interval_ms=200.0, pictures=1, size_bytes=10**9,
            ),
            index * 200 * MS,
        )  # fmt: skip
    assert budget.bytes_per_s == before


def test_a_picture_too_large_is_not_sent_and_the_next_is_smaller() -> None:
    ladder = Ladder(depth_ladder())
    assert not ladder.written(25_000, 9_000.0, 0)
    assert ladder.step.divisor == 3
    assert ladder.written(3_900, 9_000.0, 1)


def test_pictures_of_both_kinds_share_the_budget() -> None:
    pacer, sent = Pacer({"depth": 0.6, "camera": 0.4}), {"depth": 0, "camera": 0}
    for now_ns in range(0, 10_000 * MS, 5 * MS):
        for topic in ("depth", "camera"):
            if pacer.allows(topic, now_ns):
                pacer.sent(topic, 1_000, 50_000.0, now_ns)
                sent[topic] += 1_000
    assert sum(sent.values()) <= 10 * 50_000 + 1_000
    assert sum(sent.values()) > 0.8 * 10 * 50_000
    assert sent["camera"] > 0.25 * sum(sent.values())
