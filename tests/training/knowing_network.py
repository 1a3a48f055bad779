"""A network that was told the truth, in place of trained weights."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from frames import HEIGHT, WIDTH
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.card import HintName, ModelCard
from uavdepth.model.hints import Hints


class KnowingNetwork:
    """Says the depth that it was given, wrong by a factor that depends on how many kinds of hint it gets.

    Args:
        depth_m: (H, W) what it says with error 0.
        hints: that it takes.
        relative_error: by the number of kinds of hint it gets (0, 1, 2): said too far by this share.
        sigma: its doubt everywhere.
        metric: whether its card says metres.
    """

    def __init__(
        self,
        depth_m: NDArray[np.float32],
        hints: tuple[HintName, ...] = (),
        relative_error: Mapping[int, float] | None = None,
        sigma: float = 0.1,
        metric: bool = True,
    ) -> None:
        self._depth_m = depth_m
        self._error = relative_error or {}
        self._sigma = sigma
        self.provider = "cpu"
        self.precision = "fp32"
        self.source = "knowing.onnx"
        self.card = ModelCard(
            card_version=2,
            name="knowing",
            input_width=WIDTH,
            input_height=HEIGHT,
            mean=(0.0, 0.0, 0.0),
            std=(1.0, 1.0, 1.0),
            output="depth",
            metric=metric,
            uncertainty=True,
            focal_px=100.0,
            max_depth_m=200.0,
            training_data="none",
            licence="Apache-2.0",
            measured={},
            created="2026-01-01T00:00:00+00:00",
            hints=hints,
        )

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        """As `DepthModel.infer`."""
        given = hints or Hints()
        kinds = ("ground" in self.card.hints and given.ground is not None) + (
            "points" in self.card.hints and given.points is not None
        )
        depth_m = self._depth_m * np.float32(1.0 + self._error.get(kinds, 0.0))
        return DepthMap(depth_m, np.full_like(depth_m, self._sigma))
