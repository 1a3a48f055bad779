"""What the fake autopilots say and hear in MAVLink, stepped without sockets."""

from __future__ import annotations

import math
import struct
from collections import Counter
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.autopilot import Flavor, SimulatedAutopilot, make_controller
from service.fake_autopilot.parameters import UnknownParameterError

STEP_S = 0.005


class Station:
    """A peer of a simulated autopilot: sends whole packets, keeps what it hears."""

    def __init__(self, autopilot: SimulatedAutopilot, component: int = 196) -> None:
        self.autopilot = autopilot
        self.channel = autopilot.open_channel()
        self.codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=component)
        self.passed_on: list[bytes] = []

    def send(self, message: Any) -> None:
        packet = message.pack(self.codec)
        (received,) = mavlink.MAVLink(None).parse_buffer(packet)
        self.autopilot.receive(self.channel, received)

    def command(self, command: int, *values: float, system: int = 1) -> None:
        self.send(
            mavlink.MAVLink_command_long_message(system, 1, command, 0, *values, *[0] * (7 - len(values)))
        )

    def hear(self, seconds: float = 0.0) -> list[Any]:
        """Let time pass and take everything that was said."""
        for _ in range(round(seconds / STEP_S)):
            self.autopilot.step(STEP_S)
        own, passed_on = self.autopilot.collect(self.channel)
        self.passed_on += passed_on
        return own

    def answer(self, kind: str) -> Any:
        (found,) = [message for message in self.hear() if message.get_type() == kind]
        return found

    def result(self, command: int, *values: float) -> int:
        self.command(command, *values)
        ack = self.answer("COMMAND_ACK")
        assert ack.command == command
        return int(ack.result)


def autopilot(flavor: Flavor = "ardupilot", boot_s: float = 60.0, **changes: Any) -> SimulatedAutopilot:
    return SimulatedAutopilot(make_controller(flavor, **changes), boot_s)


def obstacles(word: int = 500) -> Any:
    return mavlink.MAVLink_obstacle_distance_message(0, 4, [word] * 72, 5, 20, 2000, 5.0, -155.0, 12)


def kinds(messages: list[Any]) -> Counter[str]:
    return Counter(message.get_type() for message in messages)


class TestHeartbeat:
    def test_it_comes_at_once_and_then_every_second(self) -> None:
        station = Station(autopilot())
        assert kinds(station.hear(STEP_S))["HEARTBEAT"] == 1
        assert kinds(station.hear(10.0))["HEARTBEAT"] == 10

    @pytest.mark.parametrize(
        ("flavor", "number", "custom_mode"),
        [
            ("ardupilot", mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 0),
            ("px4", mavlink.MAV_AUTOPILOT_PX4, 0x3040000),
        ],
    )
    def test_it_tells_the_autopilot_and_the_mode(self, flavor: Flavor, number: int, custom_mode: int) -> None:
        said = Station(autopilot(flavor)).hear(STEP_S)
        (heartbeat,) = [message for message in said if message.get_type() == "HEARTBEAT"]
        assert (heartbeat.autopilot, heartbeat.custom_mode) == (number, custom_mode)
        assert heartbeat.system_status == mavlink.MAV_STATE_STANDBY

    @pytest.mark.parametrize("system_id", [0, 256])
    def test_a_system_id_that_does_not_exist_is_refused(self, system_id: int) -> None:
        with pytest.raises(ValueError, match="1 to 255"):
            make_controller("ardupilot", system_id=system_id)


