"""The doctor and docs/flight-modes.md say the same about flight modes (R16)."""

from __future__ import annotations

from pathlib import Path

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.doctor.flight_modes import FLIGHT_MODES, Effect, find_mode, modes_that_stop
from service.fake_autopilot.ardupilot import ArduPilot
from service.fake_autopilot.px4 import Px4

DOCUMENT = Path(__file__).parents[2] / "docs" / "flight-modes.md"


def document_rows() -> list[tuple[str, ...]]:
    """(autopilot, mode, effect, how, evidence, version) of each row."""
    rows: list[tuple[str, ...]] = []
    autopilot = ""
    for line in DOCUMENT.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            autopilot = "px4" if "PX4" in line else "ardupilot"
        cells = tuple(cell.strip() for cell in line.strip("|").split("|"))
        if line.startswith("|") and cells[0] != "mode" and not cells[0].startswith("---"):
            rows.append((autopilot, *cells))
    return rows


def test_r16_the_document_has_exactly_the_doctors_table() -> None:
    known = [
        (mode.autopilot, mode.name, mode.effect.value, mode.detail, mode.evidence.value, mode.version)
        for mode in FLIGHT_MODES
    ]
    assert document_rows() == known


@pytest.mark.parametrize(
    ("autopilot", "base", "custom", "effect"),
    [
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, ArduPilot.modes["LOITER"], Effect.STOPS),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, ArduPilot.modes["GUIDED"], Effect.PARTLY),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, ArduPilot.modes["ALT_HOLD"], Effect.LEANS),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, 3, Effect.NOTHING),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 1, 6, Effect.NOTHING),
        (mavlink.MAV_AUTOPILOT_PX4, 93, Px4.modes["POSCTL"], Effect.STOPS),
        (mavlink.MAV_AUTOPILOT_PX4, 29, Px4.modes["OFFBOARD"], Effect.NOTHING),
        (mavlink.MAV_AUTOPILOT_PX4, 29, Px4.modes["AUTO.LAND"], Effect.PARTLY),
        (mavlink.MAV_AUTOPILOT_PX4, 81, 2 << 16, Effect.NOTHING),
    ],
)
def test_the_modes_are_found_by_what_a_heartbeat_tells(
    autopilot: int, base: int, custom: int, effect: Effect
) -> None:
    heartbeat = mavlink.MAVLink_heartbeat_message(2, autopilot, base, custom, 4, 3)
    flavor = "px4" if autopilot == mavlink.MAV_AUTOPILOT_PX4 else "ardupilot"
    found = find_mode(flavor, mavutil.mode_string_v10(heartbeat))
    assert found is not None
    assert found.effect is effect


def test_a_mode_of_which_nothing_is_known_is_in_no_row() -> None:
    assert find_mode("ardupilot", "ACRO") is None
    assert find_mode("ardupilot", "POSCTL") is None


def test_the_modes_to_fly_in_are_named() -> None:
    assert modes_that_stop("ardupilot") == "LOITER or GUIDED"
    assert modes_that_stop("px4") == "Position"
