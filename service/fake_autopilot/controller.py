"""What both flight controllers have in common: arming, modes, sticks, targets, the ground, and running into
things."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.parameters import Parameters
from service.fake_autopilot.vehicle import Demand, Multirotor
from service.fake_autopilot.world import FlatGround, World

VEHICLE_RADIUS_M = 0.35
"""Nearer than this to a surface the vehicle has hit it: half the motor-to-motor diagonal of a 450 mm frame
and its propellers."""

COLLISION_CHECK_S = 0.02
FASTEST_MPS = 20.0
"""Faster than any vehicle here flies, falling from 20 m too."""

FLOOR_CHECK_S = 0.05
CLIMB_GAIN_PER_S = 4.0
CLIMB_LIMIT_MPS2 = 4.0
SPEED_GAIN_PER_S = 4.0
SPEED_LIMIT_MPS2 = 5.0
HEIGHT_GAIN_PER_S = 1.0
TURN_GAIN_PER_S = 2.0
FASTEST_CLIMB_MPS = 2.5
FASTEST_TURN_RPS = math.radians(90.0)
LAND_MPS = 1.0
LANDED_BEFORE_DISARM_S = 1.0

Result = int
"""A MAV_RESULT."""


@dataclass(frozen=True)
class Sticks:
    """Pilot's sticks, each -1 to 1: forward, to the right, up, clockwise."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    yaw: float = 0.0


@dataclass(frozen=True)
class VelocityTarget:
    """A velocity to fly in NED, m/s, a rate of turn, and when it was asked for."""

    north_mps: float
    east_mps: float
    down_mps: float
    yaw_rate_rps: float
    at_s: float


