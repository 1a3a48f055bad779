"""The fake autopilot as a running thing: real MAVLink over real sockets, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType

from service.fake_autopilot.autopilot import Flavor, SimulatedAutopilot, make_controller
from service.fake_autopilot.endpoint import Endpoint, open_endpoint
from service.fake_autopilot.faults import Fault, FaultKind, FaultPlan
from service.fake_autopilot.link import AutopilotLinks
from service.fake_autopilot.world import World
from uavdepth.attitude import Attitude

STEP_S = 0.005
MOST_CATCH_UP_S = 0.25
"""A thread that was held up for longer lets the rest of the time go instead of racing through it."""


@dataclass(frozen=True)
class Truth:
    """What is really the case in the simulation, at one moment.

    Args:
        time_s: seconds since the start.
        time_boot_s: the autopilot's own time since boot.
        position_ned_m, velocity_ned_mps, attitude: of the vehicle, without any error.
        mode: flight mode by name.
        armed, landed: motors run; the vehicle stands on the ground.
        collided: the vehicle has hit something, ever.
        nearest_m: nearest thing that the obstacle messages told of, None for nothing.
        obstacle_messages: OBSTACLE_DISTANCE received since the start.
        obstacle_rate_hz: their rate over the last two seconds.
        reboots: how often the autopilot has started again.
    """

    time_s: float
    time_boot_s: float
    position_ned_m: tuple[float, float, float]
    velocity_ned_mps: tuple[float, float, float]
    attitude: Attitude
    mode: str
    armed: bool
    landed: bool
    collided: bool
    nearest_m: float | None
    obstacle_messages: int
    obstacle_rate_hz: float
    reboots: int


class FakeAutopilot:
    """An ArduCopter or PX4 to fly a companion against.

    Example:
        >>> with FakeAutopilot("ardupilot", "tcp:127.0.0.1:0") as autopilot:
        ...     print(autopilot.address, autopilot.truth().mode)

    Args:
        flavor: "ardupilot" or "px4".
        endpoint: "tcp:HOST:PORT" or "udp:HOST:PORT" listen, "udpout:HOST:PORT" sends there; several make
        several links,
            and a TCP port takes several clients.
        scene: what stands around (`uavdepth.scenes.Scene`); flat ground when None.
        system_id: MAVLink system id.
        parameters: values to start with, by the autopilot's names.
        faults: what goes wrong and when.
        position_ned_m, yaw_rad: start; the height is the ground's.
        boot_s: how long ago the autopilot was started; 0 shows everything that a cold start does.
        mavlink1: speak MAVLink 1, where OBSTACLE_DISTANCE does not exist.

    Raises:
        ValueError: unknown flavor or impossible system id.
        UnknownParameterError: a parameter that the flavor does not have.
    """

    def __init__(
        self,
        flavor: Flavor,
        endpoint: str | Sequence[str],
        scene: World | None = None,
        system_id: int = 1,
        parameters: Mapping[str, float] | None = None,
        faults: Sequence[Fault] = (),
        position_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw_rad: float = 0.0,
        boot_s: float = 60.0,
        mavlink1: bool = False,
    ) -> None:
        self._endpoint_texts = [endpoint] if isinstance(endpoint, str) else list(endpoint)
        self._faults = FaultPlan(faults)
        self._mavlink1 = mavlink1
        controller = make_controller(flavor, scene, system_id, parameters, position_ned_m, yaw_rad)
        self._autopilot = SimulatedAutopilot(controller, boot_s)
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._links: AutopilotLinks | None = None
        self._now_s = 0.0
        self.addresses: tuple[str, ...] = ()

    @property
    def address(self) -> str:
        """The first endpoint as opened; TCP and UDP port 0 have become the port that the system chose."""
        return self.addresses[0]

    @property
    def is_running(self) -> bool:
        """Whether it flies."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Open the endpoints and begin to fly.

        Raises:
            LinkError: an endpoint that cannot be read or opened; none stays open then.
        """
        endpoints: list[Endpoint] = []
        with ExitStack() as opened:
            for text in self._endpoint_texts:
                endpoints.append(open_endpoint(text))
                opened.callback(endpoints[-1].close)
            opened.pop_all()
        self.addresses = tuple(endpoint.address for endpoint in endpoints)
        self._links = AutopilotLinks(self._autopilot, endpoints, self._faults, self._mavlink1)
        self._thread = threading.Thread(target=self._fly, name="fake-autopilot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the endpoints; may be called twice."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._links is not None:
            self._links.close()
            self._links = None

    def __enter__(self) -> FakeAutopilot:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def truth(self) -> Truth:
        """What is the case now; may be called from any thread."""
        with self._lock:
            controller = self._autopilot.controller
            return Truth(
                time_s=self._now_s,
                time_boot_s=self._autopilot.time_boot_s,
                position_ned_m=controller.vehicle.position_ned_m,
                velocity_ned_mps=controller.vehicle.velocity_ned_mps,
                attitude=controller.vehicle.attitude,
                mode=controller.mode,
                armed=controller.armed,
                landed=controller.vehicle.landed,
                collided=controller.collided,
                nearest_m=controller.nearest_obstacle_m,
                obstacle_messages=controller.obstacle_messages,
                obstacle_rate_hz=controller.obstacle_rate_hz,
                reboots=self._autopilot.reboots,
            )

    def inject(self, kind: FaultKind, value_s: float = 0.0) -> None:
        """Let a fault begin now.

        Raises:
            FaultError: a value that the kind cannot have.
        """
        with self._lock:
            self._faults.add(Fault(kind, self._now_s, value_s))

    def set_parameter(self, name: str, value: float) -> None:
        """Change a parameter from the side, as a ground station would.

        Raises:
            UnknownParameterError: the flavor does not have it.
        """
        with self._lock:
            self._autopilot.controller.parameters.set(name, value)

    def _fly(self) -> None:
        links = self._links
        begun_s = time.monotonic()
        behind_s = 0.0
        while links is not None and not self._stopping.is_set():
            with self._lock:
                behind_s = time.monotonic() - begun_s - self._now_s
                if behind_s > MOST_CATCH_UP_S:
                    begun_s += behind_s - MOST_CATCH_UP_S
                    behind_s = MOST_CATCH_UP_S
                while behind_s >= STEP_S:
                    self._now_s += STEP_S
                    behind_s -= STEP_S
                    self._begin_faults()
                    self._autopilot.step(STEP_S)
                links.exchange(self._now_s)
            self._stopping.wait(STEP_S)

    def _begin_faults(self) -> None:
        for fault in self._faults.starting(self._now_s):
            if fault.kind is FaultKind.REBOOT:
                self._autopilot.reboot()
            elif fault.kind is FaultKind.CLOCK:
                self._autopilot.step_clock(fault.value_s)
            elif fault.kind is FaultKind.STREAMS:
                self._autopilot.lose_streams()