class TestStreams:
    def test_they_are_slow_until_asked_for(self) -> None:
        heard = kinds(Station(autopilot()).hear(10.0))
        assert heard["ATTITUDE"] == pytest.approx(40, abs=2)
        assert heard["LOCAL_POSITION_NED"] == heard["DISTANCE_SENSOR"] == 0

    def test_an_interval_asked_for_is_kept(self) -> None:
        station = Station(autopilot())
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        assert station.result(interval, mavlink.MAVLINK_MSG_ID_ATTITUDE, 20000) == mavlink.MAV_RESULT_ACCEPTED
        assert kinds(station.hear(4.0))["ATTITUDE"] == pytest.approx(200, abs=2)
        station.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE)
        assert station.answer("MESSAGE_INTERVAL").interval_us == 20000
        station.command(interval, mavlink.MAVLINK_MSG_ID_ATTITUDE, -1)
        station.hear()
        assert kinds(station.hear(2.0))["ATTITUDE"] == 0

    def test_each_link_has_its_own(self) -> None:
        both = autopilot()
        one, other = Station(both), Station(both)
        one.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 20000)
        assert kinds(one.hear(2.0))["ATTITUDE"] > 90
        assert kinds(other.hear())["ATTITUDE"] < 12

    def test_ardupilot_denies_to_stream_obstacle_distance(self) -> None:
        obstacle_id = mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE
        ask = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        assert Station(autopilot()).result(ask, obstacle_id, 100000) == mavlink.MAV_RESULT_DENIED
        assert Station(autopilot("px4")).result(ask, obstacle_id, 100000) == mavlink.MAV_RESULT_ACCEPTED

    def test_one_message_can_be_asked_for(self) -> None:
        station = Station(autopilot())
        station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
        version = station.answer("AUTOPILOT_VERSION")
        assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
        assert station.answer("LOCAL_POSITION_NED").z == 0.0

    def test_an_unknown_command_is_answered_unsupported(self) -> None:
        assert Station(autopilot()).result(mavlink.MAV_CMD_DO_CHANGE_SPEED) == mavlink.MAV_RESULT_UNSUPPORTED

    def test_a_command_for_another_system_is_not_answered(self) -> None:
        station = Station(autopilot())
        station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, system=7)
        assert station.hear() == []


class TestTime:
    def test_a_time_request_is_answered_with_the_time_since_boot(self) -> None:
        station = Station(autopilot(boot_s=60.0))
        station.hear(1.0)
        station.send(mavlink.MAVLink_timesync_message(0, 123456789))
        answer = station.answer("TIMESYNC")
        assert answer.ts1 == 123456789
        assert answer.tc1 == pytest.approx(61.0e9, abs=1e7)

    def test_it_asks_for_the_time_itself_every_10_s_and_ignores_the_answers(self) -> None:
        station = Station(autopilot())
        asked = [m for m in station.hear(30.0) if m.get_type() == "TIMESYNC"]
        assert [m.tc1 for m in asked] == [0, 0, 0]
        station.send(mavlink.MAVLink_timesync_message(5, asked[0].ts1))
        assert station.hear() == []

    def test_a_clock_step_moves_time_since_boot_and_nothing_else(self) -> None:
        station = Station(autopilot())
        station.hear(1.0)
        station.autopilot.step_clock(-1.5)
        (attitude,) = [m for m in station.hear(0.25) if m.get_type() == "ATTITUDE"]
        assert 59500 < attitude.time_boot_ms <= 59750
        assert station.autopilot.reboots == 0


class TestReboot:
    def test_the_measured_course_of_a_reboot(self) -> None:
        station = Station(autopilot())
        station.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 20000)
        station.hear(1.0)
        reboot = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
        assert station.result(reboot, 1) == mavlink.MAV_RESULT_ACCEPTED
        station.hear(0.19)
        assert station.autopilot.link_is_up
        station.hear(0.03)
        assert not station.autopilot.link_is_up
        assert station.hear(0.4) == []
        station.hear(0.1)
        assert station.autopilot.link_is_up
        assert station.hear(0.6) == []
        heard = station.hear(1.1)
        assert kinds(heard)["HEARTBEAT"] >= 1
        assert kinds(heard)["ATTITUDE"] <= 6
        (newest, *_) = [m for m in reversed(heard) if m.get_type() == "ATTITUDE"]
        assert newest.time_boot_ms < 2500

    def test_requests_during_start_up_are_acknowledged_and_lost(self) -> None:
        station = Station(autopilot(boot_s=0.5))
        ask = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        assert station.result(ask, mavlink.MAVLINK_MSG_ID_ATTITUDE, 20000) == mavlink.MAV_RESULT_ACCEPTED
        assert kinds(station.hear(2.0))["ATTITUDE"] < 12
        assert station.result(ask, mavlink.MAVLINK_MSG_ID_ATTITUDE, 20000) == mavlink.MAV_RESULT_ACCEPTED
        assert kinds(station.hear(2.0))["ATTITUDE"] > 90

    def test_the_position_comes_41_8_s_after_boot(self) -> None:
        station = Station(autopilot(boot_s=41.0))
        ask = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        station.command(ask, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 33333)
        assert kinds(station.hear(0.7))["LOCAL_POSITION_NED"] == 0
        assert kinds(station.hear(0.5))["LOCAL_POSITION_NED"] > 5

    def test_nan_in_an_obstacle_message_makes_ardupilot_start_again(self) -> None:
        station = Station(autopilot())
        station.send(
            mavlink.MAVLink_obstacle_distance_message(0, 4, [500] * 72, 5, 20, 2000, math.nan, -155.0, 12)
        )
        texts = [m.text for m in station.hear(0.1) if m.get_type() == "STATUSTEXT"]
        assert "Floating point exception" in texts
        station.hear(2.0)
        assert station.autopilot.reboots == 1
        station.hear(5.0)
        assert station.autopilot.reboots == 1


