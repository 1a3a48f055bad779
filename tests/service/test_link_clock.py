"""The autopilot's clock: unwrapping, reboots, bounds on the offset, round trips."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.boot_time import BootTime
from service.autopilot.clock_sync import ClockSync
from service.autopilot.timesync import RoundTrip, TimeSync

MS = 1_000_000
S = 1_000_000_000


def test_r24_boot_time_goes_on_through_the_wrap_of_32_bits() -> None:
    boot = BootTime()
    raw = 2**32 - 50
    stamps = [boot.unwrap((raw + step) % 2**32, step * MS) for step in range(0, 200, 20)]
    assert np.diff(stamps).tolist() == [20 * MS] * 9
    assert boot.reboots == 0


@pytest.mark.parametrize("uptime_ms", [47_000, 30 * 86_400_000, 2**32 - 60_000])
@pytest.mark.parametrize("away_ms", [20, 3_600, 5_000])
def test_a_stamp_that_begins_again_is_a_reboot(uptime_ms: int, away_ms: int) -> None:
    boot = BootTime()
    boot.unwrap(uptime_ms, 0)
    assert boot.unwrap(300, away_ms * MS) == 300 * MS
    assert boot.reboots == 1


def test_a_reordered_datagram_is_no_reboot() -> None:
    boot = BootTime()
    boot.unwrap(10_000, 0)
    assert boot.unwrap(9_920, 1 * MS) == 9_920 * MS
    assert boot.unwrap(10_020, 20 * MS) == 10_020 * MS
    assert boot.reboots == 0


def test_a_sensors_stamp_is_located_near_the_newest_only() -> None:
    boot = BootTime()
    assert boot.locate(100) is None
    boot.unwrap(2**32 - 10, 0)
    assert boot.locate(5) == (2**32 + 5) * MS
    assert boot.locate(2**32 - 300) == (2**32 - 300) * MS
    assert boot.locate(70_000) is None


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 10**10)), max_size=30))
def test_no_stamp_upsets_boot_time(stamps: list[tuple[int, int]]) -> None:
    boot, now_ns = BootTime(), 0
    for raw_ms, elapsed_ns in stamps:
        now_ns += elapsed_ns
        assert boot.unwrap(raw_ms, now_ns) >= 0


def arrivals(sync: ClockSync, offset_ns: int, delays_ns: list[int], start_ns: int = 100 * S) -> int:
    """Messages at 100 Hz, each held up as told; returns the time of the last arrival."""
    for i, delay_ns in enumerate(delays_ns):
        stamped_ns = start_ns + i * 10 * MS
        sync.on_arrival(stamped_ns - offset_ns, stamped_ns + delay_ns)
    return start_ns + len(delays_ns) * 10 * MS


def test_the_least_held_up_message_gives_the_offset() -> None:
    sync = ClockSync()
    rng = np.random.default_rng(1)
    arrivals(sync, 7 * S, [int(d) for d in rng.integers(1 * MS, 100 * MS, 1000)])
    assert sync.offset_ns == pytest.approx(7 * S, abs=8 * MS)
    assert sync.width_ns is None


@pytest.mark.parametrize("drift", [-100e-6, 100e-6, 0.016])
def test_the_offset_follows_a_clock_that_drifts(drift: float) -> None:
    """0.016 is what PX4's simulator did on a busy machine."""
    sync = ClockSync()
    for step in range(6000):
        now_ns = step * 10 * MS
        sync.on_arrival(round((now_ns - 1 * MS) * (1 - drift)), now_ns)
    true_ns = now_ns - round(now_ns * (1 - drift))
    assert sync.offset_ns == pytest.approx(true_ns, abs=25 * MS)
    assert sync.steps == 0


def test_a_stall_of_a_minute_does_not_make_old_messages_fresh() -> None:
    sync = ClockSync()
    now_ns = arrivals(sync, 7 * S, [2 * MS] * 500)
    before_ns = sync.offset_ns
    assert before_ns is not None
    for step in range(6000):  # one minute of messages, all arriving now
        sync.on_arrival(now_ns + step * 10 * MS - 7 * S, now_ns + 60 * S)
        assert sync.offset_ns is not None
        assert sync.offset_ns - before_ns < 5 * MS
    assert sync.steps == 0


