"""What the doctor makes of what it saw (R14), without a vehicle."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from service.autopilot.byte_budget import bytes_per_s_of
from service.doctor.checks import examine
from service.doctor.finding import Finding, Level, has_failure
from service.doctor.observation import Observation, Plan, Probe
from service.doctor.safe_speed import reaction_s, safe_speed_mps

PLAN = Plan(wanted_hz={"ATTITUDE": 50.0, "LOCAL_POSITION_NED": 30.0, "DISTANCE_SENSOR": 20.0}, latency_s=0.1)
GOOD_RATES = {"ATTITUDE": 49.4, "LOCAL_POSITION_NED": 28.7, "DISTANCE_SENSOR": 19.3}
COPTER = Observation(
    endpoint="serial:/dev/ttyAMA0:921600",
    bytes_received=30_000,
    autopilot="ardupilot",
    version=(4, 8, 0),
    system_id=1,
    mode="LOITER",
    armed=False,
    rates_hz=GOOD_RATES,
    rangefinder_hz=19.3,
    rangefinder_m=0.1,
    parameters={
        "PRX1_TYPE": 2,
        "PRX1_ORIENT": 0,
        "PRX1_YAW_CORR": 0,
        "PRX1_MIN": 0,
        "PRX1_MAX": 0,
        "PRX_IGN_GND": 0,
        "PRX_FILT": 5.0,
        "PRX_LOG_RAW": 1,
        "AVOID_ENABLE": 7,
        "AVOID_MARGIN": 2.0,
        "AVOID_BEHAVE": 1,
        "AVOID_DIST_MAX": 5.0,
        "OA_TYPE": 0,
        "GUID_OPTIONS": 0,
        "RNGFND1_TYPE": 100,
        "RNGFND1_ORIENT": 25,
        "LOIT_SPEED_MS": 5.0,
    },
    probe=Probe.SENT,
    proximity_before=False,
    proximity_during=True,
)
PX4 = replace(
    COPTER,
    autopilot="px4",
    version=(1, 18, 0),
    mode="POSCTL",
    parameters={
        "CP_DIST": 5.0,
        "CP_DELAY": 0.4,
        "CP_GO_NO_DATA": 0,
        "MPC_POS_MODE": 4,
        "MAV_SYS_ID": 1,
        "MPC_VEL_MANUAL": 5.0,
    },
    probe=Probe.NO_ANSWER_EXPECTED,
    proximity_before=True,
    proximity_during=None,
    fused_map=True,
)


def with_parameters(seen: Observation, **changes: float) -> Observation:
    return replace(seen, parameters={**seen.parameters, **changes})


def about(topic: str, seen: Observation, plan: Plan = PLAN) -> Finding:
    (found,) = [finding for finding in examine(seen, plan) if finding.topic == topic]
    return found


def bad(seen: Observation, plan: Plan = PLAN) -> list[str]:
    return [f.topic for f in examine(seen, plan) if f.level in (Level.WARNING, Level.FAILURE)]


@pytest.mark.parametrize("seen", [COPTER, PX4], ids=["ardupilot", "px4"])
def test_a_vehicle_that_is_set_up_well_has_nothing_wrong(seen: Observation) -> None:
    assert bad(seen) == []


def test_everything_that_is_bad_comes_with_a_fix() -> None:
    broken = [
        Observation("udp:0.0.0.0:14550"),
        replace(COPTER, parameters=dict.fromkeys(COPTER.parameters, 0.0), mavlink1=True, signed=True),
        replace(PX4, parameters=dict.fromkeys(PX4.parameters, 0.0), rates_hz={}, rangefinder_hz=0.0),
        replace(COPTER, parameters={}, unanswered=("PRX1_TYPE",), reboots=1, other_system_ids=(7,)),
        replace(COPTER, clock_steps=1, autopilot="generic", parameters={}),
        replace(COPTER, clock_steps=1, armed=True, mode="RTL", probe=Probe.ARMED, proximity_during=None),
    ]
    for seen in broken:
        findings = [f for f in examine(seen, PLAN) if f.level in (Level.WARNING, Level.FAILURE)]
        assert findings
        assert [f.text for f in findings if not f.fix] == []


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
    ("AVOID_MARGIN", 0.5, Level.WARNING, 2),
    ("AVOID_MARGIN", 20.0, Level.FAILURE, 2),
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


class TestNoHeartbeat:
    def test_r14_a_silent_line_names_the_endpoint_and_the_baud_rate(self) -> None:
        finding = about("heartbeat", Observation("serial:/dev/ttyAMA0:57600"))
        assert finding.level is Level.FAILURE
        assert "nothing at all came on serial:/dev/ttyAMA0:57600" in finding.text
        assert "baud rate is 57600" in finding.fix

    def test_a_line_that_cannot_be_opened_says_why(self) -> None:
        finding = about("heartbeat", Observation("tcp:127.0.0.1:5760", line_error="Connection refused"))
        assert finding.level is Level.FAILURE
        assert "Connection refused" in finding.text
        assert "listens on tcp:127.0.0.1:5760" in finding.fix

    def test_garbage_means_a_wrong_baud_rate(self) -> None:
        seen = Observation("serial:/dev/ttyAMA0:57600", bytes_received=1000, bad_bytes=900)
        assert "give the baud rate" in about("heartbeat", seen).fix

    def test_mavlink_without_an_autopilot_is_told_apart_from_silence(self) -> None:
        seen = Observation("udp:0.0.0.0:14550", bytes_received=1000)
        assert "no autopilot's HEARTBEAT" in about("heartbeat", seen).text

    def test_another_system_id_than_the_configured_one_is_named(self) -> None:
        seen = Observation("udp:0.0.0.0:14550", bytes_received=1000, other_system_ids=(7,))
        finding = about("heartbeat", seen, replace(PLAN, system_id=3))
        assert "system 3" in finding.text
        assert "7" in finding.text
        assert "system_id" in finding.fix

    def test_nothing_else_is_said_about_a_vehicle_that_was_not_heard(self) -> None:
        assert [f.topic for f in examine(Observation("udp:0.0.0.0:14550"), PLAN)] == ["heartbeat"]

    def test_a_line_that_is_lost_halfway_is_a_failure(self) -> None:
        finding = about("heartbeat", replace(COPTER, line_error="the other end has closed the connection"))
        assert finding.level is Level.FAILURE
        assert "the line was lost" in finding.text


class TestLink:
    def test_r15_mavlink_1_is_a_failure_with_the_parameters_that_end_it(self) -> None:
        finding = about("MAVLink version", replace(COPTER, mavlink1=True))
        assert finding.level is Level.FAILURE
        assert "SERIALn_PROTOCOL" in finding.fix
        assert "MAV_PROTO_VER" in finding.fix

    def test_signing_is_a_failure_unless_our_messages_get_through(self) -> None:
        unheard = replace(COPTER, signed=True, proximity_during=None)
        assert about("signing", unheard).level is Level.FAILURE
        assert about("signing", unheard, replace(PLAN, signs=True)).level is Level.OK
        assert about("signing", replace(COPTER, signed=True)).level is Level.OK

    @pytest.mark.parametrize(
        ("baud", "rate_hz", "level", "words"),
        [
            (9600, 15.0, Level.FAILURE, "carry 3.2 obstacle messages/s"),
            (38400, 15.0, Level.WARNING, "50 ms"),
            (57600, 15.0, Level.WARNING, "33 ms"),
            (57600, 30.0, Level.WARNING, "carry 23.2 obstacle messages/s of 30"),
            (115200, 15.0, Level.OK, "17 ms"),
            (921600, 30.0, Level.OK, "2 ms"),
        ],
    )
    def test_r22_the_line_is_held_against_the_bytes_to_send(
        self, baud: int, rate_hz: float, level: Level, words: str
    ) -> None:
        endpoint = f"serial:/dev/ttyAMA0:{baud}"
        plan = replace(PLAN, rate_hz=rate_hz, bytes_per_s=bytes_per_s_of(0, endpoint))
        finding = about("byte budget", replace(COPTER, endpoint=endpoint), plan)
        assert finding.level is level
        assert words in finding.text

    def test_r22_a_budget_for_a_network_counts_too(self) -> None:
        seen = replace(COPTER, endpoint="udp:0.0.0.0:14550")
        assert about("byte budget", seen, replace(PLAN, bytes_per_s=1000)).level is Level.FAILURE
        assert "byte budget" not in [finding.topic for finding in examine(seen, PLAN)]

    def test_r10_a_clock_that_jumps_is_told(self) -> None:
        assert about("clock", replace(COPTER, clock_steps=2)).level is Level.WARNING
        assert about("clock", replace(COPTER, reboots=1)).level is Level.WARNING


class TestStreams:
    def test_missing_attitude_is_a_failure_slow_attitude_a_warning(self) -> None:
        assert about("ATTITUDE", replace(COPTER, rates_hz={})).level is Level.FAILURE
        slow = replace(COPTER, rates_hz={**GOOD_RATES, "ATTITUDE": 4.0})
        assert about("ATTITUDE", slow).level is Level.WARNING

    def test_a_missing_position_says_to_wait_for_gps(self) -> None:
        finding = about("LOCAL_POSITION_NED", replace(COPTER, rates_hz={"ATTITUDE": 50.0}))
        assert finding.level is Level.WARNING
        assert "GPS" in finding.fix

    def test_the_echo_of_our_obstacles_is_no_rangefinder(self) -> None:
        echo_only = replace(COPTER, rangefinder_hz=0.0, rangefinder_m=None, echo_faces=frozenset({0, 7}))
        finding = about("rangefinder", echo_only)
        assert finding.level is Level.WARNING
        assert "orientation 25" in finding.text


class TestObstaclesArrive:
    def test_ignored_messages_are_a_failure(self) -> None:
        assert about("echo", replace(COPTER, proximity_during=False)).level is Level.FAILURE

    @pytest.mark.parametrize("probe", [Probe.ARMED, Probe.UNWANTED, Probe.OTHER_SENDER, Probe.NO_TIME])
    def test_what_was_not_tried_is_not_judged(self, probe: Probe) -> None:
        seen = replace(COPTER, probe=probe, proximity_during=None)
        assert about("echo", seen).level is Level.NOTE

    def test_obstacles_that_come_back_are_the_best_news(self) -> None:
        seen = replace(COPTER, echo_faces=frozenset({0, 1}), probe=Probe.ARMED, proximity_during=None)
        assert about("echo", seen).level is Level.OK

    def test_px4_shows_its_map_only_while_collision_prevention_runs(self) -> None:
        assert about("echo", PX4).level is Level.OK
        assert about("echo", replace(PX4, fused_map=False)).level is Level.NOTE


class TestMode:
    @pytest.mark.parametrize(
        ("mode", "armed", "level"),
        [
            ("LOITER", True, Level.OK),
            ("GUIDED", True, Level.NOTE),
            ("ALT_HOLD", True, Level.NOTE),
            ("RTL", False, Level.NOTE),
            ("RTL", True, Level.WARNING),
            ("ACRO", True, Level.WARNING),
        ],
    )
    def test_r16_a_mode_that_ignores_obstacles_is_told(self, mode: str, armed: bool, level: Level) -> None:
        assert about("flight mode", replace(COPTER, mode=mode, armed=armed)).level is level

    def test_what_the_autopilot_says_about_arming_is_passed_on(self) -> None:
        finding = about("arming", replace(COPTER, refusals=("PreArm: PRX1: No Data",)))
        assert "PRX1: No Data" in finding.text
        assert "uavdepth run" in finding.fix


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


def test_only_failures_make_the_command_fail() -> None:
    def finding(level: Level) -> Finding:
        return Finding(level, "topic", "text")

    assert not has_failure([finding(Level.OK), finding(Level.NOTE), finding(Level.WARNING)])
    assert has_failure([finding(Level.OK), finding(Level.FAILURE)])


def test_an_autopilot_that_is_neither_is_told() -> None:
    seen = replace(COPTER, autopilot="generic", parameters={})
    assert about("autopilot", seen).level is Level.WARNING
