"""What the doctor makes of the autopilot's parameters (R14, R21)."""

from __future__ import annotations

from dataclasses import replace

import pytest
from doctor_vehicles import COPTER, PLAN, PX4, about, with_parameters

from service.doctor.checks import examine
from service.doctor.finding import Level


class TestParameters:
    def test_missing_ones_are_named(self) -> None:
        seen = replace(COPTER, unanswered=("LOIT_SPEED_MS", "PRX_LOG_RAW"))
        finding = about("parameters", seen)
        assert finding.level is Level.NOTE
        assert "LOIT_SPEED_MS, PRX_LOG_RAW" in finding.text

    def test_an_essential_one_that_is_missing_is_a_warning_and_never_ok(self) -> None:
        rest = {name: value for name, value in COPTER.parameters.items() if name != "PRX1_TYPE"}
        seen = replace(COPTER, parameters=rest, unanswered=("PRX1_TYPE",))
        assert about("parameters", seen).level is Level.WARNING
        assert "PRX1_TYPE" not in [finding.topic for finding in examine(seen, PLAN)]

    def test_no_answer_at_all_is_a_failure(self) -> None:
        assert about("parameters", replace(COPTER, parameters={}, unanswered=("PRX1_TYPE",))).level is (
            Level.FAILURE
        )


ARDUPILOT_RULES: list[tuple[str, float, Level, float | None]] = [
    ("PRX1_TYPE", 0, Level.FAILURE, 2),
    ("PRX1_TYPE", 4, Level.FAILURE, 2),
    ("PRX1_ORIENT", 1, Level.FAILURE, 0),
    ("PRX1_YAW_CORR", 22, Level.FAILURE, 0),
    ("PRX1_MIN", 0.6, Level.WARNING, 0),
    ("PRX1_MAX", 6.0, Level.WARNING, 0),
    ("PRX_IGN_GND", 1, Level.WARNING, 0),
    ("PRX_FILT", 0.25, Level.WARNING, 0),
    ("PRX_FILT", 0.0, Level.OK, 0),
    ("PRX_FILT", 8.0, Level.OK, 8),
    ("PRX_LOG_RAW", 0, Level.NOTE, 1),
    ("AVOID_ENABLE", 0, Level.FAILURE, 3),
    ("AVOID_ENABLE", 1, Level.FAILURE, 3),
    ("AVOID_ENABLE", 5, Level.FAILURE, 7),
    ("AVOID_ENABLE", 3, Level.OK, 3),
    ("AVOID_MARGIN", 0.5, Level.WARNING, 2.6),
    ("AVOID_MARGIN", 2.0, Level.NOTE, 2.6),  # fine but for the latency of 0.1 s
    ("AVOID_MARGIN", 2.7, Level.OK, 2.7),
    ("AVOID_MARGIN", 20.0, Level.FAILURE, 2.6),
    ("AVOID_BEHAVE", 0, Level.NOTE, 1),
    ("AVOID_DIST_MAX", 0, Level.NOTE, 5),
    ("OA_TYPE", 0, Level.NOTE, None),
    ("RNGFND1_ORIENT", 0, Level.WARNING, 25),
    ("RNGFND1_ORIENT", 25, Level.OK, 25),
]


@pytest.mark.parametrize(("name", "value", "level", "recommended"), ARDUPILOT_RULES)
def test_r14_ardupilots_parameters(name: str, value: float, level: Level, recommended: float | None) -> None:
    finding = about(name, with_parameters(COPTER, **{name: value}))
    assert (finding.level, finding.recommended, finding.value) == (level, recommended, value)


def test_bendy_ruler_leaves_guided_position_alone_without_its_option() -> None:
    finding = about("OA_TYPE", with_parameters(COPTER, OA_TYPE=1, GUID_OPTIONS=1))
    assert (finding.level, finding.parameter, finding.recommended) == (Level.WARNING, "GUID_OPTIONS", 65)


def test_r21_bendy_ruler_wants_the_3d_message() -> None:
    seen = with_parameters(COPTER, OA_TYPE=1, GUID_OPTIONS=64)
    assert about("OA_TYPE", seen).level is Level.WARNING
    assert "5 m too low" in about("OA_TYPE", seen).text
    assert about("OA_TYPE", seen, replace(PLAN, sends_3d=True)).level is Level.OK


PX4_RULES: list[tuple[str, float, Level, float | None]] = [
    ("CP_DIST", -1.0, Level.FAILURE, 3),
    ("CP_DIST", 0.0, Level.FAILURE, 3),
    ("CP_DIST", 1.5, Level.WARNING, 3),
    ("CP_DIST", 20.0, Level.FAILURE, 3),
    ("CP_DELAY", 0.2, Level.WARNING, 0.4),
    ("CP_DELAY", 0.3, Level.OK, 0.3),
    ("CP_DELAY", 0.5, Level.OK, 0.5),
    ("CP_DELAY", 1.0, Level.NOTE, 0.4),
    ("CP_GO_NO_DATA", 1, Level.NOTE, None),
    ("MAV_SYS_ID", 2, Level.WARNING, 1),
]


@pytest.mark.parametrize(("name", "value", "level", "recommended"), PX4_RULES)
def test_r14_px4s_parameters(name: str, value: float, level: Level, recommended: float | None) -> None:
    finding = about(name, with_parameters(PX4, **{name: value}))
    assert (finding.level, finding.recommended, finding.value) == (level, recommended, value)


@pytest.mark.parametrize(
    ("version", "value", "level", "recommended"),
    [
        ((1, 15, 4), 4, Level.FAILURE, 0),
        ((1, 15, 4), 0, Level.OK, 0),
        ((1, 14, 0), 4, Level.FAILURE, 0),
        ((1, 16, 0), 4, Level.WARNING, None),
        ((1, 18, 0), 4, Level.OK, 4),
        ((1, 18, 0), 0, Level.WARNING, 4),
        (None, 4, Level.WARNING, None),
    ],
)
def test_the_position_mode_that_is_right_depends_on_px4s_version(
    version: tuple[int, int, int] | None, value: float, level: Level, recommended: float | None
) -> None:
    finding = about("MPC_POS_MODE", with_parameters(replace(PX4, version=version), MPC_POS_MODE=value))
    assert (finding.level, finding.recommended) == (level, recommended)


def test_without_a_latency_the_delay_is_a_note_that_says_where_to_read_it() -> None:
    finding = about("CP_DELAY", PX4, replace(PLAN, latency_s=None))
    assert (finding.level, finding.recommended) == (Level.NOTE, None)
    assert "uavdepth watch" in finding.fix


def test_without_a_latency_two_metres_of_margin_are_enough() -> None:
    assert about("AVOID_MARGIN", COPTER, replace(PLAN, latency_s=None)).level is Level.OK