class TestObstacles:
    def test_they_come_back_as_distance_sensors_beside_the_rangefinder(self) -> None:
        station = Station(autopilot())
        station.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, 50000)
        station.send(obstacles(500))
        heard = [m for m in station.hear(0.05) if m.get_type() == "DISTANCE_SENSOR"]
        found = {(m.orientation, m.id, m.type) for m in heard}
        downward = (mavlink.MAV_SENSOR_ROTATION_PITCH_270, 0, 4)
        assert found == {downward, *((face, 10 + face, 0) for face in range(8))}
        assert {m.current_distance for m in heard if m.id >= 10} == {500}

    def test_any_sender_is_taken_but_the_autopilots_own_id(self) -> None:
        for component, counted in ((196, 1), (0, 1), (1, 0)):
            station = Station(autopilot(), component)
            station.send(obstacles())
            assert station.autopilot.controller.obstacle_messages == counted

    def test_the_proximity_bit_tells_whether_data_come(self) -> None:
        station = Station(autopilot())
        bit = mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY

        def healthy() -> bool:
            station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
            return bool(station.answer("SYS_STATUS").onboard_control_sensors_health & bit)

        assert not healthy()
        station.send(obstacles(65535))
        assert healthy()
        station.hear(0.6)
        assert not healthy()

    def test_the_autopilot_passes_them_on_to_its_other_links_unchanged(self) -> None:
        both = autopilot()
        companion, ground = Station(both), Station(both, component=190)
        companion.send(obstacles())
        companion.hear()
        ground.hear()
        (packet,) = ground.passed_on
        (message,) = mavlink.MAVLink(None).parse_buffer(packet)
        assert (message.get_type(), message.get_srcComponent()) == ("OBSTACLE_DISTANCE", 196)
        assert companion.passed_on == []

    def test_px4_streams_its_fused_map_only_in_position_mode(self) -> None:
        station = Station(autopilot("px4", parameters={"CP_DIST": 5.0}))
        station.send(obstacles(300))
        assert kinds(station.hear(1.0))["OBSTACLE_DISTANCE"] == 0
        station.autopilot.controller.set_mode("POSCTL")
        station.send(obstacles(300))
        station.hear(0.1)
        station.send(obstacles(300))
        fused = [m for m in station.hear(0.2) if m.get_type() == "OBSTACLE_DISTANCE"][-1]
        assert (fused.increment, fused.increment_f, fused.angle_offset, fused.frame) == (0, 5.0, 0.0, 12)
        assert set(fused.distances) == {300}


