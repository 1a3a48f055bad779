"""A PX4 quadrotor, as far as obstacles concern it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.collision_prevention_px4 import CollisionPrevention, Stick
from service.fake_autopilot.controller import (
    FASTEST_CLIMB_MPS,
    FASTEST_TURN_RPS,
    LAND_MPS,
    SPEED_GAIN_PER_S,
    Controller,
    Result,
)
from service.fake_autopilot.obstacle_map_px4 import UnsupportedFrameError
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.parameters import PX4_DEFAULTS, PX4_WHOLE, Parameters
from service.fake_autopilot.vehicle import Demand
from service.fake_autopilot.world import World

DRAG_PER_S = 0.40
"""Without acceleration the vehicle coasts 17 m from 6.3 m/s (measured)."""

CP_STEP_S = 0.02
OFFBOARD_EXPIRY_S = 1.0
HOLD_SYSTEM_ID = 1
"""Collision Prevention addresses its request for Hold to system 1, whatever the vehicle's own id is
(measured)."""


def _mode(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


class Px4(Controller):
    """Modes POSCTL, OFFBOARD and AUTO's LOITER (Hold), TAKEOFF and LAND.

    Collision Prevention acts in POSCTL only and fails to a stop. It needs MPC_POS_MODE 4, as on v1.18; other
    values are not modelled.
    """

    autopilot = int(mavlink.MAV_AUTOPILOT_PX4)
    version_word = 0x01120000  # 1.18.0, development
    modes: Mapping[str, int] = MappingProxyType(
        {
            "POSCTL": _mode(3),
            "OFFBOARD": _mode(6),
            "AUTO.TAKEOFF": _mode(4, 2),
            "AUTO.LOITER": _mode(4, 3),
            "AUTO.LAND": _mode(4, 6),
        }
    )
    stick_expiry_s = 0.5

    def __init__(
        self,
        world: World | None = None,
        parameters: Parameters | None = None,
        system_id: int = 1,
        position_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw_rad: float = 0.0,
    ) -> None:
        super().__init__(
            world,
            parameters or Parameters(PX4_DEFAULTS, PX4_WHOLE),
            system_id,
            position_ned_m,
            yaw_rad,
            DRAG_PER_S,
        )
        self.collision_prevention = CollisionPrevention(self.parameters)
        self._cp_step_s = 0.0
        self._acceleration = (0.0, 0.0)
        self._set_point_lost = False

    @property
    def start_mode(self) -> str:
        return "AUTO.LOITER"

    @property
    def nearest_obstacle_m(self) -> float | None:
        return self.collision_prevention.map.nearest_m

    @property
    def proximity_is_healthy(self) -> bool:
        """Set in every state: the bit belongs to the downward rangefinder (measured)."""
        return True

    @property
    def prevention_is_running(self) -> bool:
        """Whether Collision Prevention works now, and streams its map."""
        return self.mode == "POSCTL" and self.collision_prevention.is_on

    def base_mode(self) -> int:
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        own = mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if self.mode == "POSCTL" else 0
        return int(flags | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED | own)

    def arming_refusal(self) -> str | None:
        """PX4 does not ask for obstacle data (measured)."""
        return None if self.position_is_known else "No valid local position estimate"

    def take_obstacles(self, words: ObstacleWords) -> None:
        try:
            self.collision_prevention.map.update(words, self.now_s, math.degrees(self.vehicle.yaw_rad))
        except UnsupportedFrameError as error:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, str(error))

    def takeoff(self, height_m: float) -> Result:
        result = self.set_mode("AUTO.TAKEOFF")
        self._height_target_m = height_m
        return result

    def power_up(self) -> None:
        super().power_up()
        self.collision_prevention.enter(self.now_s)

    def step(self, dt_s: float) -> None:
        super().step(dt_s)
        if not self.prevention_is_running:
            return
        prevention = self.collision_prevention
        if prevention.wants_hold(self.now_s) and self.armed and self.system_id == HOLD_SYSTEM_ID:
            self.set_mode("AUTO.LOITER")

    def _mode_entered(self) -> None:
        if self.mode == "POSCTL":
            self.collision_prevention.enter(self.now_s)
            self._acceleration = (0.0, 0.0)
            self._set_point_lost = False
            self._cp_step_s = self.now_s
        if self.mode == "AUTO.TAKEOFF":
            self._height_target_m = self.parameters["MIS_TAKEOFF_ALT"]
        elif self.mode != "AUTO.LAND" and not self.vehicle.landed:
            self._height_target_m = self.height_m

    def _demand(self, dt_s: float) -> Demand:
        if self.mode == "AUTO.LAND":
            return self.demand_for_velocity(0.0, 0.0, -LAND_MPS)
        if self.mode == "AUTO.TAKEOFF":
            return self._take_off()
        if self.mode == "POSCTL":
            return self._position()
        target = self._velocity_target
        if self.mode == "OFFBOARD" and target is not None:
            if self.now_s - target.at_s > OFFBOARD_EXPIRY_S:
                self.set_mode("AUTO.LOITER")
            return self.demand_for_velocity(
                target.north_mps, target.east_mps, -target.down_mps, target.yaw_rate_rps
            )
        return self.demand_for_velocity(0.0, 0.0, self._hold_height())

    def _take_off(self) -> Demand:
        height_m = self._height_target_m or self.parameters["MIS_TAKEOFF_ALT"]
        if abs(height_m - self.height_m) < 0.2:
            self.set_mode("AUTO.LOITER")
        return self.demand_for_velocity(0.0, 0.0, self.climb_towards(height_m))

    def _position(self) -> Demand:
        """Position mode: the stick is an acceleration, less a share that grows with the speed."""
        sticks = self.sticks
        if sticks.up != 0.0 or self._height_target_m is None:
            self._height_target_m = self.height_m
            climb = sticks.up * FASTEST_CLIMB_MPS
        else:
            climb = self._hold_height()
        stick = Stick(sticks.forward, sticks.right)
        still = self.demand_for_velocity(0.0, 0.0, climb)
        if self.now_s >= self._cp_step_s:
            self._cp_step_s += CP_STEP_S
            self.collision_prevention.map.tick(self.now_s)
            allowed: tuple[float, float] | None = self._stick_acceleration(stick)
            if self.prevention_is_running and allowed is not None:
                allowed = self.collision_prevention.constrain(
                    allowed, self.vehicle.body_velocity_mps, stick, self.now_s
                )
            self._set_point_lost = allowed is None
            self._acceleration = self._jerk_limited(allowed or (0.0, 0.0))
        if self._set_point_lost:
            return Demand(still.north_mps2, still.east_mps2, still.climb_mps2, sticks.yaw * FASTEST_TURN_RPS)
        north, east = self.vehicle.to_north_east(*self._acceleration)
        return Demand(north, east, still.climb_mps2, sticks.yaw * FASTEST_TURN_RPS)

    def _jerk_limited(self, wanted: tuple[float, float]) -> tuple[float, float]:
        step = self.parameters["MPC_JERK_MAX"] * CP_STEP_S
        ahead, aside = (new - old for new, old in zip(wanted, self._acceleration, strict=True))
        size = math.hypot(ahead, aside)
        share = step / size if size > step else 1.0
        return self._acceleration[0] + ahead * share, self._acceleration[1] + aside * share

    def _stick_acceleration(self, stick: Stick) -> tuple[float, float]:
        hardest = self.parameters["MPC_ACC_HOR"]
        forward_mps, right_mps = self.vehicle.body_velocity_mps
        if not stick.is_deflected:
            forward, right = -SPEED_GAIN_PER_S * forward_mps, -SPEED_GAIN_PER_S * right_mps
            size = math.hypot(forward, right)
            shrink = hardest / size if size > hardest else 1.0
            return forward * shrink, right * shrink
        share = hardest / self.parameters["MPC_VEL_MANUAL"] - self.vehicle.drag_per_s
        return stick.forward * hardest - share * forward_mps, stick.right * hardest - share * right_mps

    def _hold_height(self) -> float:
        if self._height_target_m is None:
            return 0.0 if not self.vehicle.landed else -LAND_MPS
        return self.climb_towards(self._height_target_m)
