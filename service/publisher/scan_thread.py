"""The thread that sends scans and status: nothing that is large ever goes through it."""

from __future__ import annotations

import threading
from collections.abc import Callable

import structlog
import zenoh

from service.clock import Clock
from service.latest_slot import LatestSlot
from service.pipeline import PerceptionResult
from service.publisher.line import Line, Open
from service.publisher.rate_limit import RateLimit
from service.publisher.status_wire import StatusSample
from service.publisher.topics import ScanTopics
from service.publisher.wire import ScanSample
from service.settings.zenoh import ZenohSettings

log = structlog.get_logger()

_TAKE_S = 0.1
_PEERS_PERIOD_NS = 1_000_000_000


class ScanThread:
    """Publishes scans and status on a session that listens, one that connects, or both.

    Args:
        settings: `[zenoh]`.
        vehicle: second part of every key.
        clock: the service's.
        open_session: opens a session.
        listening: told of the session that listens whenever there is another one, so that pictures can go
            through it too: who connects here opens sessions of its own for them.
    """

    def __init__(
        self,
        settings: ZenohSettings,
        vehicle: str,
        clock: Clock,
        open_session: Open,
        listening: Callable[[zenoh.Session | None], None],
    ) -> None:
        self._settings = settings
        self._clock = clock
        self._listening = listening
        self._topics: dict[Line, ScanTopics] = {}
        self._lines: list[Line] = []
        for listen, connect in ((settings.listen, ()), ((), settings.connect)):
            if listen or connect:
                declare = self._declarer(vehicle, bool(listen))
                self._lines.append(Line(listen, connect, open_session, declare, settings.security))
        self.results: LatestSlot[PerceptionResult] = LatestSlot()
        self.statuses: LatestSlot[StatusSample] = LatestSlot()
        self.samples = 0
        """Published so far."""
        self.peers = 0
        """Peers and routers that are there."""
        self.on_turn: Callable[[], None] = _nothing
        """Called after every turn of the thread."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="zenoh-scan", daemon=True)

    @property
    def open(self) -> bool:
        """Whether a session is there."""
        return any(line.session is not None for line in self._lines)

    @property
    def problem(self) -> str:
        """What is wrong, in words; empty if nothing."""
        return "; ".join(line.problem for line in self._lines if line.problem)

    def start(self) -> None:
        """Begin; waits for nothing."""
        self._thread.start()

    def stop(self) -> None:
        """Begin to end; `join` waits for that."""
        self._stopping.set()
        self.results.close()
        self.statuses.close()

    def join(self, timeout_s: float) -> None:
        """Wait for the end of the sessions."""
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _declarer(self, vehicle: str, listens: bool) -> Callable[[Line, zenoh.Session], None]:
        def declare(line: Line, session: zenoh.Session) -> None:
            self._topics[line] = ScanTopics(session, vehicle)
            if listens:
                self._listening(session)

        return declare

    def _run(self) -> None:
        try:
            limit = RateLimit(self._settings.scan_rate_hz)
            look_due_ns = self._clock.now_ns()
            while not self._stopping.is_set():
                try:
                    self._turn(limit)
                    if self._clock.now_ns() >= look_due_ns:
                        look_due_ns = self._clock.now_ns() + _PEERS_PERIOD_NS
                        self._look()
                    self.on_turn()
                except Exception as error:
                    # Whatever breaks here, the vehicle's obstacles go on; the sessions are opened anew.
                    log.exception("zenoh publisher broke")
                    self._drop(f"zenoh: {type(error).__name__}: {error}")
                    self._stopping.wait(_TAKE_S)
        finally:
            self._listening(None)
            for line in self._lines:
                line.close()

    def _turn(self, limit: RateLimit) -> None:
        for line in self._lines:
            line.keep(self._clock.now_ns())
        result = self.results.take(_TAKE_S)
        now_ns = self._clock.now_ns()
        if result is not None and limit.allows(now_ns):
            payload = _scan_sample(result, max(0.0, (now_ns - result.captured_ns) / 1e6)).encode()
            self._each(lambda topics: topics.scan.put(payload))
        status = self.statuses.take()
        if status is not None:
            text = status.encode()
            self._each(lambda topics: topics.status.put(text))

    def _each(self, put: Callable[[ScanTopics], None]) -> None:
        was_put = False
        for line in self._lines:
            if line.session is None:
                continue
            try:
                put(self._topics[line])
                was_put = True
            except zenoh.ZError as error:
                line.drop(f"zenoh: {error}")
        self.samples += was_put

    def _look(self) -> None:
        self.peers = sum(line.look() for line in self._lines)

    def _drop(self, problem: str) -> None:
        self._listening(None)
        for line in self._lines:
            line.drop(problem)


def _nothing() -> None:
    """Nobody wants to know."""


def _scan_sample(result: PerceptionResult, age_ms: float) -> ScanSample:
    return ScanSample.of(
        result.scan,
        index=result.frame.index,
        captured_ns=result.captured_ns,
        age_ms=age_ms,
        trouble=None if result.trouble is None else result.trouble.value,
    )
