"""Walls, slabs and boxes with texture coordinates at true size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.mesh import MeshBuilder

_QUAD = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
"""Level quads from south-west over south-east: wound to face up."""
_UPRIGHT = _QUAD[:, ::-1]
"""Walls whose feet run around a solid in the order of `Rect.corners`: wound to face outwards."""
_NEXT = np.array([1, 2, 3, 0])
_UNIT_RING = 0.5 * np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)], float)

Point = tuple[float, float]
"""North and east in metres."""


@dataclass(frozen=True)
class Rect:
    """An upright rectangle on the ground: north and east from low to high, metres."""

    north_low_m: float
    north_high_m: float
    east_low_m: float
    east_high_m: float

    def shrunk(self, by_m: float) -> Rect:
        """The rectangle with `by_m` taken off every side."""
        return Rect(
            self.north_low_m + by_m, self.north_high_m - by_m, self.east_low_m + by_m, self.east_high_m - by_m
        )

    def overlaps(self, other: Rect) -> bool:
        """Whether any of its ground is the other's too."""
        return (
            self.north_low_m < other.north_high_m
            and other.north_low_m < self.north_high_m
            and self.east_low_m < other.east_high_m
            and other.east_low_m < self.east_high_m
        )

    @property
    def corners(self) -> list[Point]:
        """Corners in a ring."""
        return [
            (self.north_low_m, self.east_low_m),
            (self.north_low_m, self.east_high_m),
            (self.north_high_m, self.east_high_m),
            (self.north_high_m, self.east_low_m),
        ]


def add_wall(
    builder: MeshBuilder,
    start: Point,
    end: Point,
    bottom_m: float,
    top_m: float,
    texture: str,
    tint: ArrayLike = (1.0, 1.0, 1.0),
    shift_m: float = 0.0,
) -> None:
    """An upright rectangle from `start` to `end`, facing right of that direction seen from above.

    Args:
        bottom_m, top_m: heights over down = 0, up positive.
        shift_m: moves the texture along the wall. Texture rows count down from the wall's top.
    """
    length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    vertices = [
        (*start, -top_m),
        (*end, -top_m),
        (*end, -bottom_m),
        (*start, -bottom_m),
    ]
    uv = [
        (shift_m, 0.0),
        (shift_m + length, 0.0),
        (shift_m + length, top_m - bottom_m),
        (shift_m, top_m - bottom_m),
    ]
    builder.add(vertices, _UPRIGHT, uv, texture, tint)


def add_slab(
    builder: MeshBuilder,
    rect: Rect,
    height_m: float,
    texture: str,
    tint: ArrayLike = (1.0, 1.0, 1.0),
) -> None:
    """A level rectangle at a height over down = 0."""
    vertices = [(*corner, -height_m) for corner in rect.corners]
    builder.add(vertices, _QUAD, rect.corners, texture, tint)


def add_box(
    builder: MeshBuilder,
    centre: Point,
    size_m: tuple[float, float],
    bottom_m: float,
    top_m: float,
    texture: str,
    tint: ArrayLike = (1.0, 1.0, 1.0),
    turn_rad: float = 0.0,
    top_texture: str | None = None,
    taper: float = 1.0,
) -> None:
    """A box on the ground, or a frustum.

    Args:
        centre: of its foot.
        size_m: length along its own x (north when not turned) and y.
        bottom_m, top_m: heights over down = 0.
        turn_rad: clockwise turn from above.
        top_texture: of the lid; None takes `texture`.
        taper: size of the lid as a part of the foot.
    """
    add_boxes(
        builder, [centre], size_m, [bottom_m], top_m - bottom_m, texture, tint, turn_rad, top_texture, taper
    )


def add_boxes(
    builder: MeshBuilder,
    centres: ArrayLike,
    size_m: tuple[float, float],
    bottoms_m: ArrayLike,
    height_m: float,
    texture: str,
    tint: ArrayLike = (1.0, 1.0, 1.0),
    turn_rad: float = 0.0,
    top_texture: str | None = None,
    taper: float = 1.0,
) -> None:
    """K equal boxes at (K, 2) places and (K,) heights of their feet; other arguments as in `add_box`."""
    places = np.asarray(centres, float).reshape(-1, 1, 2)
    bottoms = np.asarray(bottoms_m, float).reshape(-1, 1)
    foot = _ring(size_m, turn_rad)
    lid = foot * taper
    sides = np.empty((len(places), 4, 4, 3))
    sides[:, :, 0, :2], sides[:, :, 1, :2] = places + lid, places + lid[_NEXT]
    sides[:, :, 2, :2], sides[:, :, 3, :2] = places + foot[_NEXT], places + foot
    sides[..., :2, 2] = -(bottoms + height_m)[..., None]
    sides[..., 2:, 2] = -bottoms[..., None]
    uv = np.zeros((4, 4, 2))
    uv[:, 1:3, 0] = np.hypot(*(foot[_NEXT] - foot).T)[:, None]
    uv[:, 2:, 1] = height_m
    lids = np.empty((len(places), 1, 4, 3))
    lids[..., :2] = (places + lid)[:, None]
    lids[..., 2] = -(bottoms + height_m)[..., None]
    _add_quads(builder, sides, uv, _UPRIGHT, texture, tint)
    _add_quads(builder, lids, lid[None], _QUAD, top_texture or texture, tint)


def _add_quads(
    builder: MeshBuilder,
    corners: NDArray[np.float64],
    uv: NDArray[np.float64],
    winding: NDArray[np.int32],
    texture: str,
    tint: ArrayLike,
) -> None:
    """(K, Q, 4, 3) corners of quads with (Q, 4, 2) texture coordinates that all K share."""
    count = corners.shape[0] * corners.shape[1]
    faces = winding[None] + 4 * np.arange(count, dtype=np.int32)[:, None, None]
    spread = np.broadcast_to(uv, (*corners.shape[:3], 2))
    builder.add(corners.reshape(-1, 3), faces.reshape(-1, 3), spread.reshape(-1, 2), texture, tint)


def _ring(size_m: Sequence[float], turn_rad: float) -> NDArray[np.float64]:
    half = _UNIT_RING * np.asarray(size_m)
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    return np.asarray(half @ np.array([[cosine, sine], [-sine, cosine]]))
