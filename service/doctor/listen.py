"""The doctor at the line: opens it as `run` does, and listens for some seconds."""

from __future__ import annotations

import select
import threading

from service.autopilot.endpoint import parse_endpoint
from service.autopilot.transport import Transport, open_transport
from service.clock import Clock
from service.doctor.examination import Examination
from service.doctor.observation import Observation

_TURN_S = 0.02
_RETRY_S = 0.3
_MOST_PENDING_BYTES = 400
_LONGEST_EXTRA_S = 5.0
"""Parameters that are asked again and again may prolong the listening by so much."""


def listen(
    examination: Examination,
    endpoint: str,
    seconds: float,
    clock: Clock,
    stop: threading.Event,
) -> Observation:
    """Listen for `seconds` after the first HEARTBEAT, or for `seconds` in all if none comes.

    A line that cannot be opened or is lost is tried again until the time is over, and told in the result.

    Raises:
        LinkError: the endpoint is malformed.
    """
    place = parse_endpoint(endpoint)
    begun_ns = clock.now_ns()
    transport: Transport | None = None
    try:
        while not stop.is_set() and not _is_over(examination, begun_ns, clock.now_ns(), seconds):
            try:
                if transport is None:
                    transport = open_transport(place, clock)
                    examination.line_opened(clock.now_ns())
                _turn(examination, transport, clock)
            except OSError as error:
                examination.line_failed(error.strerror or str(error) or type(error).__name__)
                if transport is not None:
                    transport.close()
                    transport = None
                stop.wait(_RETRY_S)
    finally:
        if transport is not None:
            transport.close()
    return examination.observation(clock.now_ns())


def _is_over(examination: Examination, begun_ns: int, now_ns: int, seconds: float) -> bool:
    heard_s = examination.heard_s(now_ns)
    if heard_s == 0.0:
        return (now_ns - begun_ns) / 1e9 >= seconds
    return heard_s >= seconds and (examination.is_done(now_ns) or heard_s >= seconds + _LONGEST_EXTRA_S)


def _turn(examination: Examination, transport: Transport, clock: Clock) -> None:
    ready, _, _ = select.select([transport], [], [], _TURN_S)
    arrived = transport.receive() if ready else []
    arrival_ns = clock.now_ns()
    transport.flush()
    for data, source in arrived:
        examination.receive(data, arrival_ns, source)
    examination.tick(clock.now_ns())
    if transport.pending_bytes > _MOST_PENDING_BYTES:
        return
    for frame in examination.take_output(clock.now_ns()):
        transport.send(frame, examination.destination)