class Controller(ABC):
    """A flight controller with its vehicle, stepped in time; no sockets, no clock.

    Args:
        world: what stands around; flat ground when None.
        parameters: the flavor's parameters, live.
        system_id: the vehicle's MAVLink id.
        position_ned_m, yaw_rad: where the vehicle stands at the start; the height is corrected to the ground.
    """

    autopilot: int
    """MAV_AUTOPILOT of the heartbeat."""

    version_word: int
    """AUTOPILOT_VERSION.flight_sw_version: major, minor, patch and kind of release, a byte each."""

    modes: Mapping[str, int]
    """custom_mode of each flight mode by name."""

    stick_expiry_s: float
    """Sticks older than this count as centred."""

    def __init__(
        self,
        world: World | None,
        parameters: Parameters,
        system_id: int,
        position_ned_m: tuple[float, float, float],
        yaw_rad: float,
        drag_per_s: float,
    ) -> None:
        self.world = world or FlatGround()
        self.parameters = parameters
        self.system_id = system_id
        north_m, east_m, _ = position_ned_m
        floor_m = -float(self.world.ground_height_m(north_m, east_m))
        self.vehicle = Multirotor((north_m, east_m, floor_m), yaw_rad, drag_per_s)
        self.home_down_m = floor_m
        self.armed = False
        self.collided = False
        self.mode = self.start_mode
        self.now_s = 0.0
        self.texts: deque[tuple[int, str]] = deque(maxlen=64)
        self.obstacle_messages = 0
        self.position_is_known = True
        self._sticks = Sticks()
        self._sticks_at_s = -math.inf
        self._velocity_target: VelocityTarget | None = None
        self._height_target_m: float | None = None
        self._collision_check_s = 0.0
        self._floor_check_s = 0.0
        self._landed_s = 0.0
        self._arrived_s: deque[float] = deque(maxlen=64)

    @property
    @abstractmethod
    def start_mode(self) -> str:
        """Flight mode after power-up."""

    @property
    @abstractmethod
    def nearest_obstacle_m(self) -> float | None:
        """Nearest thing that the obstacle messages told of, metres."""

    @property
    @abstractmethod
    def proximity_is_healthy(self) -> bool:
        """The proximity bit of SYS_STATUS."""

    @abstractmethod
    def arming_refusal(self) -> str | None:
        """Why the vehicle will not arm now, in the autopilot's words; None where it will."""

    @abstractmethod
    def take_obstacles(self, words: ObstacleWords) -> None:
        """An OBSTACLE_DISTANCE came in."""

    @abstractmethod
    def takeoff(self, height_m: float) -> Result:
        """NAV_TAKEOFF to a height above home, metres."""

    @abstractmethod
    def base_mode(self) -> int:
        """MAV_MODE_FLAG bits of the heartbeat, without the armed bit."""

    @abstractmethod
    def _demand(self, dt_s: float) -> Demand:
        """What the motors are asked for now, armed and off the ground or about to leave it."""

    @abstractmethod
    def _mode_entered(self) -> None:
        """A new mode begins."""

    @property
    def height_m(self) -> float:
        """Height above home in metres."""
        return self.home_down_m - self.vehicle.down_m

    @property
    def obstacle_rate_hz(self) -> float:
        """Rate of the obstacle messages of the last two seconds."""
        recent = [at_s for at_s in self._arrived_s if self.now_s - at_s <= 2.0]
        return (
            (len(recent) - 1) / (recent[-1] - recent[0])
            if len(recent) > 1 and recent[-1] > recent[0]
            else 0.0
        )

    def obstacles(self, words: ObstacleWords) -> None:
        """Count an OBSTACLE_DISTANCE and hand it to the model."""
        self.obstacle_messages += 1
        self._arrived_s.append(self.now_s)
        self.take_obstacles(words)

    def arm(self) -> Result:
        """Start the motors."""
        if self.armed:
            return int(mavlink.MAV_RESULT_ACCEPTED)
        if self.collided:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, "Arm: vehicle is broken")
            return int(mavlink.MAV_RESULT_FAILED)
        refusal = self.arming_refusal()
        if refusal is not None:
            self.say(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {refusal}")
            return int(mavlink.MAV_RESULT_FAILED)
        self.armed = True
        self._landed_s = 0.0
        self.home_down_m = self.vehicle.down_m
        self.say(mavlink.MAV_SEVERITY_INFO, "Arming motors")
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def disarm(self, force: bool = False) -> Result:
        """Stop the motors: on the ground, or anywhere when forced."""
        if not self.vehicle.landed and not force:
            return int(mavlink.MAV_RESULT_FAILED)
        if self.armed:
            self.armed = False
            self.say(mavlink.MAV_SEVERITY_INFO, "Disarming motors")
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def set_mode(self, name: str) -> Result:
        """Change the flight mode by name; a mode that is not modelled is refused with a text."""
        if name not in self.modes:
            self.say(mavlink.MAV_SEVERITY_WARNING, f"Mode {name} is not modelled")
            return int(mavlink.MAV_RESULT_DENIED)
        if name != self.mode:
            self.mode = name
            self._velocity_target = None
            self._height_target_m = None
        self._mode_entered()
        return int(mavlink.MAV_RESULT_ACCEPTED)

    def set_custom_mode(self, custom_mode: int) -> Result:
        """Change the flight mode by its number."""
        names = {number: name for name, number in self.modes.items()}
        return self.set_mode(names.get(custom_mode, f"number {custom_mode}"))

    def set_sticks(self, sticks: Sticks) -> None:
        """The pilot's sticks, fresh now."""
        self._sticks = sticks
        self._sticks_at_s = self.now_s

    def set_velocity(
        self, north_mps: float, east_mps: float, down_mps: float, yaw_rate_rps: float = 0.0
    ) -> None:
        """The companion's or ground station's velocity, fresh now."""
        self._velocity_target = VelocityTarget(north_mps, east_mps, down_mps, yaw_rate_rps, self.now_s)

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT."""
        self.texts.append((int(severity), text))

    def power_up(self) -> None:
        """Start again after a reboot: motors off, nothing remembered. A vehicle in the air falls."""
        self.armed = False
        self.mode = self.start_mode
        self._sticks_at_s = -math.inf
        self._velocity_target = None
        self._height_target_m = None

    def step(self, dt_s: float) -> None:
        """Fly for `dt_s` seconds."""
        self.now_s += dt_s
        self._look_at_ground()
        flying = self.armed and not self.collided
        self.vehicle.step(dt_s, self._demand(dt_s) if flying else None)
        self._look_for_collision()
        self._disarm_when_landed(dt_s)

    @property
    def sticks(self) -> Sticks:
        """The sticks as they act now: centred once they are too old."""
        fresh = self.now_s - self._sticks_at_s <= self.stick_expiry_s
        return self._sticks if fresh else Sticks()

    def demand_for_velocity(
        self,
        north_mps: float,
        east_mps: float,
        climb_mps: float,
        yaw_rate_rps: float = 0.0,
    ) -> Demand:
        """Accelerations that bring the vehicle to a velocity; drag is made up for, as an integrator would
        do."""
        vehicle = self.vehicle
        north = SPEED_GAIN_PER_S * (north_mps - vehicle.velocity_north_mps)
        east = SPEED_GAIN_PER_S * (east_mps - vehicle.velocity_east_mps)
        size = math.hypot(north, east)
        shrink = SPEED_LIMIT_MPS2 / size if size > SPEED_LIMIT_MPS2 else 1.0
        climb = CLIMB_GAIN_PER_S * (climb_mps + vehicle.velocity_down_mps)
        return Demand(
            north_mps2=north * shrink + vehicle.drag_per_s * vehicle.velocity_north_mps,
            east_mps2=east * shrink + vehicle.drag_per_s * vehicle.velocity_east_mps,
            climb_mps2=min(max(climb, -CLIMB_LIMIT_MPS2), CLIMB_LIMIT_MPS2),
            yaw_rate_rps=yaw_rate_rps,
        )

    def climb_towards(self, height_m: float) -> float:
        """Climb rate that brings the vehicle to a height above home."""
        return min(max(HEIGHT_GAIN_PER_S * (height_m - self.height_m), -FASTEST_CLIMB_MPS), FASTEST_CLIMB_MPS)

    def rangefinder_m(self) -> float:
        """What a rangefinder along the body's down axis reads, metres, +inf where there is nothing."""
        down = self.vehicle.attitude.ned_from_body[:, 2]
        return float(self.world.ray_distance_m(self.vehicle.position_ned_m, down)[0])

    def _look_at_ground(self) -> None:
        if self.now_s >= self._floor_check_s:
            self._floor_check_s = self.now_s + FLOOR_CHECK_S
            vehicle = self.vehicle
            vehicle.floor_down_m = -float(self.world.ground_height_m(vehicle.north_m, vehicle.east_m))

    def _look_for_collision(self) -> None:
        if self.collided or self.now_s < self._collision_check_s:
            return
        self._collision_check_s = self.now_s + COLLISION_CHECK_S
        vehicle = self.vehicle
        if vehicle.floor_down_m - vehicle.down_m <= VEHICLE_RADIUS_M + 0.05:
            return  # standing on, or about to touch, the ground: that is landing
        room_m = self.world.clearance_m(vehicle.position_ned_m) - VEHICLE_RADIUS_M
        # The search through a scene's triangles is dear, and nothing can be hit before the room is
        # flown through.
        self._collision_check_s = self.now_s + max(room_m / FASTEST_MPS, COLLISION_CHECK_S)
        if room_m < 0.0:
            self.collided = True
            self.armed = False
            vehicle.stop()
            self.say(mavlink.MAV_SEVERITY_EMERGENCY, "SIM collision: vehicle has hit something")

    def _disarm_when_landed(self, dt_s: float) -> None:
        landing = "LAND" in self.mode
        self._landed_s = self._landed_s + dt_s if self.vehicle.landed and landing else 0.0
        if self.armed and self._landed_s >= LANDED_BEFORE_DISARM_S:
            self.disarm()
