"""The doctor beside both simulated autopilots, well and broken (R14)."""

from __future__ import annotations

import random
from typing import Any

import pytest
from doctor_bench import SETTINGS, Bench
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.doctor.finding import Level, has_failure
from service.doctor.observation import Probe
from service.doctor.parameter_names import PARAMETERS


class TestHealthy:
    def test_an_ardupilot_that_is_set_up_well_has_no_failure(self) -> None:
        bench = Bench(PRX_FILT=5.0)
        seen = bench.run(5.0)
        assert [f.topic for f in bench.findings().values() if f.level in (Level.WARNING, Level.FAILURE)] == []
        assert seen.rangefinder_hz == pytest.approx(20.0, abs=1.0)
        assert (seen.armed, seen.mode) == (False, "STABILIZE")
        assert set(seen.parameters) == set(PARAMETERS["ardupilot"])

    def test_a_px4_that_is_set_up_well_has_no_failure(self) -> None:
        bench = Bench("px4", CP_DIST=5.0, MPC_VEL_MANUAL=5.0)
        seen = bench.run(5.0)
        assert not has_failure(bench.findings().values())
        assert seen.parameters["MPC_POS_MODE"] == 4.0  # travels byte by byte, unlike ArduPilot's
        assert set(seen.parameters) == set(PARAMETERS["px4"])

    def test_px4_in_position_mode_shows_its_map(self) -> None:
        bench = Bench("px4", CP_DIST=5.0)
        bench.autopilot.controller.set_mode("POSCTL")
        assert bench.run(3.0).fused_map
        assert bench.findings()["echo"].level is Level.OK


class TestBroken:
    def test_r14_a_wrong_proximity_type(self) -> None:
        bench = Bench(PRX1_TYPE=4)
        bench.run(5.0)
        findings = bench.findings()
        assert (findings["PRX1_TYPE"].level, findings["PRX1_TYPE"].recommended) == (Level.FAILURE, 2.0)
        assert findings["echo"].level is Level.FAILURE

    def test_r14_the_default_filter(self) -> None:
        bench = Bench(PRX_FILT=0.25)
        bench.run(3.0)
        assert bench.findings()["PRX_FILT"].level is Level.WARNING

    def test_r14_collision_prevention_off(self) -> None:
        bench = Bench("px4", CP_DIST=-1.0)
        bench.run(3.0)
        assert bench.findings()["CP_DIST"].level is Level.FAILURE

    def test_r15_mavlink_1(self) -> None:
        bench = Bench(mavlink1=True)
        seen = bench.run(5.0)
        assert bench.findings()["MAVLink version"].level is Level.FAILURE
        assert seen.parameters["PRX1_TYPE"] == 2.0  # parameters are read all the same

    def test_another_system_id_on_px4(self) -> None:
        bench = Bench("px4", CP_DIST=5.0, MAV_SYS_ID=2)
        assert bench.run(3.0).system_id == 2
        assert bench.findings()["MAV_SYS_ID"].level is Level.WARNING

    def test_a_system_id_that_nobody_has(self) -> None:
        bench = Bench(settings=SETTINGS.model_copy(update={"system_id": 9}))
        seen = bench.run(3.0)
        assert (seen.autopilot, seen.other_system_ids) == (None, (1,))
        assert "system_id" in bench.findings()["heartbeat"].fix
        assert bench.sent.keys() == {"HEARTBEAT"}

    def test_a_signing_autopilot(self) -> None:
        bench = Bench(key=b"k" * 32, probe=False)
        assert bench.run(3.0).signed
        assert bench.findings()["signing"].level is Level.FAILURE

    def test_a_signing_autopilot_with_the_same_key_gets_signed_packets_only(self) -> None:
        bench = Bench(key=b"k" * 32, own_key=b"k" * 32)
        seen = bench.run(5.0)
        assert bench.findings()["signing"].level is Level.OK
        assert bench.unsigned == 0
        assert set(seen.parameters) == set(PARAMETERS["ardupilot"])
        assert seen.proximity_during

    @pytest.mark.parametrize(("theirs", "words"), [(None, "are not signed"), (b"x" * 32, "another key")])
    def test_a_key_that_does_not_fit_is_told_and_nothing_is_believed(
        self, theirs: bytes | None, words: str
    ) -> None:
        bench = Bench(key=theirs, own_key=b"k" * 32)
        seen = bench.run(4.0)
        assert (seen.autopilot, dict(seen.parameters)) == (None, {})
        finding = bench.findings()["heartbeat"]
        assert finding.level is Level.FAILURE
        assert words in finding.text

    def test_r10_a_clock_step(self) -> None:
        bench = Bench()
        bench.run(3.0)
        bench.autopilot.step_clock(1.0)
        bench.run(3.0)
        assert bench.findings()["clock"].level is Level.WARNING

    def test_no_rangefinder(self) -> None:
        bench = Bench(loses=lambda message: message.get_type() == "DISTANCE_SENSOR")
        bench.run(4.0)
        assert bench.findings()["rangefinder"].level is Level.WARNING

    def test_a_line_that_carries_nothing_to_the_autopilot(self) -> None:
        bench = Bench(loses=lambda message: message.get_srcComponent() == 196)
        bench.run(6.0)
        findings = bench.findings()
        assert findings["parameters"].level is Level.FAILURE
        assert "PRX1_TYPE" in findings["parameters"].text


