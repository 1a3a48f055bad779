"""Depth of one picture, and the parts that it comes from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from service.scale_status import ScaleStatus
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.scale.estimator import NetworkKind, ScaleEstimate


class DepthSource(Protocol):
    """What tells depth from a picture, in units of its own, or in metres where it is given hints."""

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        """Depth at the camera's pixels."""


class ScaleSource(Protocol):
    """What finds the metres of a network's depth (`uavdepth.scale.estimator.ScaleEstimator`)."""

    @property
    def kind(self) -> NetworkKind:
        """What the network's answer is."""

    def update(
        self, depth: DepthMap, ground: GroundHint | None, points: PointHints | None, captured_ns: int
    ) -> ScaleEstimate | None:
        """The scale of one picture, or None where it was never told."""

    def clear(self) -> None:
        """Forget everything."""


@dataclass(frozen=True)
class Measurement:
    """One picture's depth.

    Args:
        telemetry: the vehicle at capture.
        depth: in metres; None with trouble.
        scale: what the metres rest on; None where nothing does.
        height_m: height above ground by the rangefinder; None where it does not say.
        points: points that motion measured.
        trouble: why there are no metres, or none to trust.
    """

    telemetry: Telemetry
    depth: DepthMap | None = None
    scale: ScaleStatus | None = None
    height_m: float | None = None
    points: int = 0
    trouble: Trouble | None = None
