"""The viewer's ear for every vehicle."""

from __future__ import annotations

from collections.abc import Callable

import zenoh

from service.bad_samples import BadSamples
from service.publisher import keys
from service.publisher.wire import MAX_SAMPLE_BYTES


def hear_vehicles(
    session: zenoh.Session,
    hear: Callable[[str, bytes], None],
    hear_alive: Callable[[str, bool], None],
    bad: BadSamples,
) -> None:
    """Subscribe to scans, status and liveliness of all vehicles, for as long as the session is open.

    Args:
        session: a viewer's.
        hear: takes key and payload of a scan or status; called from Zenoh's threads, as `hear_alive` is.
        hear_alive: takes the key of a liveliness token, and whether it came or went.
        bad: counts samples that are too large to be read.
    """

    def take(sample: zenoh.Sample) -> None:
        key, size = str(sample.key_expr), len(sample.payload)
        if size > MAX_SAMPLE_BYTES:
            bad.note(f"{key[:100]}: {size} bytes: at most {MAX_SAMPLE_BYTES} are read")
            return
        hear(key, sample.payload.to_bytes())

    def take_alive(sample: zenoh.Sample) -> None:
        hear_alive(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

    for topic in (keys.SCAN, keys.STATUS):
        session.declare_subscriber(keys.key("*", topic), take)
    session.liveliness().declare_subscriber(keys.key("*", keys.ALIVE), take_alive, history=True)
