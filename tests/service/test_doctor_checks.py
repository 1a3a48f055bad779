"""What the doctor makes of what it saw (R14), without a vehicle."""

from __future__ import annotations

from dataclasses import replace

import pytest
from doctor_vehicles import COPTER, GOOD_RATES, PLAN, PX4, about, bad

from service.autopilot.byte_budget import bytes_per_s_of
from service.doctor.checks import examine
from service.doctor.finding import Finding, Level, has_failure
from service.doctor.observation import Observation, Probe


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


def test_only_failures_make_the_command_fail() -> None:
    def finding(level: Level) -> Finding:
        return Finding(level, "topic", "text")

    assert not has_failure([finding(Level.OK), finding(Level.NOTE), finding(Level.WARNING)])
    assert has_failure([finding(Level.OK), finding(Level.FAILURE)])


def test_an_autopilot_that_is_neither_is_told() -> None:
    seen = replace(COPTER, autopilot="generic", parameters={})
    assert about("autopilot", seen).level is Level.WARNING
