"""The speed that the doctor says is safe."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from doctor_vehicles import COPTER, PLAN, about, with_parameters

from service.doctor.finding import Level
from service.doctor.safe_speed import reaction_s, safe_speed_mps


class TestSafeSpeed:
    @pytest.mark.parametrize(("range_m", "speed_mps"), [(8.0, 3.3), (15.0, 5.0), (20.0, 5.9)])
    def test_it_gives_the_measured_speeds_for_a_margin_of_2_metres(
        self, range_m: float, speed_mps: float
    ) -> None:
        assert round(safe_speed_mps(range_m, 2.0, reaction_s(None, None)), 1) == speed_mps

    def test_the_vehicle_stands_at_the_margin_after_reaction_and_braking(self) -> None:
        speed = safe_speed_mps(12.0, 2.0, 0.7)
        assert 0.7 * speed + speed**2 / 2.0 == pytest.approx(10.0)

    def test_the_default_filter_is_as_bad_as_0_64_seconds_of_latency(self) -> None:
        lag_s = reaction_s(None, 0.25) - reaction_s(None, 0.0)
        assert lag_s == pytest.approx(0.64, abs=0.005)
        assert lag_s * 3.3 == pytest.approx(2.1, abs=0.05)  # metres read too long at 3.3 m/s, measured

    @pytest.mark.parametrize("margin_m", [20.0, 25.0, math.inf])
    def test_there_is_no_safe_speed_without_room(self, margin_m: float) -> None:
        assert safe_speed_mps(20.0, margin_m, 0.1) == 0.0

    def test_a_stick_that_allows_more_is_a_warning_with_the_speed_to_set(self) -> None:
        finding = about("safe speed", with_parameters(COPTER, LOIT_SPEED_MS=12.5))
        assert (finding.level, finding.parameter) == (Level.WARNING, "LOIT_SPEED_MS")
        assert finding.recommended is not None
        assert 5.0 < finding.recommended < 5.9

    def test_a_shorter_range_lowers_it(self) -> None:
        assert about("safe speed", COPTER, replace(PLAN, range_m=8.0)).level is Level.WARNING
