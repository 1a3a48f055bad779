"""Walls, slabs and boxes with texture coordinates at true size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.mesh import MeshBuilder

_QUAD = np.array([(0, 1, 2), (0, 2, 3)], np.int32)

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
    """An upright rectangle from `start` to `end`.

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
    builder.add(vertices, _QUAD, uv, texture, tint)


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
    foot = _ring(centre, size_m, turn_rad)
    lid = _ring(centre, (size_m[0] * taper, size_m[1] * taper), turn_rad)
    following = np.roll(np.arange(4), -1)
    vertices = np.empty((4, 4, 3))
    vertices[:, 0, :2], vertices[:, 1, :2] = lid, lid[following]
    vertices[:, 2, :2], vertices[:, 3, :2] = foot[following], foot
    vertices[:, :2, 2], vertices[:, 2:, 2] = -top_m, -bottom_m
    length = np.hypot(*(foot[following] - foot).T)
    uv = np.zeros((4, 4, 2))
    uv[:, 1:3, 0] = length[:, None]
    uv[:, 2:, 1] = top_m - bottom_m
    faces = (_QUAD[None] + 4 * np.arange(4, dtype=np.int32)[:, None, None]).reshape(-1, 3)
    roof = np.column_stack([lid, np.full(4, -top_m)])
    roof_uv = lid - np.asarray(centre)
    if top_texture is None:
        sides = vertices.reshape(-1, 3)
        joined = np.concatenate([faces, _QUAD + 16])
        builder.add(
            np.concatenate([sides, roof]), joined, np.concatenate([uv.reshape(-1, 2), roof_uv]), texture, tint
        )
        return
    builder.add(vertices.reshape(-1, 3), faces, uv.reshape(-1, 2), texture, tint)
    builder.add(roof, _QUAD, roof_uv, top_texture, tint)


def _ring(centre: Point, size_m: Sequence[float], turn_rad: float) -> NDArray[np.float64]:
    half = 0.5 * np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)], float) * np.asarray(size_m)
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    turned = half @ np.array([[cosine, sine], [-sine, cosine]])
    return np.asarray(turned + np.asarray(centre, float))
