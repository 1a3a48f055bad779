"""What a measured latency asks of the autopilot's parameters."""

from __future__ import annotations

import pytest

from service.latency_advice import advise


@pytest.mark.parametrize(
    ("latency_ms", "cp_delay_s"), [(0.0, 0.3), (48.0, 0.35), (100.0, 0.4), (263.0, 0.56)]
)
def test_cp_delay_is_the_latency_and_0_3_s(latency_ms: float, cp_delay_s: float) -> None:
    assert advise(latency_ms, 20.0).cp_delay_s == pytest.approx(cp_delay_s)


def test_without_latency_two_metres_are_kept() -> None:
    assert advise(0.0, 20.0).margin_m == 2.0


def test_the_margin_grows_with_latency_and_with_the_speed_that_the_range_allows() -> None:
    margins = [advise(latency_ms, 20.0).margin_m for latency_ms in (0.0, 50.0, 100.0, 300.0)]
    assert margins == sorted(set(margins))
    assert advise(300.0, 40.0).margin_m > advise(300.0, 10.0).margin_m
    assert advise(100.0, 20.0).margin_m == pytest.approx(2.6, abs=0.1)
