"""The autopilot link: one thread round a `LinkSession` and a line."""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Callable, Hashable
from pathlib import Path

import structlog

from service.autopilot.endpoint import UdpListenEndpoint, parse_endpoint
from service.autopilot.link_status import LinkStatus
from service.autopilot.service_state import ServiceState
from service.autopilot.session import LinkSession
from service.autopilot.signing_key import load_signing_key
from service.autopilot.transport import Transport, open_transport
from service.autopilot.udp_transport import UdpListenTransport
from service.clock import Clock
from service.errors import LinkError
from service.settings.autopilot import AutopilotSettings
from service.telemetry import Telemetry
from uavdepth.scan.obstacle_scan import ObstacleScan

_TICK_S = 0.02
_RETRY_S = 0.5
_JOIN_S = 3.0
_MAX_PENDING_BYTES = 400
"""Two OBSTACLE_DISTANCE: while more waits for the line, nothing new is made."""

log = structlog.get_logger("autopilot")

Tap = Callable[[bytes, int, bool, Hashable], None]
"""Gets bytes of the line, when they passed, whether they left, and whose they are. Must not wait or raise."""


class AutopilotLink:
    """Talks to the autopilot in the background and survives whatever the line does.

    Every method returns at once and may be called from any thread.

    Args:
        settings: the `[autopilot]` section.
        clock: the service's clock, by which frames are stamped too.
        tap: gets every byte of the line, for a recorder.
    """

    def __init__(self, settings: AutopilotSettings, clock: Clock, tap: Tap | None = None) -> None:
        self._settings = settings
        self._clock = clock
        self._tap = tap
        self._session = LinkSession(settings)
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._congested = False
        self._first_transport: Transport | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin. A silent or missing autopilot is no error: it is tried again and told in `status`.

        Raises:
            LinkError: the endpoint is malformed, the UDP port cannot be bound, or the signing key file
                cannot be used.
        """
        if self._thread is not None:
            raise LinkError("the autopilot link has been started already")
        endpoint = parse_endpoint(self._settings.endpoint)
        if self._settings.signing_key_file:
            self._sign(Path(self._settings.signing_key_file).expanduser())
        if isinstance(endpoint, UdpListenEndpoint):
            try:
                self._first_transport = open_transport(endpoint, self._clock)
            except OSError as error:
                raise LinkError(f"cannot listen on {endpoint}: {_reason(error)}") from error
        self._thread = threading.Thread(target=self._run, name="autopilot-link", daemon=True)
        self._thread.start()

    @property
    def listen_port(self) -> int | None:
        """The UDP port that is bound by a `udp:` endpoint (port 0 takes a free one), else None."""
        transport = self._first_transport
        return transport.port if isinstance(transport, UdpListenTransport) else None

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        """What the vehicle did at `captured_ns`.

        Ask late (after inference) rather than early: then messages from both sides of the moment are here.
        """
        with self._lock:
            return self._session.telemetry_at(captured_ns, self._clock.now_ns())

    def newest_pose(self) -> Telemetry:
        """What the vehicle did last, and when (`at_ns`); empty after 0.5 s of silence."""
        with self._lock:
            return self._session.newest_pose(self._clock.now_ns())

    def predicted_pose(self, at_ns: int) -> Telemetry:
        """What the vehicle will do at `at_ns`, up to 0.25 s after its newest messages."""
        with self._lock:
            return self._session.predicted_pose(at_ns)

    def send_obstacles(self, scan: ObstacleScan, captured_ns: int) -> bool:
        """Send the scan of the frame captured at `captured_ns`.

        Returns:
            False, and nothing is sent, if the autopilot is not there, the frame is too old or was sent
            before, the last message is too recent for the wanted rate, or the line is full.
        """
        with self._lock:
            queued = self._session.send_obstacles(scan, captured_ns, self._clock.now_ns(), self._congested)
        if queued:
            self._wake()
        return queued

    def set_state(self, state: ServiceState) -> None:
        """Tell this state in HEARTBEAT, at once if it is a new one."""
        with self._lock:
            self._session.set_state(state)
        self._wake()

    def say(self, severity: int, text: str) -> None:
        """Send a STATUSTEXT (MAV_SEVERITY 0 to 7); the same text at most every 10 s."""
        with self._lock:
            self._session.say(severity, text, self._clock.now_ns())

    def hold(self) -> str:
        """Ask the vehicle once to stop and stay, in the mode that it has for that.

        `status` tells the outcome.

        Returns:
            The mode that is asked for, empty if none is known.
        """
        with self._lock:
            mode = self._session.ask_to_hold()
        self._wake()
        return mode

    def status(self) -> LinkStatus:
        """How the link is doing."""
        with self._lock:
            return self._session.status(self._clock.now_ns())

    def close(self) -> None:
        """Stop and close the line; may be called twice."""
        self._stop.set()
        self._wake()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
        if self._thread is None or not self._thread.is_alive():
            self._wake_read.close()
            self._wake_write.close()

    def _sign(self, path: Path) -> None:
        key = load_signing_key(path)
        if key.warning is not None:
            log.warning(key.warning)
        with self._lock:
            self._session.sign_with(key)

    def _wake(self) -> None:
        try:
            self._wake_write.send(b"\0")
        except OSError:
            return  # full: it is awake already; or closed

    # -- the thread

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._run_line()
        finally:
            if not self._stop.is_set():  # a fault of ours: say so rather than look connected
                with self._lock:
                    self._session.line_failed("the link's thread has ended")
            self._tell()

    def _run_line(self) -> None:
        """Open the line and use it until it is lost."""
        transport: Transport | None = None
        try:
            transport = self._first_transport or open_transport(
                parse_endpoint(self._settings.endpoint), self._clock
            )
            with self._lock:
                self._session.line_opened(self._clock.now_ns())
            while not self._stop.is_set():
                self._turn(transport)
            self._turn(transport)  # the last words: a text or state that was set just before closing
        except OSError as error:
            self._lose(_reason(error))
        except Exception as error:
            # A fault of ours in one message must not take the obstacles away for the rest of the flight.
            log.exception("the autopilot link broke and begins anew")
            self._lose(f"{type(error).__name__}: {error}")
        finally:
            if transport is not None:
                transport.close()

    def _lose(self, reason: str) -> None:
        with self._lock:
            self._session.line_failed(reason)
        self._tell()
        self._first_transport = None
        self._stop.wait(_RETRY_S)

    def _turn(self, transport: Transport) -> None:
        """Wait for bytes, for something to send or for the next tick, and handle it."""
        waited_for: list[Transport | socket.socket] = [transport, self._wake_read]
        ready, _, _ = select.select(waited_for, [], [], _TICK_S)
        if self._wake_read in ready:
            self._wake_read.recv(4096)
        arrived = transport.receive() if transport in ready else []
        arrival_ns = self._clock.now_ns()
        transport.flush()
        with self._lock:
            for data, source in arrived:
                self._session.receive(data, arrival_ns, source)
            now_ns = self._clock.now_ns()
            self._session.tick(now_ns)
            self._congested = transport.pending_bytes > _MAX_PENDING_BYTES
            frames = [] if self._congested else self._session.take_output(now_ns)
            destination = self._session.destination
        for frame in frames:
            transport.send(frame, destination)
        if self._tap is not None:
            passed = [(data, arrival_ns, False, source) for data, source in arrived]
            passed += [(frame, now_ns, True, destination) for frame in frames]
            self._record(self._tap, passed)
        self._tell()

    def _record(self, tap: Tap, passed: list[tuple[bytes, int, bool, Hashable]]) -> None:
        try:
            for data, at_ns, outgoing, whose in passed:
                tap(data, at_ns, outgoing, whose)
        except Exception:
            # The record is a help; the line is the vehicle's protection.
            log.exception("the line is no longer recorded")
            self._tap = None

    def _tell(self) -> None:
        with self._lock:
            notices = self._session.take_notices()
        for notice in notices:
            if notice.problem:
                log.warning(notice.text)
            else:
                log.info(notice.text)


def _reason(error: OSError) -> str:
    return error.strerror or str(error) or type(error).__name__
