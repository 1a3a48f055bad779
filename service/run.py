"""The service: camera, perception, autopilot and ground station wired together."""

from __future__ import annotations

import threading
from collections.abc import Callable

import cv2
import structlog

from service.autopilot.link import AutopilotLink
from service.autopilot.service_state import ServiceState
from service.cameras.camera import Camera
from service.cameras.reader import CameraReader, CameraState
from service.cameras.source import make_camera
from service.clock import Clock, MonotonicClock
from service.frame import Frame
from service.fresh_frames import FreshFrames
from service.health import SEVERITY_WARNING
from service.hold_keeper import HoldKeeper
from service.latency_advice import Latency, advise_all
from service.latest_slot import LatestSlot
from service.link import Link
from service.monitor import Monitor
from service.pipeline import Perception, PerceptionResult
from service.progress import Progress
from service.publisher.publisher import ZenohPublisher
from service.recorder.recorder import Recorder
from service.settings import Settings
from service.side_cameras import SideCameras
from service.status import Drops, ServiceStatus, altitude_m, resident_memory_mib, speed_mps
from service.status_sample import status_sample
from service.subscribers import Subscribers
from service.thread_rank import switch_quickly
from service.trouble import Trouble
from uavdepth.errors import UavDepthError

log = structlog.get_logger()

_TAKE_S = 0.1
_JOIN_TIMEOUT_S = 3.0
_LAST_WORDS_S = 0.1
"""Several turns of the link's thread: time for the last STATUSTEXT to leave."""


