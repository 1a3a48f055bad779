"""An ArduCopter, as far as obstacles concern it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.avoidance_ardupilot import limit_velocity
from service.fake_autopilot.controller import (
    FASTEST_CLIMB_MPS,
    FASTEST_TURN_RPS,
    LAND_MPS,
    Controller,
    Result,
)
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.parameters import ARDUPILOT_DEFAULTS, Parameters
from service.fake_autopilot.proximity_ardupilot import FaceBoundary, FaceEcho, NotFiniteWordsError
from service.fake_autopilot.vehicle import Demand
from service.fake_autopilot.world import World

PROXIMITY_MAVLINK = 2
AVOID_PROXIMITY_BIT = 2
SKIP_ALL_CHECKS = -1
TOO_NEAR_TO_ARM_M = 0.6
PREARM_TEXT_S = 30.0
VELOCITY_EXPIRY_S = 3.0
"""GUIDED stops this long after the last velocity target."""

LOITER_RISE_S = 1.2
"""The speed in LOITER nears the stick's with this time constant: fitted to the recorded start (0.95 m/s
after 0.5 s, 2.5 m/s after 1.7 s, 3.3 m/s in the end)."""

GUIDED_RISE_S = 0.5


class ArduPilot(Controller):
    """Modes STABILIZE (on the ground), ALT_HOLD, GUIDED, LOITER, LAND and BRAKE.

    Avoidance acts in LOITER and GUIDED. Loss of obstacle data frees the vehicle without a word, as measured.
    """

    autopilot = int(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    version_word = 0x04080000  # 4.8.0, development
    modes: Mapping[str, int] = MappingProxyType(
        {"STABILIZE": 0, "ALT_HOLD": 2, "GUIDED": 4, "LOITER": 5, "LAND": 9, "BRAKE": 17}
    )
    stick_expiry_s = 3.0

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
            parameters or Parameters(ARDUPILOT_DEFAULTS),
            system_id,
            position_ned_m,
            yaw_rad,
            drag_per_s=0.1,
        )
        self.faces = FaceBoundary()
        self.aborted = False
        self._shaped_mps = (0.0, 0.0)
        self._taking_off = False
        self._prearm_text_s = 0.0

    @property
    def start_mode(self) -> str:
        return "STABILIZE"

    @property
    def now_ms(self) -> int:
        """Whole milliseconds of the model's time."""
        return int(self.now_s * 1000.0 + 1e-6)

    @property
    def nearest_obstacle_m(self) -> float | None:
        return self.faces.nearest_m

    @property
    def uses_proximity(self) -> bool:
        """PRX1_TYPE is MAVLink."""
        return self.parameters["PRX1_TYPE"] == PROXIMITY_MAVLINK

    @property
    def proximity_is_healthy(self) -> bool:
        return self.uses_proximity and self.faces.is_healthy(self.now_ms)

    @property
    def echo(self) -> list[FaceEcho]:
        """The DISTANCE_SENSORs about the faces."""
        return self.faces.echo(self.now_ms)

    def base_mode(self) -> int:
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        flags |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        return int(flags | (mavlink.MAV_MODE_FLAG_GUIDED_ENABLED if self.mode in ("GUIDED", "LOITER") else 0))

    def arming_refusal(self) -> str | None:
        if self.parameters["ARMING_SKIPCHK"] == SKIP_ALL_CHECKS:
            return None
        if self.uses_proximity and not self.proximity_is_healthy:
            return "PRX1: No Data"
        nearest_m = self.faces.nearest_m
        if self.uses_proximity and nearest_m is not None and nearest_m < TOO_NEAR_TO_ARM_M:
            return f"PRX1: {nearest_m:.2f} m is nearer than {TOO_NEAR_TO_ARM_M} m"
        if not self.position_is_known:
            return "Need Position Estimate"
        return None

    def take_obstacles(self, words: ObstacleWords) -> None:
        if not self.uses_proximity:
            return
        self.faces.filter_hz = self.parameters["PRX_FILT"]
        self.faces.yaw_correction_deg = self.parameters["PRX1_YAW_CORR"]
        try:
            self.faces.update(words, self.now_ms)
        except NotFiniteWordsError as error:
            self.aborted = True
            self.say(mavlink.MAV_SEVERITY_EMERGENCY, "Floating point exception")
            self.say(mavlink.MAV_SEVERITY_EMERGENCY, str(error)[:50])

    def takeoff(self, height_m: float) -> Result:
        if self.mode != "GUIDED" or not self.armed or height_m <= 0.0:
            return int(mavlink.MAV_RESULT_FAILED)
        self._height_target_m = height_m
        self._taking_off = True
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def power_up(self) -> None:
        super().power_up()
        self.faces = FaceBoundary()
        self.aborted = False
        self._taking_off = False

    def step(self, dt_s: float) -> None:
        super().step(dt_s)
        self.faces.tick(self.now_ms)
        if not self.armed and self.now_s >= self._prearm_text_s:
            self._prearm_text_s = self.now_s + PREARM_TEXT_S
            refusal = self.arming_refusal()
            if refusal is not None:
                self.say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {refusal}")

    def _mode_entered(self) -> None:
        self._shaped_mps = self.vehicle.body_velocity_mps
        self._taking_off = False
        if self.mode != "LAND" and not self.vehicle.landed:
            self._height_target_m = self.height_m

    def _demand(self, dt_s: float) -> Demand:
        if self.mode == "LAND":
            return self.demand_for_velocity(0.0, 0.0, -LAND_MPS)
        if self.mode == "GUIDED":
            return self._guided(dt_s)
        if self.mode == "LOITER":
            speed = self.parameters["LOIT_SPEED_MS"]
            sticks = self.sticks
            return self._fly_limited(sticks.forward * speed, sticks.right * speed, self._stick_climb(), dt_s)
        if self.mode == "ALT_HOLD":
            return self._lean()
        return self.demand_for_velocity(0.0, 0.0, self._hold_height())

    def _guided(self, dt_s: float) -> Demand:
        target = self._velocity_target
        if self._taking_off and self._height_target_m is not None:
            if abs(self._height_target_m - self.height_m) < 0.2:
                self._taking_off = False
            return self.demand_for_velocity(0.0, 0.0, self.climb_towards(self._height_target_m))
        if target is None or self.now_s - target.at_s > VELOCITY_EXPIRY_S:
            return self._fly_limited(0.0, 0.0, self._hold_height(), dt_s, rise_s=GUIDED_RISE_S)
        cos_yaw, sin_yaw = math.cos(self.vehicle.yaw_rad), math.sin(self.vehicle.yaw_rad)
        forward = target.north_mps * cos_yaw + target.east_mps * sin_yaw
        right = -target.north_mps * sin_yaw + target.east_mps * cos_yaw
        climb = -target.down_mps
        if climb == 0.0:
            climb = self._hold_height()
        else:
            self._height_target_m = self.height_m
        return self._fly_limited(forward, right, climb, dt_s, target.yaw_rate_rps, GUIDED_RISE_S)

    def _fly_limited(
        self,
        forward_mps: float,
        right_mps: float,
        climb_mps: float,
        dt_s: float,
        yaw_rate_rps: float | None = None,
        rise_s: float = LOITER_RISE_S,
    ) -> Demand:
        """Shape the velocity wanted, let avoidance limit it, and fly what is left."""
        gain = min(dt_s / rise_s, 1.0)
        before = self._shaped_mps
        forward = before[0] + gain * (forward_mps - before[0])
        right = before[1] + gain * (right_mps - before[1])
        if self.uses_proximity and int(self.parameters["AVOID_ENABLE"]) & AVOID_PROXIMITY_BIT:
            forward, right = limit_velocity(
                forward,
                right,
                self.faces.filtered_faces_m,
                self.parameters["AVOID_MARGIN"],
                slide=self.parameters["AVOID_BEHAVE"] == 0,
                back_away_mps=self.parameters["AVOID_BACKUP_SPD"],
            )
        self._shaped_mps = (forward, right)
        turn = self.sticks.yaw * FASTEST_TURN_RPS if yaw_rate_rps is None else yaw_rate_rps
        return self.demand_for_velocity(*self.vehicle.to_north_east(forward, right), climb_mps, turn)

    def _lean(self) -> Demand:
        """ALT_HOLD: the stick is a lean angle, and nothing looks after obstacles."""
        lean = 0.5 * self.vehicle.max_tilt_rad
        sticks = self.sticks
        north, east = self.vehicle.to_north_east(
            9.81 * math.tan(sticks.forward * lean), 9.81 * math.tan(sticks.right * lean)
        )
        upright = self.demand_for_velocity(0.0, 0.0, self._stick_climb())
        return Demand(north, east, upright.climb_mps2, sticks.yaw * FASTEST_TURN_RPS)

    def _stick_climb(self) -> float:
        if self.sticks.up != 0.0 or self._height_target_m is None:
            self._height_target_m = self.height_m
            return self.sticks.up * FASTEST_CLIMB_MPS
        return self._hold_height()

    def _hold_height(self) -> float:
        if self._height_target_m is None:
            return 0.0 if not self.vehicle.landed else -LAND_MPS
        return self.climb_towards(self._height_target_m)
