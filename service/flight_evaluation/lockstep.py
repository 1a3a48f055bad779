"""The whole service against a fake autopilot in stepped time: same bytes, no sockets, no waiting.

The frame of an instant is measured and sent so much later as the latency says, however long that takes here:
two runs of one flight are the same to the bit.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.session import LinkSession
from service.fake_autopilot.autopilot import Flavor, SimulatedAutopilot, make_controller
from service.fake_autopilot.controller import Sticks
from service.fake_autopilot.faults import FaultPlan
from service.fake_autopilot.link import AutopilotLinks
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.parameters import ARDUPILOT_DEFAULTS, PX4_DEFAULTS
from service.flight_evaluation.configuration import FRAMES_PER_S, parameters_for
from service.flight_evaluation.memory_endpoint import MemoryEndpoint
from service.flight_evaluation.routes import Route
from service.flight_evaluation.sight import Camera, Eyes, Sight
from service.pipeline import PerceptionResult
from service.settings import Settings
from uavdepth.errors import UavDepthError
from uavdepth.scenes import Scene

STEP_S = 0.01
_CLIMB_S = 20.0
_ABOVE_M, _BELOW_M = 0.3, 0.1
"""The take-off goes for a little more than the route's height, and is left a little below it: a climb that
is asked for the height itself ends short of it."""

_BOOT_S = 60.0
_FULL_STICK_MPS: dict[Flavor, float] = {
    "ardupilot": ARDUPILOT_DEFAULTS["LOIT_SPEED_MS"],
    "px4": PX4_DEFAULTS["MPC_VEL_MANUAL"],
}
_MODE: dict[Flavor, str] = {"ardupilot": "LOITER", "px4": "POSCTL"}


class LockstepError(UavDepthError):
    """The simulated vehicle did not do what every flight begins with."""


@dataclass(frozen=True)
class _Captured:
    sight: Sight
    at_ns: int
    ready_s: float


class Lockstep:
    """One flight of one vehicle.

    Args:
        scene: the world.
        settings: the service's configuration.
        flavor: the autopilot.
        eyes: perception; None for a vehicle without the service.
        route: where it takes off and which way its nose points.
        latency_s: from the exposure of a frame to the moment its message leaves.
    """

    def __init__(
        self,
        scene: Scene,
        settings: Settings,
        flavor: Flavor,
        eyes: Eyes | None,
        route: Route,
        latency_s: float,
    ) -> None:
        self._flavor = flavor
        self._eyes = eyes
        self._latency_s = latency_s
        parameters = parameters_for(flavor)
        if eyes is None and flavor == "px4":
            parameters["CP_DIST"] = -1.0  # with Collision Prevention and without data it would not move
        self.controller = make_controller(
            flavor,
            scene,
            parameters=parameters,
            position_ned_m=(route.north_m, route.east_m, 0.0),
            yaw_rad=route.yaw_rad,
        )
        self._autopilot = SimulatedAutopilot(self.controller, boot_s=_BOOT_S)
        self._line = MemoryEndpoint()
        self._links = AutopilotLinks(self._autopilot, [self._line], FaultPlan())
        self._session = LinkSession(settings.autopilot)
        self._session.line_opened(0)
        self._camera: Camera | None = None
        if eyes is not None:
            self._camera = Camera(scene, settings.camera.model, settings.mount.mount, eyes.kind)
        self._waiting: deque[_Captured] = deque()
        self._next_frame_s = math.inf
        self._frames = 0
        self.last: PerceptionResult | None = None
        self.silent_frames = 0
        self.words: ObstacleWords | None = None
        """What the newest OBSTACLE_DISTANCE said, read back from its bytes."""
        self.messages = 0
        self._reader = mavlink.MAVLink(None)
        self._route = route

    @property
    def now_s(self) -> float:
        """Simulated time."""
        return self.controller.now_s

    def take_off(self) -> None:
        """Climb to the route's height and open the eyes.

        Raises:
            LockstepError: the vehicle does not arm or does not get there.
        """
        controller = self.controller
        if self._flavor == "ardupilot":
            controller.set_mode("GUIDED")
        if controller.arm() != 0 or controller.takeoff(self._route.height_m + _ABOVE_M) != 0:
            raise LockstepError(f"the fake {self._flavor} does not take off: {list(controller.texts)}")
        while controller.height_m < self._route.height_m - _BELOW_M:
            if controller.now_s > _CLIMB_S or controller.collided:
                raise LockstepError(
                    f"{self._route.height_m:.1f} m not reached within {_CLIMB_S:g} s: "
                    f"{controller.height_m:.1f} m"
                )
            self.step()
        controller.set_mode(_MODE[self._flavor])
        self._next_frame_s = controller.now_s

    def fly(self, forward_mps: float, yaw_share: float = 0.0) -> None:
        """Hold the sticks from now until the next call: forward as for a speed, yaw as a share of full."""
        self.controller.set_sticks(Sticks(forward=forward_mps / _FULL_STICK_MPS[self._flavor], yaw=yaw_share))

    def step(self) -> None:
        """Let one step of time pass."""
        self._see()
        now_ns = round(self.controller.now_s * 1e9)
        self._session.tick(now_ns)
        for data in self._session.take_output(now_ns):
            self._line.put(data)
            self._read_back(data)
        self._links.exchange(self.controller.now_s)
        self._autopilot.step(STEP_S)
        self._links.exchange(self.controller.now_s)
        arrival_ns = round(self.controller.now_s * 1e9)
        for data in self._line.take():
            self._session.receive(data, arrival_ns)

    def _read_back(self, data: bytes) -> None:
        for message in self._reader.parse_buffer(data) or []:
            if message.get_type() == "OBSTACLE_DISTANCE":
                self.words = ObstacleWords.from_message(message)
                self.messages += 1

    def _see(self) -> None:
        if self._camera is None:
            return
        now_s, vehicle = self.controller.now_s, self.controller.vehicle
        if now_s >= self._next_frame_s and not self.controller.collided:
            self._next_frame_s += 1.0 / FRAMES_PER_S
            sight = self._camera.look(np.array(vehicle.position_ned_m), vehicle.attitude)
            self._waiting.append(_Captured(sight, round(now_s * 1e9), now_s + self._latency_s))
        while self._waiting and self._waiting[0].ready_s <= now_s + 1e-9:
            self._measure(self._waiting.popleft(), round(now_s * 1e9))

    def _measure(self, captured: _Captured, now_ns: int) -> None:
        eyes = self._eyes
        if eyes is None:
            return
        frame = eyes.frame(captured.sight, captured.at_ns, self._frames)
        self._frames += 1
        result = eyes.perception.step_late(frame, lambda at_ns: self._session.telemetry_at(at_ns, now_ns))
        self.last = result
        if not result.trusted or not self._session.send_obstacles(result.scan, captured.at_ns, now_ns):
            self.silent_frames += 1