class TestFlying:
    def test_ardupilot_arms_takes_off_and_flies_a_body_velocity(self) -> None:
        station = Station(autopilot(yaw_rad=math.pi / 2))
        station.send(obstacles(65535))
        station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4)
        station.hear()
        assert station.result(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        assert station.result(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 5) == mavlink.MAV_RESULT_ACCEPTED
        station.hear(8.0)
        mask = 0b0000_0101_1100_0111
        for _ in range(5):
            station.send(
                mavlink.MAVLink_set_position_target_local_ned_message(
                    0, 1, 1, mavlink.MAV_FRAME_BODY_NED, mask, 0, 0, 0, 2.0, 0, 0, 0, 0, 0, 0, 0
                )
            )
            station.hear(1.0)
        vehicle = station.autopilot.controller.vehicle
        assert vehicle.velocity_east_mps == pytest.approx(2.0, abs=0.1)
        assert abs(vehicle.north_m) < 0.1
        assert -vehicle.down_m == pytest.approx(5.0, abs=0.3)

    def test_rc_overrides_are_sticks_with_pitch_forward_below_the_middle(self) -> None:
        station = Station(autopilot())
        station.send(mavlink.MAVLink_rc_channels_override_message(1, 1, 1750, 1150, 1500, 0, 65535, 0, 0, 0))
        sticks = station.autopilot.controller.sticks
        assert sticks.forward == pytest.approx(320 / 470)
        assert sticks.right == pytest.approx(220 / 470)
        assert (sticks.up, sticks.yaw) == (0.0, 0.0)

    def test_manual_control_is_sticks_and_goes_stale(self) -> None:
        station = Station(autopilot("px4"))
        station.send(mavlink.MAVLink_manual_control_message(1, 700, -200, 500, 32767, 0))
        sticks = station.autopilot.controller.sticks
        assert (sticks.forward, sticks.right, sticks.up, sticks.yaw) == (0.7, -0.2, 0.0, 0.0)
        station.hear(0.6)
        assert station.autopilot.controller.sticks.forward == 0.0

    def test_px4_takes_off_to_an_altitude_above_sea_level(self) -> None:
        station = Station(autopilot("px4"))
        station.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        station.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, 0, 0, 584.0 + 6.0)
        station.hear(10.0)
        assert -station.autopilot.controller.vehicle.down_m == pytest.approx(6.0, abs=0.3)
        assert station.autopilot.controller.mode == "AUTO.LOITER"

    def test_a_mode_that_is_not_modelled_is_denied_with_a_text(self) -> None:
        station = Station(autopilot())
        station.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 3)
        text, ack = station.hear()
        assert text.text == "Mode number 3 is not modelled"
        assert ack.result == mavlink.MAV_RESULT_DENIED


class TestParameters:
    def test_the_list_is_complete_and_in_order(self) -> None:
        station = Station(autopilot())
        station.send(mavlink.MAVLink_param_request_list_message(1, 1))
        values = station.hear()
        assert [m.param_index for m in values] == list(range(values[0].param_count))
        assert {"PRX_FILT", "AVOID_MARGIN"} <= {m.param_id for m in values}

    def test_a_parameter_can_be_changed_and_read_by_name_and_by_index(self) -> None:
        station = Station(autopilot())
        station.send(mavlink.MAVLink_param_set_message(1, 1, b"PRX_FILT", 5.0, 9))
        changed = station.answer("PARAM_VALUE")
        assert (changed.param_id, changed.param_value) == ("PRX_FILT", 5.0)
        station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", changed.param_index))
        assert station.answer("PARAM_VALUE").param_value == 5.0

    def test_px4_sends_whole_numbers_byte_by_byte(self) -> None:
        station = Station(autopilot("px4"))
        wire = struct.unpack("<f", struct.pack("<i", 1))[0]
        station.send(mavlink.MAVLink_param_set_message(1, 1, b"CP_GO_NO_DATA", wire, 6))
        answer = station.answer("PARAM_VALUE")
        assert (answer.param_value, answer.param_type) == (wire, 6)
        assert station.autopilot.controller.parameters["CP_GO_NO_DATA"] == 1

    def test_an_unknown_parameter_gets_no_answer(self) -> None:
        station = Station(autopilot())
        station.send(mavlink.MAVLink_param_set_message(1, 1, b"NO_SUCH_THING", 5.0, 9))
        assert station.hear() == []

    def test_an_unknown_parameter_at_the_start_is_named(self) -> None:
        with pytest.raises(UnknownParameterError, match=r"'CP_DIST'.*PRX_FILT"):
            make_controller("ardupilot", parameters={"CP_DIST": 5.0})
