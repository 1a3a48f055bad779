"""The thread that sends pictures: paced to what the ground receives, and in nobody's way."""

from __future__ import annotations

import threading
from collections import deque

import structlog
import zenoh

from service.clock import Clock
from service.latest_slot import LatestSlot
from service.pipeline import PerceptionResult
from service.publisher import keys
from service.publisher.budget import PictureBudget
from service.publisher.line import Line, Open
from service.publisher.pacer import Pacer
from service.publisher.picture_source import PictureSource
from service.publisher.rate_limit import RateLimit
from service.publisher.received import ReceivedReport
from service.publisher.topics import PictureTopics
from service.publisher.wire import MAX_SAMPLE_BYTES, Intrinsics, WireError
from service.settings.zenoh import ZenohSettings
from service.thread_rank import stand_back

log = structlog.get_logger()

_TAKE_S = 0.02
"""How soon a picture that was held back is looked at again."""

_LOOK_PERIOD_NS = 500_000_000
_RETRY_S = 2.0
_SHARES = {keys.DEPTH: 0.6, keys.VIDEO: 0.6, keys.CAMERA: 0.4}
_MAX_REPORTS = 64


class PictureThread:
    """Publishes pictures on a session of its own, and through the one that listens.

    Args:
        settings: `[zenoh]`.
        vehicle: second part of every key.
        camera: whose pixels the pictures have.
        clock: the service's.
        open_session: opens a session.
    """

    def __init__(
        self,
        settings: ZenohSettings,
        vehicle: str,
        camera: Intrinsics,
        clock: Clock,
        open_session: Open,
    ) -> None:
        self._settings = settings
        self._vehicle = vehicle
        self._clock = clock
        self._source = PictureSource(settings, camera)
        depth = {"full": keys.DEPTH, "thin": keys.VIDEO}.get(settings.profile)
        self._limits: dict[str, RateLimit] = {}
        if depth is not None:
            self._limits[depth] = RateLimit(settings.depth_rate_hz)
            if settings.camera:
                self._limits[keys.CAMERA] = RateLimit(settings.camera_rate_hz)
        shares = _SHARES if settings.camera else dict.fromkeys(_SHARES, 1.0)
        self._pacer = Pacer(shares)
        self.budget = self._new_budget()
        """What is sent at most."""
        self._line = Line((), settings.connect, open_session, self._opened) if settings.connect else None
        self._listening: zenoh.Session | None = None
        self._topics: dict[zenoh.Session, PictureTopics] = {}
        self._watched: dict[str, list[PictureTopics]] = {}
        self._look_due_ns: int | None = None
        self._reports: deque[bytes] = deque(maxlen=_MAX_REPORTS)
        self._held_back = False
        self._last: dict[str, PerceptionResult] = {}
        self.results: LatestSlot[PerceptionResult] = LatestSlot()
        self.samples = 0
        """Pictures published so far."""
        self.problem = ""
        """What is wrong, in words; empty if nothing."""
        self._stopping = threading.Event()
        self._silent = threading.Event()
        self._thread = threading.Thread(target=self._run, name="zenoh-pictures", daemon=True)

    def listening(self, session: zenoh.Session | None) -> None:
        """Send through `session` too. May be called from any thread."""
        self._listening = session
        self._look_due_ns = None

    def start(self) -> None:
        """Begin; waits for nothing."""
        if self._limits:
            self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Send nothing more, and begin to close the session; `join` waits for that."""
        self._stopping.set()
        self.results.close()
        if self._thread.is_alive():
            self._silent.wait(timeout_s)

    def join(self, timeout_s: float) -> None:
        """Wait for the session's end."""
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _new_budget(self) -> PictureBudget:
        return PictureBudget(self._settings.max_kbit_per_s * 125.0)

    def _opened(self, _line: Line, _session: zenoh.Session) -> None:
        self._look_due_ns = None

    def _run(self) -> None:
        stand_back()
        newest: PerceptionResult | None = None
        try:
            while not self._stopping.is_set():
                try:
                    result = self.results.take(_TAKE_S)
                    newest = result or newest
                    now_ns = self._clock.now_ns()
                    self._look(now_ns, is_due=result is not None)
                    self._hear(now_ns)
                    if newest is not None:
                        self._send(newest)
                    self.problem = "" if self._line is None else self._line.problem
                except Exception as error:
                    # Whatever breaks here, scans and obstacles go on; the next picture may pass.
                    newest = None
                    log.exception("zenoh pictures broke")
                    self.problem = f"zenoh: {type(error).__name__}: {error}"
                    self._forget_topics()
                    if self._line is not None:
                        self._line.drop(self.problem)
                    self._stopping.wait(_RETRY_S)
        finally:
            self._silent.set()
            if self._line is not None:
                self._line.close()

    def _forget_topics(self) -> None:
        """Declare anew what is sent and heard, on sessions that may live on."""
        for topics in self._topics.values():
            topics.close()
        self._topics.clear()
        self._watched.clear()

    def _look(self, now_ns: int, *, is_due: bool) -> None:
        """Keep the session, and notice who watches."""
        if self._line is not None:
            self._line.keep(now_ns)
        if not is_due and self._look_due_ns is not None and now_ns < self._look_due_ns:
            return
        self._look_due_ns = now_ns + _LOOK_PERIOD_NS
        own = None if self._line is None else self._line.session
        sessions = [session for session in (own, self._listening) if session is not None]
        self._topics = {session: self._topics.get(session) or self._declare(session) for session in sessions}
        was_watched = any(self._watched.values())
        self._watched = {
            topic: [topics for topics in self._topics.values() if topics.watched(topic)]
            for topic in self._limits
        }
        if any(self._watched.values()) and not was_watched:
            self.budget = self._new_budget()

    def _declare(self, session: zenoh.Session) -> PictureTopics:
        return PictureTopics(session, self._vehicle, self._report)

    def _report(self, sample: zenoh.Sample) -> None:
        """From Zenoh's threads: keep a report that is not too long to be one."""
        if len(sample.payload) <= MAX_SAMPLE_BYTES:
            self._reports.append(sample.payload.to_bytes())

    def _hear(self, now_ns: int) -> None:
        # No more than were there at once: whoever sends them without end must not hold up the pictures.
        for _ in range(len(self._reports)):
            try:
                report = ReceivedReport.decode(self._reports.popleft())
            except WireError:
                continue
            wants_more = self._held_back or any(self._source.wants_more(topic) for topic in self._limits)
            self.budget.hear(report, now_ns, wants_more=wants_more)
            self._source.wants_key_frame |= report.wants_key_frame
            self._held_back = False
        self.budget.tick(now_ns)

    def _send(self, result: PerceptionResult) -> None:
        for topic, limit in self._limits.items():
            now_ns = self._clock.now_ns()
            if self._last.get(topic) is result or not self._watched.get(topic):
                continue
            if not (self._pacer.allows(topic, now_ns) and self.budget.has_room):
                self._held_back = True
                continue
            if not limit.allows(now_ns):
                continue
            self._last[topic] = result
            picture = self._source.make(topic, result, now_ns, self.budget)
            if picture is None or not picture.fits:
                continue
            attachment = picture.header.encode()
            for topics in self._watched[topic]:
                topics.put(topic, picture.payload, attachment)
            self.samples += 1
            size_bytes = len(picture.payload) + len(attachment)
            self.budget.sent(topic, picture.header.index, size_bytes, now_ns)
            self._pacer.sent(topic, size_bytes, self.budget.bytes_per_s, now_ns)
