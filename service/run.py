"""The service: camera, perception, autopilot and ground station wired together."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Protocol

import cv2
import structlog

from service.autopilot.link import AutopilotLink
from service.autopilot.link_status import LinkStatus
from service.autopilot.rate_meter import RateMeter
from service.autopilot.service_state import ServiceState
from service.cameras.camera import Camera
from service.cameras.reader import CameraReader, CameraState
from service.cameras.source import make_camera
from service.clock import Clock, MonotonicClock
from service.frame import Frame
from service.health import Announcer, Vitals, state_of, trouble_of
from service.latest_slot import LatestSlot
from service.pipeline import Perception, PerceptionResult
from service.publisher.publisher import ZenohPublisher
from service.settings import Settings
from service.status import Drops, LatencyMeter, ServiceStatus, resident_memory_mib
from service.status_sample import status_sample
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.errors import UavDepthError
from uavdepth.obstacle_scan import ObstacleScan

log = structlog.get_logger()

_TAKE_S = 0.1
_MONITOR_S = 0.05
_JOIN_TIMEOUT_S = 3.0
_LAST_WORDS_S = 0.1
"""Several turns of the link's thread: time for the last STATUSTEXT to leave."""

_STEP_MEMORY = 0.9
"""Share of the old mean in the running mean of the step's time."""


class Link(Protocol):
    """What the service needs of the autopilot link; every method returns at once."""

    def start(self) -> None: ...
    def telemetry_at(self, captured_ns: int) -> Telemetry: ...
    def newest_pose(self) -> Telemetry: ...
    def send_obstacles(self, scan: ObstacleScan, captured_ns: int) -> bool: ...
    def set_state(self, state: ServiceState) -> None: ...
    def say(self, severity: int, text: str) -> None: ...
    def status(self) -> LinkStatus: ...
    def close(self) -> None: ...


