"""Flights through rendered worlds: exact depth, and an autopilot that errs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from service.motion_evaluation.erring_autopilot import ErringAutopilot
from service.motion_evaluation.journey import Moment
from service.motion_evaluation.rendering import rendered_moments
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import load_scene

CAMERA = CameraModel.from_fov(640, 320, 90.0)
MOUNT = CameraMount(pitch_deg=-5.0, forward_m=0.1)
START_S = 2.0
"""Planned flights begin at rest; evaluation begins where they have found their way."""


@dataclass(frozen=True)
class RenderedJourney:
    """A planned flight.

    Args:
        scene: rendered world, NAME:SEED.
        seconds: how long.
        rate_hz: pictures a second.
        seed: of the flight and of the autopilot's errors.
    """

    scene: str
    seconds: float
    rate_hz: float
    seed: int
    camera: CameraModel = CAMERA
    mount: CameraMount = MOUNT
    group: str = "flight"

    @property
    def name(self) -> str:
        """Scene and flight."""
        return f"{self.scene} flight {self.seed}"

    def moments(self) -> Iterator[Moment]:
        """Every picture in turn; the world is built first, which takes seconds."""
        name, _, seed = self.scene.partition(":")
        scene = load_scene(name, int(seed or 0))
        flight = scene.flight(self.seed, self.seconds + START_S)
        autopilot = ErringAutopilot(flight.at, START_S - 0.5, self.seed)
        times_s = np.arange(START_S, START_S + self.seconds, 1 / self.rate_hz)
        return rendered_moments(scene, self.camera, self.mount, flight.at, autopilot, times_s)