def test_round_trips_bracket_the_offset() -> None:
    sync = ClockSync()
    now_ns = arrivals(sync, 7 * S, [5 * MS] * 100)
    assert not sync.is_synced(now_ns)
    sync.on_round_trip(now_ns, now_ns + 5 * MS - 7 * S, now_ns + 10 * MS)
    assert sync.offset_ns == pytest.approx(7 * S, abs=1 * MS)
    assert sync.is_synced(now_ns + 1 * S)
    assert not sync.is_synced(now_ns + 11 * S)


def test_a_slow_way_up_says_nothing() -> None:
    sync = ClockSync()
    now_ns = arrivals(sync, 7 * S, [2 * MS] * 100)
    sync.on_round_trip(now_ns, now_ns + 400 * MS - 7 * S, now_ns + 402 * MS)
    assert sync.offset_ns == pytest.approx(7 * S, abs=3 * MS)
    assert not sync.is_synced(now_ns)


def test_a_round_trip_shows_a_step_at_once() -> None:
    sync = ClockSync()
    now_ns = arrivals(sync, 7 * S, [2 * MS] * 100)
    assert sync.on_round_trip(now_ns, now_ns + 2 * MS - 8 * S, now_ns + 4 * MS)
    assert sync.offset_ns == pytest.approx(8 * S, abs=3 * MS)
    assert sync.steps == 1


def test_lateness_that_stays_is_a_step_after_three_seconds() -> None:
    sync = ClockSync()
    now_ns = arrivals(sync, 7 * S, [2 * MS] * 100)
    now_ns = arrivals(sync, 8 * S, [2 * MS] * 250, now_ns)
    assert sync.offset_ns == pytest.approx(7 * S, abs=100 * MS)
    arrivals(sync, 8 * S, [2 * MS] * 100, now_ns)
    assert sync.offset_ns == pytest.approx(8 * S, abs=5 * MS)
    assert sync.steps == 1


def test_lateness_is_no_step_while_round_trips_deny_it() -> None:
    sync = ClockSync()
    now_ns = arrivals(sync, 7 * S, [2 * MS] * 100)
    for _ in range(10):
        now_ns = arrivals(sync, 7 * S, [400 * MS] * 100, now_ns)
        sync.on_round_trip(now_ns, now_ns + 2 * MS - 7 * S, now_ns + 404 * MS)
    assert sync.steps == 0
    assert sync.offset_ns == pytest.approx(7 * S, abs=20 * MS)


@given(
    st.lists(
        st.tuples(
            st.booleans(), st.integers(0, 10**12), st.integers(0, 10**10), st.integers(-(10**9), 10**10)
        ),
        max_size=40,
    )
)
def test_nothing_upsets_the_bounds(events: list[tuple[bool, int, int, int]]) -> None:
    sync, now_ns = ClockSync(), 0
    for is_trip, boot_ns, elapsed_ns, trip_ns in events:
        now_ns += elapsed_ns
        if is_trip:
            sync.on_round_trip(now_ns - trip_ns, boot_ns, now_ns)
        else:
            sync.on_arrival(boot_ns, now_ns)
        assert sync.width_ns is None or sync.width_ns >= 0
        if sync.offset_ns is not None and not is_trip:
            assert sync.offset_ns <= now_ns


def test_only_answers_to_our_own_requests_count() -> None:
    sync = TimeSync(1 * S)
    request = sync.request(5 * S)
    assert request is not None
    assert (request.tc1, request.ts1) == (0, 5 * S)
    answer = mavlink.MAVLink_timesync_message(3 * S, 5 * S)
    foreign = mavlink.MAVLink_timesync_message(3 * S, 5 * S + 1)
    assert sync.round_trip(foreign, 5 * S + 4 * MS) is None
    assert sync.round_trip(answer, 5 * S + 4 * MS) == RoundTrip(5 * S, 3 * S, 5 * S + 4 * MS)
    assert sync.round_trip(answer, 5 * S + 9 * MS) is None, "a repeated answer is stale"


def test_the_first_requests_follow_quickly_then_one_a_second() -> None:
    sync = TimeSync(1 * S)
    sent = [t for t in range(0, 10 * S, 20 * MS) if sync.request(t) is not None]
    assert len([t for t in sent if t < 1 * S]) == 5
    assert np.diff([t for t in sent if t >= 1 * S]).max() <= 1.02 * S
    assert len(sent) == pytest.approx(14, abs=1)


def test_the_autopilots_request_is_answered_with_our_clock() -> None:
    request = mavlink.MAVLink_timesync_message(0, 123)
    answer = TimeSync.answer(request, 9 * S)
    assert answer is not None
    assert (answer.tc1, answer.ts1) == (9 * S, 123)
    assert TimeSync.answer(answer, 10 * S) is None