class Service:
    """The program that flies; `start` and `stop` make it embeddable.

    Camera, perception, autopilot link and Zenoh each have a thread; between them are latest-only slots.
    A monitor judges what they do twenty times a second and tells the pilot.

    Args:
        settings: the configuration.
        clock: the live clock, unless a test brings its own.
        link: the autopilot link; None makes the configured one.
        camera: the camera; None makes the configured one.
        load_perception: makes the chain of steps.

    Raises:
        ConfigError: a camera source that is not understood or does not exist.
    """

    def __init__(
        self,
        settings: Settings,
        clock: Clock | None = None,
        *,
        link: Link | None = None,
        camera: Camera | None = None,
        load_perception: Callable[[Settings], Perception] = Perception.load,
    ) -> None:
        self._settings = settings
        self._clock = MonotonicClock() if clock is None else clock
        self._link: Link = AutopilotLink(settings.autopilot, self._clock) if link is None else link
        self._frames: LatestSlot[Frame] = LatestSlot()
        if camera is None:
            camera = make_camera(
                settings.camera.source, settings.camera, self._clock, self._link, settings.mount.mount
            )
        self._reader = CameraReader(camera, self._frames)
        self._publisher: ZenohPublisher | None = None
        if settings.zenoh.enabled:
            self._publisher = ZenohPublisher(
                settings.zenoh, settings.vehicle.name, settings.camera.model, self._clock
            )
        self._load_perception = load_perception
        self._perception: Perception | None = None
        self._stopping = threading.Event()
        self._stopped = False
        self._threads: list[threading.Thread] = []
        self._subscribers: list[LatestSlot[PerceptionResult]] = []
        self._subscribers_lock = threading.Lock()
        self._last_result: PerceptionResult | None = None
        self._result_ns: int | None = None
        self._sent_ns: int | None = None
        self._was_armed: bool | None = None
        self._armed_ns: int | None = None
        self._started_ns = self._clock.now_ns()
        self._state = ServiceState.BOOT
        self._trouble: Trouble | None = Trouble.STARTING
        self._meters_lock = threading.Lock()
        self._frame_meter = RateMeter()
        self._latency = LatencyMeter()
        self._measured = 0
        self._sent = 0
        self._step_ms: float | None = None

    def start(self) -> None:
        """Start everything; returns when the network is loaded, while the camera may still be opening.

        Raises:
            ConfigError: a network that cannot be used.
            LinkError: an autopilot endpoint that cannot be opened.
        """
        # OpenCV's own threads would take the cores from inference; what it has to say of cameras that
        # are not there, the reader says once and with the camera's name.
        cv2.setNumThreads(1)
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        self._started_ns = self._clock.now_ns()
        try:
            self._link.start()
            self._link.set_state(ServiceState.BOOT)
            self._reader.start()
            if self._publisher is not None:
                self._publisher.start()
            self._perception = self._load_perception(self._settings)
        except UavDepthError:
            self.stop()
            raise
        for name, work in (("perception", self._perceive), ("monitor", self._watch)):
            thread = threading.Thread(target=work, name=name, daemon=True)
            thread.start()
            self._threads.append(thread)

    def stop(self) -> None:
        """Stop everything, tell the pilot, let go of devices and ports. May be called twice."""
        if self._stopped:
            return
        self._stopped = True
        self._stopping.set()
        self._frames.close()
        self._reader.stop()
        for thread in self._threads:
            thread.join(_JOIN_TIMEOUT_S)
        if self._publisher is not None:
            self._publisher.close()
        if self._threads:
            self._link.set_state(ServiceState.STANDBY)
            self._link.say(4, "uavdepth OFF: stopped")
            threading.Event().wait(_LAST_WORDS_S)
        self._link.close()
        with self._subscribers_lock:
            for slot in self._subscribers:
                slot.close()

    @property
    def failure(self) -> UavDepthError | None:
        """Why the service can never work as configured, or None."""
        return self._reader.failure

    @property
    def ended(self) -> bool:
        """Whether the pictures of a file are over."""
        return self._reader.status.state is CameraState.ENDED

    @property
    def last_result(self) -> PerceptionResult | None:
        """What became of the newest measured picture."""
        return self._last_result

    def subscribe(self) -> LatestSlot[PerceptionResult]:
        """A slot that gets every result from now on; a slow taker delays nobody. Close it to end."""
        slot: LatestSlot[PerceptionResult] = LatestSlot()
        with self._subscribers_lock:
            self._subscribers.append(slot)
        return slot

    def status(self) -> ServiceStatus:
        """The service now."""
        now_ns = self._clock.now_ns()
        link = self._link.status()
        result = self._last_result
        publisher = self._publisher
        with self._meters_lock:
            frames_per_s = self._frame_meter.per_second(now_ns, self._started_ns)
            latency = self._latency.latency
        return ServiceStatus(
            vehicle=self._settings.vehicle.name,
            uptime_s=(now_ns - self._started_ns) / 1e9,
            state=self._state,
            trouble=self._trouble,
            frames=self._measured,
            frames_per_s=frames_per_s,
            step_ms=self._step_ms,
            obstacle_messages=self._sent,
            obstacle_rate_hz=link.obstacle_rate_hz,
            latency=latency,
            drops=Drops(self._frames.dropped_count, 0 if publisher is None else publisher.dropped_count),
            model_failures=0 if self._perception is None else self._perception.model_failures,
            scale=None if result is None else result.scale,
            height_m=None if result is None else result.telemetry.height_m,
            mode=link.mode,
            armed=link.armed,
            camera=self._reader.status,
            link=link,
            publisher=None if publisher is None else publisher.status,
            memory_mib=resident_memory_mib(),
        )

    # -- the perception thread

    def _perceive(self) -> None:
        while not self._stopping.is_set():
            frame = self._frames.take(_TAKE_S)
            if frame is None or self._perception is None:
                continue
            try:
                self._handle(self._perception, frame)
            except Exception:
                # The next picture may pass; the monitor says that none does.
                log.exception("perception broke", frame=frame.index)

    def _handle(self, perception: Perception, frame: Frame) -> None:
        begun_ns = self._clock.now_ns()
        result = perception.step_late(frame, self._link.telemetry_at)
        done_ns = self._clock.now_ns()
        if self._stands_ready(result):
            # "Unknown everywhere": ArduPilot refuses to arm before it has heard a proximity sensor.
            result = result.distrusted(Trouble.ON_GROUND)
            self._link.send_obstacles(result.scan, frame.captured_ns)
        max_age_ns = round(self._settings.autopilot.max_frame_age_s * 1e9)
        if result.trusted and done_ns - frame.captured_ns > max_age_ns:
            result = result.distrusted(Trouble.STALE_FRAME)
        sent = result.trusted and self._link.send_obstacles(result.scan, frame.captured_ns)
        sent_ns = self._clock.now_ns()
        with self._meters_lock:
            self._frame_meter.add(done_ns)
            if sent:
                self._latency.add(sent_ns - frame.captured_ns)
        if sent:
            self._sent += 1
            self._sent_ns = sent_ns
        self._measured += 1
        step_ms = (done_ns - begun_ns) / 1e6
        old_ms = step_ms if self._step_ms is None else self._step_ms
        self._step_ms = _STEP_MEMORY * old_ms + (1 - _STEP_MEMORY) * step_ms
        self._last_result = result
        self._result_ns = done_ns
        self._hand_out(result)

    def _stands_ready(self, result: PerceptionResult) -> bool:
        """Whether all is well but the vehicle stands: disarmed, and too low to tell the scale.

        In the air, and where no rangefinder is heard, the same lack is a reason for silence.
        """
        if result.trouble not in (Trouble.NO_HEIGHT, Trouble.NO_GROUND):
            return False
        rangefinder_hz = self._link.status().rates_hz.get("DISTANCE_SENSOR", 0.0)
        return result.telemetry.armed is False and rangefinder_hz > 0

    def _hand_out(self, result: PerceptionResult) -> None:
        if self._publisher is not None:
            self._publisher.offer(result)
        with self._subscribers_lock:
            self._subscribers = [slot for slot in self._subscribers if not slot.closed]
            for slot in self._subscribers:
                slot.put(result)

    # -- the monitor thread

    def _watch(self) -> None:
        announcer = Announcer()
        status_period_ns = round(1e9 / self._settings.zenoh.status_rate_hz)
        status_due_ns = self._clock.now_ns()
        while not self._stopping.wait(_MONITOR_S):
            try:
                self._judge(announcer)
                if self._publisher is not None and self._clock.now_ns() >= status_due_ns:
                    status_due_ns = self._clock.now_ns() + status_period_ns
                    self._publisher.offer_status(status_sample(self.status()))
            except Exception:
                # The monitor must outlive whatever it monitors.
                log.exception("monitor broke")

    def _judge(self, announcer: Announcer) -> None:
        camera, link, result = self._reader.status, self._link.status(), self._last_result
        vitals = Vitals(
            now_ns=self._clock.now_ns(),
            started_ns=self._started_ns,
            camera=camera.state,
            link_connected=link.connected,
            armed=link.armed,
            frame_ns=camera.newest_ns,
            result_ns=self._result_ns,
            result_trouble=None if result is None else result.trouble,
            sent_ns=self._sent_ns,
            armed_ns=self._note_arming(link.armed),
        )
        self._trouble = trouble_of(vitals)
        self._state = state_of(self._trouble, vitals)
        self._link.set_state(self._state)
        words = announcer.hear(self._trouble, self._state, vitals.now_ns)
        if words is not None:
            self._link.say(words.severity, words.text)
            log.info(words.text, state=self._state.name, detail=_detail(result, camera.detail, link))

    def _note_arming(self, armed: bool | None) -> int | None:
        """When the vehicle was armed last; `armed` is what it is now."""
        if armed and self._was_armed is False:
            self._armed_ns = self._clock.now_ns()
        if armed is not None:
            self._was_armed = armed
        return self._armed_ns


def _detail(result: PerceptionResult | None, camera_detail: str, link: LinkStatus) -> str:
    parts = [camera_detail, link.problem or "", "" if result is None else result.detail]
    return "; ".join(part for part in parts if part)