class TestParameters:
    def test_lost_requests_and_answers_are_asked_again(self) -> None:
        generator = random.Random(5)

        def loses(message: Any) -> bool:
            return message.get_type().startswith("PARAM_") and generator.random() < 0.2

        bench = Bench(loses=loses)
        seen = bench.run(8.0)
        assert seen.unanswered == ()
        assert seen.parameters["AVOID_ENABLE"] == 7.0

    def test_one_that_does_not_exist_is_named_and_given_up(self) -> None:
        def loses(message: Any) -> bool:
            return message.get_type() == "PARAM_REQUEST_READ" and message.param_id == "OA_TYPE"

        bench = Bench(loses=loses)
        assert not bench.examination.is_done(bench.now_ns)
        assert bench.run(7.0).unanswered == ("OA_TYPE",)
        assert bench.examination.is_done(bench.now_ns)
        asked = bench.sent["PARAM_REQUEST_READ"]
        bench.run(3.0)
        assert bench.sent["PARAM_REQUEST_READ"] == asked

    def test_nothing_is_ever_set(self) -> None:
        bench = Bench(PRX1_TYPE=0, PRX_FILT=0.25)
        before = dict(bench.autopilot.controller.parameters)
        bench.run(6.0)
        assert dict(bench.autopilot.controller.parameters) == before
        assert bench.sent.keys() <= {
            "HEARTBEAT",
            "COMMAND_LONG",
            "TIMESYNC",
            "PARAM_REQUEST_READ",
            "OBSTACLE_DISTANCE",
        }
        assert bench.autopilot.controller.mode == "STABILIZE"


class TestProbe:
    def test_a_disarmed_ardupilot_gets_some_empty_messages_and_then_no_more(self) -> None:
        bench = Bench()
        assert bench.run(5.0).probe is Probe.SENT
        sent = bench.sent["OBSTACLE_DISTANCE"]
        assert 10 <= sent <= 20
        bench.run(3.0)
        assert bench.sent["OBSTACLE_DISTANCE"] == sent
        assert bench.autopilot.controller.nearest_obstacle_m is None

    def test_an_armed_vehicle_never_gets_one(self) -> None:
        for flavor in ("ardupilot", "px4"):
            bench = Bench("ardupilot", ARMING_SKIPCHK=-1) if flavor == "ardupilot" else Bench("px4")
            bench.autopilot.controller.arm()
            assert bench.autopilot.controller.armed
            seen = bench.run(6.0)
            assert seen.armed
            assert bench.sent["OBSTACLE_DISTANCE"] == 0

    def test_arming_ends_the_trial_with_the_next_heartbeat_for_good(self) -> None:
        bench = Bench(ARMING_SKIPCHK=-1)
        bench.run(1.5)
        assert bench.sent["OBSTACLE_DISTANCE"] > 0
        bench.autopilot.controller.arm()
        assert bench.run(1.02).armed
        sent = bench.sent["OBSTACLE_DISTANCE"]
        bench.run(1.0)
        bench.autopilot.controller.disarm(force=True)
        bench.run(4.0)
        assert bench.sent["OBSTACLE_DISTANCE"] == sent

    def test_a_silent_vehicle_gets_none(self) -> None:
        silent = False
        bench = Bench(loses=lambda message: silent and message.get_srcComponent() != 196)
        bench.run(0.5)
        silent = True
        bench.run(3.0)
        silent_count = bench.sent["OBSTACLE_DISTANCE"]
        bench.run(5.0)
        assert bench.sent["OBSTACLE_DISTANCE"] == silent_count
        assert silent_count <= 12  # those of the 1.6 s in which the last HEARTBEAT still counted

    def test_px4_gets_none_since_it_would_not_answer(self) -> None:
        bench = Bench("px4", CP_DIST=5.0)
        assert bench.run(4.0).probe is Probe.NO_ANSWER_EXPECTED
        assert bench.sent["OBSTACLE_DISTANCE"] == 0

    def test_it_can_be_forbidden(self) -> None:
        bench = Bench(probe=False)
        assert bench.run(4.0).probe is Probe.UNWANTED
        assert bench.sent["OBSTACLE_DISTANCE"] == 0

    def test_it_does_not_disturb_somebody_else_who_sends_obstacles(self) -> None:
        bench = Bench()
        other = bench.autopilot.open_channel()
        codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=195)
        message = mavlink.MAVLink_obstacle_distance_message(0, 4, [300] * 72, 5, 20, 2000, 5.0, -155.0, 12)
        for _ in range(40):
            (received,) = mavlink.MAVLink(None).parse_buffer(message.pack(codec))
            bench.autopilot.receive(other, received)
            seen = bench.run(0.1)
        assert seen.probe is Probe.OTHER_SENDER
        assert bench.sent["OBSTACLE_DISTANCE"] == 0
        assert seen.other_sender
        assert 0 in seen.echo_faces
        assert bench.findings()["echo"].level is Level.OK
