"""Recorded depth in place of the network."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.errors import RecordError
from service.pipeline import Perception, make_scanner
from service.settings import Settings
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.scale.estimator import NetworkKind, ScaleEstimate


class RecordedDepth:
    """Answers with the depth that was recorded; the player lays it in."""

    def __init__(self) -> None:
        self.depth: DepthMap | None = None
        """Of the picture that is asked for next, in metres."""

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        """The recorded depth. Raises RecordError if it is not of the camera's size."""
        depth = self.depth
        if depth is None or depth.depth_m.shape != (camera.height, camera.width):
            found = "none" if depth is None else f"{depth.depth_m.shape[1]}x{depth.depth_m.shape[0]}"
            raise RecordError(f"recorded depth is {found}: {camera.width}x{camera.height} is needed")
        return depth


class InMetres:
    """The scale of depth that is in metres already."""

    kind: NetworkKind = "metric"

    def update(
        self, depth: DepthMap, ground: GroundHint | None, points: PointHints | None, captured_ns: int
    ) -> ScaleEstimate:
        """One, without doubt."""
        return ScaleEstimate(scale=1.0, shift=0.0, relative_sigma=0.0, sources=("points",), age_s=0.0)

    def clear(self) -> None:
        """Nothing is remembered."""


def perception_of_depth(settings: Settings, source: RecordedDepth) -> Perception:
    """The pipeline behind the network: scan, memory and everything after it."""
    quiet = settings.model_copy(update={"motion": settings.motion.model_copy(update={"points": False})})
    return Perception(quiet, source, InMetres(), make_scanner(quiet), takes=())