class Service:
    """The program that flies; `start` and `stop` make it embeddable.

    Camera, perception, autopilot link and Zenoh each have a thread; between them are latest-only slots.
    A monitor judges what they do twenty times a second and tells the pilot. Subscribers, ground and record
    get each scan as of its picture's capture, with that stamp; the autopilot gets it turned and shortened by
    the motion up to the moment in which it reads the message.

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
        self._recorder: Recorder | None = None
        if settings.record.enabled:
            self._recorder = Recorder(settings, self._clock, self._model_card)
        if link is None:
            tap = None if self._recorder is None else self._recorder.offer_packets
            link = AutopilotLink(settings.autopilot, self._clock, tap)
        self._link: Link = link
        self._frames = FreshFrames(self._clock, settings.camera)
        if camera is None:
            camera = make_camera(
                settings.camera.source, settings.camera, self._clock, self._link, settings.mount.mount
            )
        self._reader = CameraReader(camera, self._frames.slot)
        record = None if self._recorder is None else self._recorder.offer
        self._sides = SideCameras(settings, self._clock, self._link, record=record)
        self._publisher: ZenohPublisher | None = None
        if settings.zenoh.enabled:
            self._publisher = ZenohPublisher(
                settings.zenoh, settings.vehicle.name, settings.camera.model, self._clock
            )
        self._load_perception = load_perception
        self._perception: Perception | None = None
        self._stopping = threading.Event()
        self._stopped = False
        self._subscribers = Subscribers()
        self._started_ns = self._clock.now_ns()
        self._progress = Progress(self._started_ns)
        self._thread = threading.Thread(target=self._perceive, name="perception", daemon=True)
        told = self._publisher is not None or self._recorder is not None
        self._monitor = Monitor(
            self._clock,
            self._link,
            self._reader,
            self._progress,
            self._sides,
            self._started_ns,
            self._tell_status if told else None,
            round(1e9 / settings.zenoh.status_rate_hz),
            HoldKeeper(self._link, self._sides.sights) if settings.autopilot.on_loss == "hold" else None,
        )

    def start(self) -> None:
        """Start everything; returns when the network is loaded, while the camera may still be opening.

        Raises:
            ConfigError: a network that cannot be used.
            LinkError: an autopilot endpoint that cannot be opened.
        """
        # OpenCV's own threads would take the cores from inference; what it has to say of cameras that
        # are not there, the reader says once and with the camera's name.
        cv2.setNumThreads(1)
        switch_quickly()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            self._link.start()
            self._link.set_state(ServiceState.BOOT)
            self._reader.start()
            if self._publisher is not None:
                self._publisher.start()
            self._perception = self._load_perception(self._settings)
            self._sides.start(self._perception)
            if self._recorder is not None:
                self._recorder.start()
        except UavDepthError:
            self.stop()
            raise
        log.info(
            "started",
            vehicle=self._settings.vehicle.name,
            camera=self._reader.camera_name,
            autopilot=self._settings.autopilot.endpoint,
            network=self._settings.model.path,
        )
        self._thread.start()
        self._monitor.start()

    def stop(self) -> None:
        """Stop everything, tell the pilot, let go of devices and ports. May be called twice."""
        if self._stopped:
            return
        self._stopped = True
        self._stopping.set()
        self._frames.close()
        self._reader.stop()
        self._sides.stop()
        self._monitor.stop()
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIMEOUT_S)
        if self._publisher is not None:
            self._publisher.close()
        if self._perception is not None:
            self._link.set_state(ServiceState.STANDBY)
            self._link.say(SEVERITY_WARNING, "uavdepth OFF: stopped")
            threading.Event().wait(_LAST_WORDS_S)
        self._link.close()
        if self._recorder is not None:
            self._recorder.stop()
        self._subscribers.close()

    @property
    def failure(self) -> UavDepthError | None:
        """Why the service can never work as configured, or None; a further camera's counts on the ground."""
        has_flown = self._progress.sent_ns is not None or self._link.status().armed is True
        return self._reader.failure or (None if has_flown else self._sides.failure)

    @property
    def ended(self) -> bool:
        """Whether the pictures of a file are over."""
        return self._reader.status.state is CameraState.ENDED

    @property
    def last_result(self) -> PerceptionResult | None:
        """What became of the newest measured picture."""
        return self._progress.result

    def subscribe(self) -> LatestSlot[PerceptionResult]:
        """A slot that gets every result from now on; a slow taker delays nobody. Close it to end."""
        return self._subscribers.add()

    def status(self) -> ServiceStatus:
        """The service now."""
        now_ns = self._clock.now_ns()
        link = self._link.status()
        progress, publisher = self._progress, self._publisher
        record = None if self._recorder is None else self._recorder.status()
        result, pose = progress.result, self._link.newest_pose()
        # The link tells when messages left; one that does not, when scans were taken.
        latency = progress.latency if link.obstacle_delay_ms is None else Latency(*link.obstacle_delay_ms)
        sides = self._sides.status(now_ns)
        latencies = (latency, *(side.latency for side in sides))
        return ServiceStatus(
            vehicle=self._settings.vehicle.name,
            uptime_s=(now_ns - self._started_ns) / 1e9,
            state=self._monitor.state,
            trouble=self._monitor.trouble,
            frames=progress.frames,
            frames_per_s=progress.frames_per_s(now_ns),
            step_ms=progress.step_ms,
            obstacle_messages=progress.messages,
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
            altitude_m=altitude_m(pose),
            speed_mps=speed_mps(pose),
            advice=advise_all(latencies, self._settings.scan.max_distance_m),
            sides=sides,
            recording=None if record is None else record.recording,
            recording_detail="" if record is None else record.problem,
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
        result = self._sides.added_to(perception.step_late(frame, self._link.telemetry_at))
        done_ns = self._clock.now_ns()
        if self._stands_ready(result):
            # "Unknown everywhere": ArduPilot refuses to arm before it has heard a proximity sensor.
            result = result.distrusted(Trouble.ON_GROUND)
            self._link.send_obstacles(result.scan, frame.captured_ns)
        max_age_ns = round(self._settings.autopilot.max_frame_age_s * 1e9)
        if result.trusted and done_ns - frame.captured_ns > max_age_ns:
            result = result.distrusted(Trouble.STALE_FRAME)
        if result.trusted and self._link.send_obstacles(result.scan, frame.captured_ns):
            sent_ns = self._clock.now_ns()
            self._progress.sent(frame.captured_ns, sent_ns)
            self._sides.sent(sent_ns)
        self._progress.measured(result, begun_ns, done_ns)
        if self._recorder is not None:
            self._recorder.offer(result, begun_ns, done_ns)
        self._hand_out(result)
        perception.look_ahead()
        remark = perception.remark(result)
        if remark is not None:
            self._link.say(SEVERITY_WARNING, remark)

    def _stands_ready(self, result: PerceptionResult) -> bool:
        """Whether all is well but the vehicle stands: disarmed, and too low or too still to tell the scale.

        In the air, and where nobody could tell the height after take-off, the same lack is silence.
        """
        if result.trouble is None or not result.trouble.is_lack_of_scale:
            return False
        by_ekf = self._settings.scale.height_source != "rangefinder"
        knows_height = by_ekf and result.telemetry.position_ned_m is not None
        knows_height = knows_height or self._link.status().rates_hz.get("DISTANCE_SENSOR", 0.0) > 0
        return result.telemetry.armed is False and knows_height

    def _model_card(self) -> str | None:
        card = None if self._perception is None else self._perception.model_card
        return None if card is None else card.to_json()

    def _tell_status(self) -> None:
        sample = status_sample(self.status())
        if self._publisher is not None:
            self._publisher.offer_status(sample)
        if self._recorder is not None:
            self._recorder.offer_status(sample.encode())

    def _hand_out(self, result: PerceptionResult) -> None:
        if self._publisher is not None:
            self._publisher.offer(result)
        self._subscribers.put(result)
