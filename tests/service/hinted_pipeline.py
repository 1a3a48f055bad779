"""A pipeline around a network that takes hints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from program_fakes import FLYING_HEIGHT_M, LEVEL, make_settings, picture, wall_over_ground

from service.frame import Frame
from service.pipeline import Perception
from service.telemetry import Telemetry
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints
from uavdepth.scan.scanner import ObstacleScanner

SETTINGS = make_settings()
CAMERA, MOUNT = SETTINGS.camera.model, SETTINGS.mount.mount
AHEAD = 31
MS = 1_000_000
SECOND = 1_000_000_000
FLYING = Telemetry(0, LEVEL, FLYING_HEIGHT_M, position_ned_m=(0.0, 0.0, -FLYING_HEIGHT_M))


@dataclass
class HintedDepth:
    """A network that sees a wall and takes metres from the height that it is told."""

    wall_m: float = 8.0
    sigma: float = 0.1
    told: list[Hints | None] = field(default_factory=list)

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        self.told.append(hints)
        guess_m = FLYING_HEIGHT_M / 4 if hints is None or hints.ground is None else hints.ground.height_m
        depth_m = wall_over_ground(camera, self.wall_m) * np.float32(guess_m / FLYING_HEIGHT_M)
        return DepthMap(depth_m, np.full_like(depth_m, self.sigma))


@dataclass
class ScriptedTelemetry:
    """Says one thing while the network has not run and another when it has."""

    model: HintedDepth
    early: Callable[[int], Telemetry]
    late: Callable[[int], Telemetry]
    asked: list[tuple[int, int]] = field(default_factory=list)

    def __call__(self, at_ns: int) -> Telemetry:
        self.asked.append((at_ns, len(self.model.told)))
        return (self.late if self.model.told else self.early)(at_ns)


def perception_of(model: HintedDepth, *overrides: str) -> Perception:
    """The chain with distances as they are."""
    scanner = ObstacleScanner(CAMERA, MOUNT, sigma_factor=0.0)
    return Perception(make_settings("motion.points=false", *overrides), model, None, scanner)


def at(at_ns: int, **changes: object) -> Telemetry:
    return replace(FLYING, at_ns=at_ns, **changes)  # type: ignore[arg-type]


def frame_at(seconds: float) -> Frame:
    return Frame(picture(), round(seconds * SECOND), 0)
