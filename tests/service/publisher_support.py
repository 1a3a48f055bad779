"""A publisher and a ground station that hears it, on the loopback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import zenoh
from program_fakes import make_settings, picture, wall_over_ground

from service.clock import MonotonicClock
from service.frame import Frame
from service.pipeline import PerceptionResult, unknown_scan
from service.publisher.publisher import ZenohPublisher
from service.publisher.session import open_session
from service.scale_status import ScaleStatus
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.depth.depth_map import DepthMap


def settings_on(port: int, *overrides: str) -> Settings:
    return make_settings(
        "zenoh.enabled=true", "vehicle.name=kite", f"zenoh.listen=['tcp/127.0.0.1:{port}']", *overrides
    )


def result_of(settings: Settings, index: int = 0, trouble: Trouble | None = None) -> PerceptionResult:
    depth = DepthMap(wall_over_ground(settings.camera.model, 8.0))
    frame = Frame(picture(200), 1_000 + index, index)
    return PerceptionResult(
        frame, Telemetry(0), depth, ScaleStatus(4.0, 0.05, 0.0), unknown_scan(0.2, 20.0), trouble
    )


class Heard:
    """Samples by topic, and liveliness."""

    def __init__(self, session: zenoh.Session, vehicle: str = "kite") -> None:
        self.samples: dict[str, list[zenoh.Sample]] = {}
        self.alive: list[bool] = []
        session.declare_subscriber(f"uavdepth/{vehicle}/*", self._hear)
        session.liveliness().declare_subscriber(
            f"uavdepth/{vehicle}/alive",
            lambda sample: self.alive.append(sample.kind == zenoh.SampleKind.PUT),
            history=True,
        )

    def _hear(self, sample: zenoh.Sample) -> None:
        self.samples.setdefault(str(sample.key_expr).rpartition("/")[2], []).append(sample)

    def has(self, *topics: str) -> bool:
        return all(self.samples.get(topic) for topic in topics)


@contextmanager
def publishing(settings: Settings) -> Iterator[ZenohPublisher]:
    publisher = ZenohPublisher(settings.zenoh, settings.vehicle.name, settings.camera.model, MonotonicClock())
    publisher.start()
    try:
        yield publisher
    finally:
        publisher.close()


@contextmanager
def listening(port: int) -> Iterator[Heard]:
    with open_session([], [f"tcp/127.0.0.1:{port}"]) as session:
        yield Heard(session)
