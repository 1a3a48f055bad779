"""Recorded flights through rendered worlds: their scans are what they were when a person looked at them.

After a change that is meant to change scans: `uavdepth replay sitl_logs/flights --update`, and look at what
differs with `uavdepth replay sitl_logs/flights/NAME.mcap --check sitl_logs/flights --picture FILE.png`.
"""

from __future__ import annotations

import pytest
from link_support import LOGS

from service.replay.comparison import compare
from service.replay.flight_plans import FLIGHT_PLANS
from service.replay.golden import golden_scans, load_golden
from service.replay.open_footage import open_flight
from service.replay.player import play

FLIGHTS = LOGS / "flights"


@pytest.mark.parametrize("name", [plan.name for plan in FLIGHT_PLANS])
def test_a_recorded_flight_gives_its_golden_scans(name: str) -> None:
    flight = open_flight([FLIGHTS / f"{name}.mcap"], None, [])
    now = golden_scans(play(flight.settings, flight.footage))
    comparison = compare(load_golden(FLIGHTS / f"{name}.golden.json"), now)
    assert comparison.passed, "\n".join(comparison.lines())


def test_the_recorded_flights_are_small() -> None:
    files = list(FLIGHTS.iterdir())
    assert len([path for path in files if path.suffix == ".mcap"]) >= 6
    assert sum(path.stat().st_size for path in files) <= 40_000_000
