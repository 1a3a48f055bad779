"""Time and reboots of the fake autopilots, stepped without sockets."""

from __future__ import annotations

import math

import pytest
from fake_station import Station, autopilot, kinds
from pymavlink.dialects.v20 import ardupilotmega as mavlink


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
