"""Depth of edges near the camera, by how far they move from picture to picture.

A post before a facade, the roof of a van or a wire has edges but hardly a corner, and what has no corners is
not tracked. Where the motion of the camera is known an edge need not be tracked: its place in another
picture is a function of its depth alone, so depths are tried, and the one at which it looks the same in
several pictures is taken; the epipolar search of Engel, Sturm and Cremers (2013), "Semi-Dense Visual
Odometry for a Monocular Camera", with the sum over several baselines of Okutomi and Kanade (1993), "A
Multiple-Baseline Stereo", which tells a row of like things apart.

Only what is near is looked for: whatever lies within `FARTHEST_M` must move by several pixels, so that an
edge farther away is not taken for one of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.motion.vehicle_motion import CameraMotion

Grey = NDArray[np.uint8]
Field = NDArray[np.float32]

FARTHEST_M = 8.0
NEAREST_M = 1.0
LEAST_PARALLAX_PX = 8.0
"""Of whatever lies within `FARTHEST_M`. On rendered validation flights with 3 pixels thin wires, of which an
aliased picture shows now this row and now that one, were told a third too near, with 8 they were not."""

_CELL_PX = 8
"""The strongest edge of so many pixels squared is looked for, and no other."""

_MOST_EDGES = 250
_LEAST_GRADIENT = 3.0
"""Grey values a pixel, along the way the edge moves."""

_LEAST_ALIGNED = 0.6
"""Of the gradient: an edge that moves along itself looks the same wherever it is."""

_ACROSS = np.array([-1.0, 0.0, 1.0], np.float32)
_ALONG = np.array([-3.0, -1.5, 0.0, 1.5, 3.0], np.float32)
"""Samples about an edge, pixels. Few across: what lies behind it moves otherwise."""

_MARGIN_PX = 6
_STEP_PX = 1.4
_FAR_STEP_PX = 0.6
"""Between the depths that are tried. Those beyond `FARTHEST_M` are tried to be ruled out: of a facade's
rows of windows each looks like the next, and the true one shows only where it fits exactly."""

_MOST_STEPS = 100
_LARGEST_COST = 0.6
"""Mean difference of the samples over their own mean deviation, all pictures together."""

_LARGEST_SINGLE_COST = 1.0
_LEAST_RATIO, _LEAST_LEAD = 1.2, 0.15
"""Of the cost of the next best depth, `_APART_PX` or more away, to the best one's: so many times, and so much
more besides."""

_APART_PX = 3.0
_LARGEST_STRETCH = 3.0
_NEIGHBOURS = 2
"""Edges beside one another at like depth bear each other out; one alone is chance."""

_NEIGHBOUR_PX = 14
_LIKE_DEPTH = 0.12
_EDGE_SIGMA_PX = 1.0
_MODEL_SIGMA = 0.02
_NO_MATCH = np.float32(9.0)


@dataclass(frozen=True, eq=False)
class EdgeView:
    """An earlier picture of a straight camera.

    Args:
        grey: (H, W) uint8.
        motion: of the camera from the newest picture to this one.
    """

    grey: Grey
    motion: CameraMotion


@dataclass(frozen=True, eq=False)
class MeasuredEdges:
    """Edges of the newest picture.

    Args:
        points: (N, 3) in its camera axes, metres.
        relative_sigma: (N,) one standard deviation of depth over depth.
    """

    points: NDArray[np.float64]
    relative_sigma: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Edges:
    """Candidates: (N,) pixels, direction of the gradient, and how many pixels they move for each 1/m."""

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    normal: Field
    px_per_inverse_m: Field

    def __len__(self) -> int:
        return len(self.row)

    def chosen(self, which: NDArray[np.bool_]) -> _Edges:
        """Those of them."""
        return _Edges(self.row[which], self.column[which], self.normal[which], self.px_per_inverse_m[which])


def measure_edges(grey: Grey, views: Sequence[EdgeView], camera: CameraModel) -> MeasuredEdges | None:
    """Depth of the edges of a picture that lie within `FARTHEST_M`.

    Args:
        grey: (H, W) uint8 newest picture of a camera without distortion.
        views: two or more earlier ones of the same size.
        camera: the camera.

    Returns:
        What could be measured without doubt; None where the camera did not move enough, or nothing was found.
    """
    if len(views) < 2:
        return None
    farthest = max(views, key=lambda view: view.motion.baseline_m).motion
    edges = _edges(grey, farthest, camera)
    edges = edges.chosen(_infinity_seen(edges, views, camera) >= 2)
    if not len(edges):
        return None
    inverse, near = _tried(float(edges.px_per_inverse_m.max()))
    cost, worst = _costs(grey, views, camera, edges, inverse)
    each = np.arange(len(edges))
    best = cost.argmin(axis=1)
    apart_px = np.abs(inverse - inverse[best][:, None]) * edges.px_per_inverse_m[:, None]
    elsewhere = apart_px > _APART_PX
    second = np.where(elsewhere, cost, _NO_MATCH).min(axis=1)
    step = inverse[-1] - inverse[-2]
    found = inverse[best] + _between_steps(cost, best) * step
    lowest = cost[each, best]
    good = (lowest < _LARGEST_COST) & (second > _LEAST_RATIO * lowest + _LEAST_LEAD)
    good &= worst[each, best] < _LARGEST_SINGLE_COST
    good &= (best > near) & (best < len(inverse) - 1)
    kept = np.flatnonzero(good)
    kept = kept[_borne_out(edges.row[kept], edges.column[kept], found[kept])]
    if not len(kept):
        return None
    depth_m = 1.0 / found[kept].astype(np.float64)
    x = (edges.column[kept] - camera.cx) / camera.fx
    y = (edges.row[kept] - camera.cy) / camera.fy
    parallax_px = found[kept] * edges.px_per_inverse_m[kept]
    baseline_sigma = farthest.sigma_m / farthest.baseline_m
    return MeasuredEdges(
        np.stack([x, y, np.ones_like(x)], axis=1) * depth_m[:, None],
        np.sqrt((_EDGE_SIGMA_PX / parallax_px) ** 2 + _MODEL_SIGMA**2 + baseline_sigma**2),
    )


def _tried(most_px: float) -> tuple[Field, int]:
    """(D,) inverse depths from 0 on, and which of them is `FARTHEST_M`'s.

    Args:
        most_px: that an edge moves by for each 1/m.
    """
    far = math.ceil(most_px / FARTHEST_M / _FAR_STEP_PX)
    span = 1.0 / NEAREST_M - 1.0 / FARTHEST_M
    near = min(math.ceil(most_px * span / _STEP_PX), _MOST_STEPS)
    beyond = np.linspace(0.0, 1.0 / FARTHEST_M, far, endpoint=False)
    within = np.linspace(1.0 / FARTHEST_M, 1.0 / NEAREST_M, near + 1)
    return np.concatenate([beyond, within]).astype(np.float32), far


def _edges(grey: Grey, motion: CameraMotion, camera: CameraModel) -> _Edges:
    """The strongest edge of each cell that moves enough, and across itself."""
    height, width = grey.shape
    right = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=1 / 8)
    down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=1 / 8)
    # Where a pixel goes as its inverse depth grows from 0: pixels for each 1/m.
    offset = motion.offset_m
    u = camera.fx * offset[0] - (np.arange(width) - camera.cx) * offset[2]
    v = camera.fy * offset[1] - (np.arange(height) - camera.cy) * offset[2]
    u, v = u.astype(np.float32)[None, :], v.astype(np.float32)[:, None]
    moves = np.sqrt(u * u + v * v)
    along = np.abs(right * u + down * v) / np.maximum(moves, np.float32(1e-6))
    usable = (along > _LEAST_GRADIENT) & (moves > FARTHEST_M * LEAST_PARALLAX_PX)
    usable &= along > _LEAST_ALIGNED * cv2.magnitude(right, down)
    usable[:_MARGIN_PX], usable[-_MARGIN_PX:] = False, False
    usable[:, :_MARGIN_PX], usable[:, -_MARGIN_PX:] = False, False
    strength = np.where(usable, along, np.float32(0.0))
    rows, columns = height // _CELL_PX, width // _CELL_PX
    whole = strength[: rows * _CELL_PX, : columns * _CELL_PX].reshape(rows, _CELL_PX, columns, _CELL_PX)
    cells = whole.transpose(0, 2, 1, 3).reshape(rows * columns, _CELL_PX**2)
    strongest = cells.argmax(axis=1)
    value = cells[np.arange(len(cells)), strongest]
    chosen = np.flatnonzero(value > 0)
    chosen = chosen[np.argsort(-value[chosen], kind="stable")[:_MOST_EDGES]]
    row = chosen // columns * _CELL_PX + strongest[chosen] // _CELL_PX
    column = chosen % columns * _CELL_PX + strongest[chosen] % _CELL_PX
    normal = np.stack([right[row, column], down[row, column]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return _Edges(row, column, normal, moves[row, column])


def _infinity_seen(edges: _Edges, views: Sequence[EdgeView], camera: CameraModel) -> NDArray[np.int64]:
    """(N,) in how many views each edge would be in the picture if it is far: else that is not ruled out."""
    rays = camera.straightened(np.stack([edges.column, edges.row], axis=1))
    rays = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
    last = camera.width - 1 - _MARGIN_PX, camera.height - 1 - _MARGIN_PX
    count = np.zeros(len(edges), np.int64)
    for view in views:
        pixels = camera.projected(rays @ view.motion.rotation.T)
        with np.errstate(invalid="ignore"):
            count += ((pixels >= _MARGIN_PX) & (pixels <= last)).all(axis=1)
    return count


def _costs(
    grey: Grey, views: Sequence[EdgeView], camera: CameraModel, edges: _Edges, inverse: Field
) -> tuple[Field, Field]:
    """(N, D) how unlike each edge looks at each inverse depth: over all views, and in the worst of them."""
    height, width = grey.shape
    across, along = (part.reshape(-1, 1, 1) for part in np.meshgrid(_ACROSS, _ALONG))
    # Samples first, then edges, then depths: numpy is quick along the last axis only.
    right = across * edges.normal[:, :1] - along * edges.normal[:, 1:]
    down = across * edges.normal[:, 1:] + along * edges.normal[:, :1]
    column, row = edges.column.astype(np.float32)[:, None], edges.row.astype(np.float32)[:, None]
    here = _sampled(grey, column + right, row + down)
    deviation = np.abs(here).mean(axis=0) + np.float32(1.0)
    x = (column - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (row - np.float32(camera.cy)) / np.float32(camera.fy)
    matrix = camera.matrix
    shape = (len(edges), len(inverse))
    total, count = np.zeros(shape, np.float32), np.zeros(shape, np.int32)
    worst = np.zeros(shape, np.float32)
    for view in views:
        # Turned back as the camera turned, so that an edge moves by the offset alone.
        turn = matrix @ view.motion.rotation.T @ np.linalg.inv(matrix)
        turned = np.asarray(cv2.warpPerspective(view.grey, turn, (width, height)), np.uint8)
        offset = view.motion.offset_m.astype(np.float32)
        stretch = 1.0 / np.maximum(1.0 + inverse * offset[2], np.float32(1e-3))
        u = (x + inverse * offset[0]) * stretch * np.float32(camera.fx) + np.float32(camera.cx)
        v = (y + inverse * offset[1]) * stretch * np.float32(camera.fy) + np.float32(camera.cy)
        reach = _ALONG[-1] * stretch
        inside = (u >= reach) & (u <= width - 1 - reach) & (v >= reach) & (v <= height - 1 - reach)
        inside &= stretch < _LARGEST_STRETCH
        there = _sampled(turned, u + right * stretch, v + down * stretch)
        there -= here
        unlike = np.abs(there, out=there).mean(axis=0) / deviation
        total += np.where(inside, unlike, np.float32(0.0))
        worst = np.maximum(worst, np.where(inside, unlike, np.float32(0.0)))
        count += inside
    return np.where(count >= 2, total / np.maximum(count, 1), _NO_MATCH).astype(np.float32), worst


def _sampled(picture: Grey, x: Field, y: Field) -> Field:
    """Grey values at pixels (P, N, D), less the mean of the first axis."""
    lines = -1, x.shape[-1]
    values = cv2.remap(
        picture,
        np.asarray(x, np.float32).reshape(lines),
        np.asarray(y, np.float32).reshape(lines),
        cv2.INTER_LINEAR,
    )
    grey = values.reshape(x.shape).astype(np.float32)
    grey -= grey.mean(axis=0)
    return grey


def _between_steps(cost: Field, best: NDArray[np.intp]) -> Field:
    """(N,) where the lowest cost lies by a parabola through it and its neighbours, -0.5 to 0.5 of a step."""
    middle = np.clip(best, 1, cost.shape[1] - 2)
    each = np.arange(len(best))
    before, at, after = cost[each, middle - 1], cost[each, middle], cost[each, middle + 1]
    bend = np.maximum(before - 2 * at + after, np.float32(1e-6))
    return np.asarray(np.clip(0.5 * (before - after) / bend, -0.5, 0.5), np.float32)


def _borne_out(row: NDArray[np.intp], column: NDArray[np.intp], inverse: Field) -> NDArray[np.bool_]:
    """(N,) edges that have `_NEIGHBOURS` of like depth beside them."""
    beside = (np.abs(row[:, None] - row) <= _NEIGHBOUR_PX) & (
        np.abs(column[:, None] - column) <= _NEIGHBOUR_PX
    )
    beside &= np.abs(np.log(inverse[:, None] / inverse)) < _LIKE_DEPTH
    return np.asarray(beside.sum(axis=1) > _NEIGHBOURS, np.bool_)
