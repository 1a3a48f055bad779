"""A whole service whose camera, network and link are stand-ins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from program_fakes import (
    FakeLink,
    FixedDepth,
    ScriptedCamera,
    make_settings,
    picture,
    wall_over_ground,
)

from service.clock import MonotonicClock
from service.pipeline import Perception
from service.run import Service
from service.settings import Settings
from uavdepth.scale.estimator import ScaleEstimator
from uavdepth.scan.scanner import ObstacleScanner

SETTINGS = make_settings()
WALL_M = 8.0


def network(scale: float = 0.25) -> FixedDepth:
    """Sees a wall at 8 m, in units of its own."""
    return FixedDepth(wall_over_ground(SETTINGS.camera.model, WALL_M) * np.float32(scale))


def loader(model: Any) -> Callable[[Settings], Perception]:
    def load(settings: Settings) -> Perception:
        camera, mount = settings.camera.model, settings.mount.mount
        scanner = ObstacleScanner(camera, mount, sigma_factor=0.0)
        return Perception(settings, model, ScaleEstimator(camera, mount), scanner)

    return load


def endless_camera(settings: Settings = SETTINGS, age_ns: int = 0) -> ScriptedCamera:
    return ScriptedCamera(settings, MonotonicClock(), [picture()], forever=True, age_ns=age_ns)


@dataclass
class Running:
    service: Service
    link: FakeLink


@contextmanager
def running(
    model: Any = None,
    camera: ScriptedCamera | None = None,
    settings: Settings = SETTINGS,
    **link_values: Any,
) -> Iterator[Running]:
    clock = MonotonicClock()
    link = FakeLink(clock, **link_values)
    service = Service(
        settings,
        clock,
        link=link,
        camera=camera or endless_camera(settings),
        load_perception=loader(model or network()),
    )
    service.start()
    try:
        yield Running(service, link)
    finally:
        service.stop()


def texts(link: FakeLink) -> list[str]:
    return [text for _, text in link.said]
