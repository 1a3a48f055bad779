"""How old data is, by the vehicle's stamps and the viewer's clock."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from service.freshness import ArrivalClock, Freshness

MS = 1_000_000
SECOND = 1_000_000_000
OFFSET_NS = 12_345 * SECOND
"""The vehicle's clock is anywhere."""


def test_live_stale_and_no_data_begin_at_one_and_three_seconds() -> None:
    ages = (0, SECOND, SECOND + 1, 3 * SECOND, 3 * SECOND + 1, None)
    states = ["live", "live", "stale", "stale", "no data", "no data"]
    assert [Freshness.of(age).value for age in ages] == states


def test_a_sample_that_comes_at_once_is_as_old_as_the_vehicle_says() -> None:
    clock = ArrivalClock()
    assert clock.hear(OFFSET_NS, 60.0, 7 * SECOND) == 60 * MS


def test_a_sample_that_waited_on_the_link_is_old_when_it_arrives() -> None:
    clock = ArrivalClock()
    for number in range(10):
        clock.hear(OFFSET_NS + number * 100 * MS, 50.0, number * 100 * MS + 55 * MS)
    captured_ns = OFFSET_NS + 1000 * MS
    assert clock.hear(captured_ns, 50.0, 1000 * MS + 55 * MS + 2 * SECOND) == 2 * SECOND + 50 * MS


def test_pictures_age_by_the_scans_clock_and_do_not_teach_it() -> None:
    clock = ArrivalClock()
    assert clock.age_ns(OFFSET_NS, 40.0, 0) == 40 * MS  # nothing better is known yet
    clock.hear(OFFSET_NS, 50.0, 55 * MS)
    assert clock.age_ns(OFFSET_NS, 50.0, 855 * MS) == 850 * MS
    assert clock.hear(OFFSET_NS + 100 * MS, 50.0, 155 * MS) == 50 * MS


def test_a_vehicle_whose_computer_started_anew_is_live_at_once() -> None:
    clock = ArrivalClock()
    clock.hear(900 * SECOND, 50.0, SECOND)
    assert clock.hear(5 * SECOND, 50.0, 2 * SECOND) == 50 * MS
    assert not clock.has_twins(2 * SECOND)


def test_two_vehicles_of_one_name_are_noticed() -> None:
    clock = ArrivalClock()
    for number in range(8):
        clock.hear((900 if number % 2 else 5) * SECOND + number * MS, 50.0, number * 100 * MS)
    assert clock.has_twins(SECOND)
    assert not clock.has_twins(60 * SECOND)


def test_a_slow_clock_drift_does_not_make_data_old_for_ever() -> None:
    clock = ArrivalClock()
    for minute in range(60):
        drift_ns = minute * 60 * 50_000  # 50 ppm
        age_ns = clock.hear(minute * 60 * SECOND - drift_ns, 0.0, minute * 60 * SECOND)
    assert age_ns < 35 * MS


@given(
    st.lists(
        st.tuples(st.integers(-(2**63), 2**63 - 1), st.floats(0, 1e9), st.integers(0, 10**12)), max_size=20
    )
)
def test_no_stamps_make_an_age_less_than_the_vehicle_says(samples: list[tuple[int, float, int]]) -> None:
    clock = ArrivalClock()
    now_ns = 0
    for captured_ns, age_ms, step_ns in samples:
        now_ns += step_ns
        assert clock.hear(captured_ns, age_ms, now_ns) >= round(age_ms * 1e6)
