"""The monitor: it judges what the other threads do, twenty times a second, and tells the pilot."""

from __future__ import annotations

import threading
from collections.abc import Callable

import structlog

from service.autopilot.service_state import ServiceState
from service.cameras.reader import CameraReader
from service.clock import Clock
from service.health import Announcer, Vitals, state_of, trouble_of
from service.hold_keeper import HoldKeeper
from service.link import Link
from service.progress import Progress
from service.side_cameras import SideCameras
from service.trouble import Trouble

log = structlog.get_logger()

_PERIOD_S = 0.05
_JOIN_TIMEOUT_S = 2.0


class Monitor:
    """Judges and tells in a thread of its own, which nothing else can hold up.

    Args:
        clock: the service's.
        link: the autopilot link.
        reader: the camera.
        progress: what perception has done.
        sides: the further cameras.
        started_ns: when the service started.
        publish: hands the status to the ground station; None if nobody listens.
        publish_period_ns: how often.
        holds: asks the vehicle to hold when perception is lost; None where only the pilot is told.
    """

    def __init__(
        self,
        clock: Clock,
        link: Link,
        reader: CameraReader,
        progress: Progress,
        sides: SideCameras,
        started_ns: int,
        publish: Callable[[], None] | None,
        publish_period_ns: int,
        holds: HoldKeeper | None = None,
    ) -> None:
        self._clock = clock
        self._link = link
        self._reader = reader
        self._progress = progress
        self._sides = sides
        self._started_ns = started_ns
        self._publish = publish
        self._publish_period_ns = publish_period_ns
        self._holds = holds
        self._publish_due_ns = started_ns
        self._announcer = Announcer()
        self._was_armed: bool | None = None
        self._armed_ns: int | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="monitor", daemon=True)
        self.state = ServiceState.BOOT
        """As in the HEARTBEAT."""
        self.trouble: Trouble | None = Trouble.STARTING
        """Why no distances are sent; None if they are."""

    def start(self) -> None:
        """Begin to judge."""
        self._thread.start()

    def stop(self) -> None:
        """Judge no more; may be called without `start`."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIMEOUT_S)

    def _run(self) -> None:
        while not self._stopping.wait(_PERIOD_S):
            try:
                self._judge()
                self._sides.judge(self._clock.now_ns(), is_sending=self.trouble is None)
                if self._publish is not None and self._clock.now_ns() >= self._publish_due_ns:
                    self._publish_due_ns = self._clock.now_ns() + self._publish_period_ns
                    self._publish()
            except Exception:
                # The monitor must outlive whatever it monitors.
                log.exception("monitor broke")

    def _judge(self) -> None:
        camera, link, result = self._reader.status, self._link.status(), self._progress.result
        vitals = Vitals(
            now_ns=self._clock.now_ns(),
            started_ns=self._started_ns,
            camera=camera.state,
            link_connected=link.connected,
            armed=link.armed,
            frame_ns=camera.newest_ns,
            result_ns=self._progress.result_ns,
            result_trouble=None if result is None else result.trouble,
            sent_ns=self._progress.sent_ns,
            armed_ns=self._note_arming(link.armed),
            mavlink1=link.mavlink1_seen,
        )
        self.trouble = trouble_of(vitals)
        self.state = state_of(self.trouble, vitals)
        self._link.set_state(self.state)
        if self._holds is not None:
            self._holds.hear(vitals, self.trouble, link, self._sides.losses)
        words = self._announcer.hear(self.trouble, self.state, vitals.now_ns)
        if words is None:
            return
        self._link.say(words.severity, words.text)
        reasons = (camera.detail, link.problem, None if result is None else result.detail)
        known = [reason for reason in reasons if reason]
        log.info(words.text, state=self.state.name, **({"because": "; ".join(known)} if known else {}))

    def _note_arming(self, armed: bool | None) -> int | None:
        """When the vehicle was armed last; `armed` is what it is now."""
        if armed and self._was_armed is False:
            self._armed_ns = self._clock.now_ns()
        if armed is not None:
            self._was_armed = armed
        return self._armed_ns
