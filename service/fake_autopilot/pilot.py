"""A pilot at a ground station, who flies a vehicle over a MAVLink link of his own."""

from __future__ import annotations

import math
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.errors import LinkError
from service.fake_autopilot.ardupilot import ArduPilot
from service.fake_autopilot.parameters import ARDUPILOT_DEFAULTS, PX4_DEFAULTS
from service.fake_autopilot.px4 import Px4
from service.fake_autopilot.stick_messages import (
    TARGET_COMPONENT,
    body_velocity,
    manual_control,
    rc_override,
)
from uavdepth.errors import UavDepthError

STATION_SYSTEM, STATION_COMPONENT = 255, 190
HEARTBEAT_S = 1.0
REPEAT_S = 0.1
ACK_TIMEOUT_S = 10.0
TRY_AGAIN_S = 0.5
RECEIVE_BYTES = 65536


class PilotError(UavDepthError):
    """The vehicle refused, or did not do in time, what was asked; the text holds the autopilot's words."""


class Pilot:
    """A ground station with sticks, over `tcp:HOST:PORT` (connects) or `udpout:HOST:PORT`.

    Example:
        >>> with Pilot("tcp:127.0.0.1:5760") as pilot:
        ...     pilot.take_off(5.0)
        ...     pilot.fly_forward(3.0)

    Args:
        endpoint: where the autopilot listens.
        timeout_s: how long to wait for its first heartbeat.

    Raises:
        LinkError: an endpoint that cannot be read or reached, or no heartbeat in time.
    """

    def __init__(self, endpoint: str, timeout_s: float = 10.0) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=STATION_SYSTEM, srcComponent=STATION_COMPONENT)
        self._codec.robust_parsing = True
        self._socket = _connect(endpoint, timeout_s)
        self._heard = threading.Condition()
        self._sending = threading.Lock()
        self._stopping = threading.Event()
        self._acks: dict[int, int] = {}
        self._texts: deque[str] = deque(maxlen=8)
        self._heartbeat: Any = None
        self._height_m: float | None = None
        self._steady: Callable[[], list[Any]] = list
        self._system_id = 0
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)
        self._thread.start()
        try:
            self._wait(lambda: self._heartbeat is not None, timeout_s)
        except TimeoutError:
            self.close()
            raise LinkError(
                f"no heartbeat from an autopilot on {endpoint!r} within {timeout_s:g} s"
            ) from None

    @property
    def is_px4(self) -> bool:
        """Whether the autopilot is a PX4; otherwise it is taken for an ArduPilot."""
        return bool(self._heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4)

    @property
    def mode(self) -> str:
        """Flight mode by name, from the newest heartbeat."""
        number = self._heartbeat.custom_mode
        names = {value: name for name, value in self._modes.items()}
        return names.get(number, f"number {number}")

    @property
    def texts(self) -> tuple[str, ...]:
        """The newest STATUSTEXTs."""
        return tuple(self._texts)

    def set_parameter(self, name: str, value: float) -> None:
        """Change a floating-point parameter; not confirmed."""
        self._send(
            mavlink.MAVLink_param_set_message(
                self._system_id, TARGET_COMPONENT, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
            )
        )

    def set_mode(self, name: str) -> None:
        """Change the flight mode: GUIDED, LOITER, LAND ... or POSCTL, AUTO.LOITER, AUTO.LAND ...

        Raises:
            PilotError: unknown name, or the autopilot refuses.
        """
        if name not in self._modes:
            raise PilotError(f"unknown flight mode {name!r}: {', '.join(self._modes)}")
        number = self._modes[name]
        main, sub = (number >> 16 & 0xFF, number >> 24) if self.is_px4 else (number, 0)
        custom = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self._command(mavlink.MAV_CMD_DO_SET_MODE, custom, main, sub)

    def arm(self, timeout_s: float = 10.0) -> None:
        """Start the motors, asking again until the autopilot agrees.

        Raises:
            PilotError: it does not within `timeout_s`; the text holds its reason ("PRX1: No Data").
        """
        until_s = time.monotonic() + timeout_s
        while True:
            try:
                self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
                return
            except PilotError:
                if time.monotonic() + TRY_AGAIN_S > until_s:
                    raise
            self._stopping.wait(TRY_AGAIN_S)

    def take_off(self, height_m: float, timeout_s: float = 30.0) -> None:
        """Arm, climb to `height_m` above home and wait until the vehicle is there.

        Raises:
            PilotError: arming or the take-off is refused, or the height is not reached in time.
        """
        if self.is_px4:
            self.set_parameter("MIS_TAKEOFF_ALT", height_m)
        else:
            self.set_mode("GUIDED")
        self.arm(timeout_s)
        goal_m = math.nan if self.is_px4 else height_m
        self._command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, math.nan, 0, 0, goal_m)
        try:
            self._wait(lambda: (self._height_m or 0.0) > height_m - 0.3, timeout_s)
        except TimeoutError:
            raise PilotError(
                f"{height_m:g} m not reached within {timeout_s:g} s, height is {self._height_m} m"
                f"{self._words()}"
            ) from None

    def fly_forward(self, speed_mps: float, guided: bool = False) -> None:
        """Fly ahead at `speed_mps` until told otherwise, in a mode that looks after obstacles.

        ArduPilot: LOITER with the stick (for LOIT_SPEED_MS 5), or GUIDED velocity. PX4: Position mode with
        the stick.

        Raises:
            PilotError: the mode is refused, or the speed is more than the full stick.
        """
        if self.is_px4:
            share = _share(speed_mps, PX4_DEFAULTS["MPC_VEL_MANUAL"])
            self._steady = lambda: [manual_control(self._system_id, share)]
            self.set_mode("POSCTL")
        elif guided:
            self._steady = lambda: [body_velocity(self._system_id, speed_mps)]
            self.set_mode("GUIDED")
        else:
            share = _share(speed_mps, ARDUPILOT_DEFAULTS["LOIT_SPEED_MS"])
            self._steady = lambda: [rc_override(self._system_id, share)]
            self.set_mode("LOITER")

    def hover(self) -> None:
        """Centre the sticks and ask for no speed, in the mode that it is in."""
        if self.is_px4:
            self._steady = lambda: [manual_control(self._system_id, 0.0)]
        elif self.mode == "GUIDED":
            self._steady = lambda: [body_velocity(self._system_id, 0.0)]
        else:
            self._steady = lambda: [rc_override(self._system_id, 0.0)]

    def land(self) -> None:
        """Land here and disarm.

        Raises:
            PilotError: the autopilot refuses.
        """
        self._steady = list
        self.set_mode("AUTO.LAND" if self.is_px4 else "LAND")

    def close(self) -> None:
        """Let go of the sticks and close the link; may be called twice."""
        self._stopping.set()
        if self._thread is not threading.current_thread():
            self._thread.join()
        self._socket.close()

    def __enter__(self) -> Pilot:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def _modes(self) -> Mapping[str, int]:
        return Px4.modes if self.is_px4 else ArduPilot.modes

    def _command(self, command: int, *values: float) -> None:
        parameters = [*values, *[0.0] * (7 - len(values))]
        with self._heard:
            self._acks.pop(command, None)
        self._send(
            mavlink.MAVLink_command_long_message(self._system_id, TARGET_COMPONENT, command, 0, *parameters)
        )
        name = mavlink.enums["MAV_CMD"][command].name
        try:
            self._wait(lambda: command in self._acks, ACK_TIMEOUT_S)
        except TimeoutError:
            raise PilotError(f"{name} was not answered within {ACK_TIMEOUT_S:g} s") from None
        result = self._acks[command]
        if result != mavlink.MAV_RESULT_ACCEPTED:
            raise PilotError(f"{name} refused: {mavlink.enums['MAV_RESULT'][result].name}{self._words()}")

    def _words(self) -> str:
        return f" ({self._texts[-1]})" if self._texts else ""

    def _wait(self, is_so: Callable[[], bool], timeout_s: float) -> None:
        with self._heard:
            if not self._heard.wait_for(is_so, timeout_s):
                raise TimeoutError

    def _run(self) -> None:
        heartbeat_s = repeat_s = -math.inf
        while not self._stopping.is_set():
            now_s = time.monotonic()
            if now_s - heartbeat_s >= HEARTBEAT_S:
                heartbeat_s = now_s
                self._send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
            if now_s - repeat_s >= REPEAT_S and self._system_id:
                repeat_s = now_s
                for message in self._steady():
                    self._send(message)
            self._receive()

    def _receive(self) -> None:
        try:
            data = self._socket.recv(RECEIVE_BYTES)
        except TimeoutError:
            return
        except OSError:
            data = b""
        if not data:
            # The autopilot has hung up or is not there yet; nothing to do but wait to be closed.
            self._stopping.wait(REPEAT_S)
            return
        for message in self._codec.parse_buffer(data) or []:
            with self._heard:
                self._hear(message)
                self._heard.notify_all()

    def _hear(self, message: Any) -> None:
        if message.get_type() == "BAD_DATA" or message.get_srcComponent() != TARGET_COMPONENT:
            return
        kind = message.get_type()
        if kind == "HEARTBEAT" and message.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
            if self._heartbeat is None:
                self._system_id = message.get_srcSystem()
            self._heartbeat = message
        elif kind == "COMMAND_ACK":
            self._acks[message.command] = message.result
        elif kind == "STATUSTEXT":
            self._texts.append(str(message.text).rstrip("\0"))
        elif kind == "GLOBAL_POSITION_INT":
            self._height_m = message.relative_alt / 1000.0

    def _send(self, message: Any) -> None:
        with self._sending:
            packet = message.pack(self._codec)
            self._codec.seq = (self._codec.seq + 1) % 256
            try:
                self._socket.sendall(packet)
            except OSError:
                return  # the link is gone; whoever waits for an answer is told by its time-out


def _connect(endpoint: str, timeout_s: float) -> socket.socket:
    kind, _, rest = endpoint.partition(":")
    host, _, port = rest.rpartition(":")
    if kind not in ("tcp", "udpout") or not host or not port.isdecimal():
        raise LinkError(f"pilot's endpoint {endpoint!r} is none of tcp:HOST:PORT, udpout:HOST:PORT")
    try:
        if kind == "tcp":
            link = socket.create_connection((host, int(port)), timeout_s)
        else:
            link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect((host, int(port)))
    except OSError as error:
        raise LinkError(f"pilot cannot reach {endpoint!r}: {error.strerror or error}") from error
    link.settimeout(REPEAT_S / 4)
    return link


def _share(speed_mps: float, full_stick_mps: float) -> float:
    if not 0.0 <= speed_mps <= full_stick_mps:
        raise PilotError(
            f"speed {speed_mps:g} m/s is outside 0 to {full_stick_mps:g} m/s, which is the full stick"
        )
    return speed_mps / full_stick_mps
