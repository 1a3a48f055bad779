"""The factor between a network's depth and measured points, of one picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.model.hints import PointHints

Array = NDArray[np.float64]

LEAST_POINTS = 8
"""Fewer may all lie on one thing that moves, or on one edge that the network puts elsewhere."""

_TILES = 6
"""The picture is cut into 6 x 6 tiles: a network errs alike on neighbouring points."""

_LEAST_TILES = 3
_CROWD = 4.0
"""More points in one tile are worth no more than so many."""


_NETWORK_SCATTER = 0.1
"""Relative error of a good network from point to point, added to the points' own in their weights."""

_REACH_PX = 2
_EDGE = math.log(1.5)
"""Of the network's farthest over its nearest depth within `_REACH_PX` of a point: more is an edge, and on
which side of it the network drew a corner is chance."""

_ITERATIONS = 6
_TUKEY = 4.685
"""Beyond so many scatters a point counts nothing (Beaton and Tukey, 1974: 95 % efficient on a normal law)."""

_NARROWEST = 0.03
_SHARED_QUANTILE = 0.1


@dataclass(frozen=True)
class PointScale:
    """What points say of one picture.

    Args:
        log_factor: log of metres for each unit of the network's depth.
        shared_sigma: one standard deviation of it that more points of the same picture, or of the next
            pictures, do not make smaller: errors of the velocity.
        region_sigma: the same of a network that is off in whole regions of the picture; it changes with
            what is seen.
        scatter: of the points about the factor: how far the network's depth is off from place to place,
            relative, the points' own errors taken out.
        points: that agreed.
    """

    log_factor: float
    shared_sigma: float
    region_sigma: float
    scatter: float
    points: int


@dataclass(frozen=True, eq=False)
class SampledPoints:
    """Points and the network's depth at their pixels.

    Args:
        network: (N,) the network's depth, or its affine inverse depth.
        depth_m: (N,) measured.
        sigma: (N,) relative standard deviation of the measurement.
        tile: (N,) which part of the picture each lies in.
    """

    network: Array
    depth_m: Array
    sigma: Array
    tile: NDArray[np.intp]


def sample(
    values: NDArray[np.float32], points: PointHints, camera: CameraModel, inverse: bool = False
) -> SampledPoints:
    """A network's answer at points, without those on its edges.

    Args:
        values: (H, W) depth, or inverse depth up to scale and shift; NaN unknown.
        points: measured.
        camera: of the same size.
        inverse: `values` are affine inverse depth; an edge is told by the spread of the whole picture.
    """
    column, row = np.rint(points.pixels).astype(np.intp).T
    column, row = np.clip(column, 0, camera.width - 1), np.clip(row, 0, camera.height - 1)
    reach = _REACH_PX * max(1, round(camera.width / 640))
    nearby = [
        values[
            np.clip(row + down, 0, camera.height - 1),
            np.clip(column + right, 0, camera.width - 1),
        ]
        for down in (-reach, 0, reach)
        for right in (-reach, 0, reach)
    ]
    around = np.array(nearby, dtype=np.float64)
    centre = around[4]
    with np.errstate(invalid="ignore", divide="ignore"):
        if inverse:
            span = np.ptp(centre[np.isfinite(centre)]) if np.isfinite(centre).any() else 0.0
            usable = around.max(axis=0) - around.min(axis=0) <= 0.1 * span + 1e-12
        else:
            usable = (around.min(axis=0) > 0) & (np.log(around.max(axis=0) / around.min(axis=0)) < _EDGE)
    usable &= np.isfinite(around).all(axis=0)
    tile = (row * _TILES // camera.height) * _TILES + column * _TILES // camera.width
    return SampledPoints(
        centre[usable],
        points.depth_m[usable].astype(np.float64),
        points.relative_sigma[usable].astype(np.float64),
        tile[usable],
    )


def scale_from_points(sampled: SampledPoints) -> PointScale | None:
    """The factor that most points agree on, or None where too few do.

    The logs of measured over network depth are located by Tukey's biweight, begun at their weighted median.

    Args:
        sampled: points with the network's depth (not its inverse).
    """
    known = np.isfinite(sampled.network) & (sampled.network > 0)
    if np.count_nonzero(known) < LEAST_POINTS:
        return None
    ratio = np.log(sampled.depth_m[known] / sampled.network[known])
    sigma, tile = sampled.sigma[known], sampled.tile[known]
    weight = 1.0 / (sigma**2 + _NETWORK_SCATTER**2)
    # A crowd of points in one place says what that place says, not what the picture does.
    weight *= np.minimum(1.0, _CROWD / np.bincount(tile)[tile])
    centre = weighted_median(ratio, weight)
    robust = weight
    for _ in range(_ITERATIONS):
        distance = np.abs(ratio - centre)
        scatter = max(1.4826 * weighted_median(distance, weight), _NARROWEST)
        share = distance / (_TUKEY * scatter)
        robust = np.where(share < 1, weight * (1 - np.minimum(share, 1) ** 2) ** 2, 0.0)
        centre, before = float(robust @ ratio / robust.sum()), centre
        if abs(centre - before) < 1e-4:
            break
    agreed = robust > 0
    count = int(np.count_nonzero(agreed))
    tiles = np.bincount(tile[agreed], weights=robust[agreed])
    tiles = tiles[tiles > 0]
    if count < LEAST_POINTS or len(tiles) < _LEAST_TILES:
        return None
    # Kish: how many equal tiles are worth as much as these.
    worth = float(tiles.sum() ** 2 / (tiles**2).sum())
    shared = float(np.quantile(sigma[agreed], _SHARED_QUANTILE))
    own = float(robust @ sigma / robust.sum())
    return PointScale(
        centre,
        shared,
        # Where no points lie the network is off by as much as it is anywhere.
        max(scatter, _NETWORK_SCATTER) / math.sqrt(worth),
        math.sqrt(max(scatter**2 - own**2, 0.0)),
        count,
    )


def weighted_median(values: Array, weight: Array) -> float:
    """The value below which half of the weight lies."""
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order[int(np.searchsorted(total, 0.5 * total[-1]))]])
