"""Edges near the vehicle, measured picture by picture and moved along with it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import PointHints
from uavdepth.motion.edge_search import EdgeView, measure_edges
from uavdepth.motion.feature_tracks import MOST_FRAMES
from uavdepth.motion.resection import resect
from uavdepth.motion.vehicle_motion import CameraMotion, VehicleMotion

MOST_EDGES = 150

_WIDTH = 320
"""Edges are looked for in a picture of this width at most: near things are large."""

_LONGEST_WINDOW_NS = 850_000_000
"""What moves by itself moves less in a short time than the vehicle does."""

_BASELINES_M = (0.1, 0.8)
_FASTEST_BASELINE_M = 1.6
"""Of the longer of two, where the vehicle is so fast that no more than one is within the above."""

_SHARES = (1.0, 0.55, 0.3)
"""Of the longest baseline, of the views that are compared."""

_LEAST_BASELINE_M = 0.03
_SEEN_SIGMA_PX = 0.5
_LEAST_DRIFT_M = 0.02
_CARRY_NS = 1_000_000_000
_GROWTH_PER_S = 0.15
_THINNED_PX = 8.0
"""Of edges that come to lie in one cell of so many pixels squared the surest is told."""


_Picture = tuple[int, NDArray[np.uint8]]
_Moved = tuple[_Picture, CameraMotion]
_Maps = tuple[NDArray[np.float32], NDArray[np.float32]]


class NearEdges:
    """The last pictures of one camera, and the edges that were measured in them.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
    """

    def __init__(self, camera: CameraModel, mount: CameraMount) -> None:
        self._camera = camera
        self._mount = mount
        width = min(_WIDTH, camera.width)
        small = camera.scaled(width, max(1, round(camera.height * width / camera.width)))
        self._straight = CameraModel(small.width, small.height, small.fx, small.fy, small.cx, small.cy)
        self._bent = small if any(camera.distortion) else None
        self._maps: _Maps | None = None
        self._pictures: deque[_Picture] = deque(maxlen=MOST_FRAMES)
        self.clear()

    def clear(self) -> None:
        """Forget all pictures and edges."""
        self._pictures.clear()
        self._at_ns = 0
        self._points = np.empty((0, 3))
        self._sigma = np.empty(0)
        self._offset_sigma = np.empty(0)
        self._measured_ns = np.empty(0, dtype=np.int64)

    def see(self, grey: NDArray[np.uint8], captured_ns: int) -> None:
        """Keep a picture to measure with."""
        size = self._straight.width, self._straight.height
        small = grey
        if grey.shape[::-1] != size:
            small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), np.uint8)
        if self._bent is not None:
            if self._maps is None:
                self._maps = _straightening(self._straight, self._bent)
            small = np.asarray(cv2.remap(small, *self._maps, cv2.INTER_LINEAR))
        self._pictures.append((captured_ns, np.asarray(small, np.uint8)))

    def move(self, now_ns: int, motion: VehicleMotion) -> None:
        """Move all edges into the camera's axes at `now_ns`; where the motion is not known they are lost."""
        if len(self._points):
            moved = motion.between(self._at_ns, now_ns, self._mount)
            if moved is None:
                self._keep(np.zeros(len(self._points), dtype=bool))
            else:
                self._points = (self._points + moved.offset_m) @ moved.rotation.T
                self._offset_sigma = self._offset_sigma + moved.sigma_m
                self._keep((now_ns - self._measured_ns <= _CARRY_NS) & (self._points[:, 2] > 0.3))
        self._at_ns = now_ns

    def measure(
        self,
        motion: VehicleMotion,
        anchors: NDArray[np.float64],
        anchor_sigma: float,
        seen_at: Callable[[int], NDArray[np.float64] | None],
    ) -> None:
        """Measure the edges of the newest picture, into whose axes all were moved.

        Args:
            motion: of the vehicle.
            anchors: (N, 3) points of known depth in its axes. By them the motion between two pictures becomes
                as exact as edges need; where they do not agree with it, nothing is measured.
            anchor_sigma: relative standard deviation of their depth, most of which they share.
            seen_at: (N, 2) normalised x, y at which the anchors were seen in the picture of that time, NaN
                where one was not; None where none is known.
        """
        if not self._pictures or self._pictures[-1][0] != self._at_ns:
            return
        views = []
        for picture, moved in self._chosen(motion):
            seen = seen_at(picture[0])
            corrected = None if seen is None else self._corrected(moved, anchors, anchor_sigma, seen, motion)
            if corrected is not None:
                views.append(EdgeView(picture[1], corrected))
        found = measure_edges(self._pictures[-1][1], views, self._straight)
        if found is None:
            return
        count = len(found.points)
        self._points = np.concatenate([self._points, found.points])
        self._sigma = np.concatenate([self._sigma, found.relative_sigma])
        self._offset_sigma = np.concatenate([self._offset_sigma, np.zeros(count)])
        self._measured_ns = np.concatenate([self._measured_ns, np.full(count, self._at_ns)])

    def hints(self, largest_sigma: float, most: int) -> PointHints:
        """The edges in the picture of the last `move`.

        Args:
            largest_sigma: less certain ones are left out.
            most: how many at the most.
        """
        pixels = self._camera.projected(self._points)
        age_s = (self._at_ns - self._measured_ns) * 1e-9
        by_offset = self._offset_sigma / np.maximum(self._points[:, 2], 0.3)
        sigma = np.sqrt(self._sigma**2 + (_GROWTH_PER_S * age_s) ** 2 + by_offset**2)
        size = np.array([self._camera.width, self._camera.height])
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels >= -0.5) & (pixels < size - 0.5), axis=1) & (sigma <= largest_sigma)
        pixels, depth_m, sigma = pixels[inside], self._points[inside, 2], sigma[inside]
        surest = np.argsort(sigma, kind="stable")
        side = _THINNED_PX * self._camera.width / self._straight.width
        column, row = ((pixels[surest] + 0.5) // side).astype(np.intp).T
        _, first = np.unique(row * (self._camera.width + 1) + column, return_index=True)
        chosen = surest[np.sort(first)[: min(most, MOST_EDGES)]]
        return PointHints(
            *(values[chosen].astype(np.float32) for values in (pixels, depth_m, sigma)),
        )

    def _chosen(self, motion: VehicleMotion) -> list[_Moved]:
        """Up to three earlier pictures: that with the longest usable baseline, and two with shorter ones."""
        moves: list[_Moved] = []
        for picture in self._pictures:
            if 0 < self._at_ns - picture[0] <= _LONGEST_WINDOW_NS:
                moved = motion.between(self._at_ns, picture[0], self._mount)
                if moved is not None and _LEAST_BASELINE_M <= moved.baseline_m <= _FASTEST_BASELINE_M:
                    moves.append((picture, moved))
        moves.sort(key=lambda move: move[1].baseline_m)
        few = sum(moved.baseline_m <= _BASELINES_M[1] for _, moved in moves)
        moves = moves[: max(few, 2)]
        if not moves or moves[-1][1].baseline_m < _BASELINES_M[0]:
            return []
        longest = moves[-1][1].baseline_m
        chosen: list[_Moved] = []
        for share in _SHARES:
            left = [move for move in moves if all(move[0][0] != other[0][0] for other in chosen)]
            if left:
                wanted = np.log(share * longest)
                chosen.append(min(left, key=lambda move: abs(np.log(move[1].baseline_m) - wanted)))
        return chosen

    def _corrected(
        self,
        moved: CameraMotion,
        anchors: NDArray[np.float64],
        anchor_sigma: float,
        seen: NDArray[np.float64],
        motion: VehicleMotion,
    ) -> CameraMotion | None:
        """The motion as the anchors show it; None where too few of them agree with what was told of it."""
        there = ~np.isnan(seen[:, 0])
        points = (anchors[there] + moved.offset_m) @ moved.rotation.T
        found = resect(
            points,
            seen[there],
            _SEEN_SIGMA_PX / self._straight.fx,
            max(moved.sigma_m, _LEAST_DRIFT_M),
            motion.noise.attitude_rad,
        )
        if found is None:
            return None
        rotation = found.rotation @ moved.rotation
        # Points measured on the way into a hover tell its small baselines better than the velocity does.
        by_anchors = math.hypot(found.offset_sigma_m, anchor_sigma * moved.baseline_m)
        sigma_m = min(moved.sigma_m, by_anchors)
        return CameraMotion(rotation, moved.offset_m + found.offset_m @ rotation, sigma_m)

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        for name in ("_points", "_sigma", "_offset_sigma", "_measured_ns"):
            setattr(self, name, getattr(self, name)[kept])


def _straightening(
    straight: CameraModel, bent: CameraModel
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where the pixels of a camera without distortion lie in the picture of one with it."""
    rays = straight.normalized_rays.reshape(-1, 3)
    pixels = bent.projected(rays).astype(np.float32).reshape(straight.height, straight.width, 2)
    return np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])
