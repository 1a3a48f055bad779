"""What the fake autopilots say and hear in MAVLink, stepped without sockets."""

from __future__ import annotations

import struct

import pytest
from fake_station import STEP_S, Station, autopilot, kinds, obstacles
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.autopilot import Flavor, make_controller
from service.fake_autopilot.parameters import UnknownParameterError


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
