"""What makes the fake autopilots fly, in MAVLink, stepped without sockets."""

from __future__ import annotations

import math

import pytest
from fake_station import Station, autopilot, obstacles
from pymavlink.dialects.v20 import ardupilotmega as mavlink


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
