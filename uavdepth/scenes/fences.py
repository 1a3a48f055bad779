"""Fences and railings: bars, rails, wire and boards between posts."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.mesh import MeshBuilder

FenceKind = Literal["railing", "handrail", "rails", "mesh", "chain", "boards", "pickets"]
FENCE_KINDS: tuple[FenceKind, ...] = get_args(FenceKind)

HEIGHTS_M: dict[FenceKind, tuple[float, float]] = {
    "railing": (1.0, 1.2),
    "handrail": (1.0, 1.15),
    "rails": (1.1, 1.4),
    "mesh": (1.0, 2.0),
    "chain": (1.8, 2.6),
    "boards": (1.2, 1.9),
    "pickets": (0.8, 1.2),
}
"""Lowest and highest of each kind."""

_POSTS_M: dict[FenceKind, tuple[float, float]] = {
    "railing": (2.0, 0.028),
    "handrail": (1.8, 0.025),
    "rails": (2.3, 0.06),
    "mesh": (2.5, 0.03),
    "chain": (3.0, 0.035),
    "boards": (2.0, 0.05),
    "pickets": (2.0, 0.05),
}
"""Distance and radius of posts."""

_WOODEN = ("rails", "boards", "pickets")
_COLORS_BGR = (
    (0.35, 0.37, 0.38),
    (0.15, 0.15, 0.15),
    (0.7, 0.72, 0.74),
    (0.25, 0.45, 0.25),
    (0.95, 0.95, 0.95),
)


@dataclass(frozen=True)
class _Bars:
    """Bars in one panel, (K, 2) along it and up, metres."""

    starts: NDArray[np.float64]
    ends: NDArray[np.float64]
    radius_m: float
    sides: int = 4


def add_fence(
    builder: MeshBuilder,
    rng: np.random.Generator,
    feet_ned_m: ArrayLike,
    kind: FenceKind,
    height_m: float | None = None,
) -> None:
    """A fence along a line on the ground.

    Args:
        builder: the scene's mesh.
        rng: source of its height and colour.
        feet_ned_m: (N, 3) corners of the line; straight between them.
        kind: which fence.
        height_m: None draws one that the kind has.
    """
    feet = np.asarray(feet_ned_m, float)
    height = float(rng.uniform(*HEIGHTS_M[kind])) if height_m is None else height_m
    if kind in _WOODEN:
        texture, tint = ("paint", (0.95, 0.95, 0.95)) if rng.random() < 0.2 else ("planks", (1.0, 1.0, 1.0))
    else:
        texture, tint = "paint", _COLORS_BGR[int(rng.integers(len(_COLORS_BGR)))]
    apart, thick = _POSTS_M[kind]
    up = np.array([0.0, 0.0, -1.0])
    for first, last in pairwise(feet):
        length = float(np.linalg.norm(last - first))
        if length < 0.2:
            continue
        along = (last - first) / length
        posts = np.linspace(0.0, length, max(2, round(length / apart) + 1))[:, None] * along + first
        add_bars(builder, posts - 0.2 * up, posts + (height + 0.04) * up, thick, tint, texture)
        for bars in _panel(kind, length, height):
            starts, ends = (
                first + ends[:, :1] * along + ends[:, 1:] * up for ends in (bars.starts, bars.ends)
            )
            add_bars(builder, starts, ends, bars.radius_m, tint, texture, bars.sides)
        if kind == "boards":
            _add_boards(builder, first, last, height, texture, tint)


def _panel(kind: FenceKind, length: float, height: float) -> list[_Bars]:
    if kind == "railing":
        return [
            _level(length, [height], 0.028),
            _level(length, [0.1], 0.018),
            _upright(length, 0.1, height, 0.125, 0.01, 3),
        ]
    if kind == "handrail":
        return [_level(length, [height], 0.025, 5), _level(length, [0.5 * height], 0.02, 5)]
    if kind == "rails":
        return [_level(length, [0.35 * height, 0.65 * height, 0.95 * height], 0.05)]
    if kind == "mesh":
        levels = np.arange(0.06, height + 0.01, 0.2)
        return [_level(length, levels, 0.007, 3), _upright(length, 0.04, height, 0.1, 0.005, 3)]
    if kind == "chain":
        return [_level(length, [0.05, height], 0.012, 3), *_diagonals(length, height, 0.15)]
    if kind == "pickets":
        return [
            _level(length, [0.25 * height, 0.75 * height], 0.03),
            _upright(length, 0.06, height, 0.14, 0.04),
        ]
    return []


def _level(length: float, heights: ArrayLike, radius_m: float, sides: int = 4) -> _Bars:
    up = np.asarray(heights, float)
    return _Bars(np.column_stack([0.0 * up, up]), np.column_stack([0.0 * up + length, up]), radius_m, sides)


def _upright(length: float, low: float, high: float, apart: float, radius_m: float, sides: int = 4) -> _Bars:
    along = np.arange(apart, length, apart)
    return _Bars(
        np.column_stack([along, 0.0 * along + low]),
        np.column_stack([along, 0.0 * along + high]),
        radius_m,
        sides,
    )


def _diagonals(length: float, height: float, apart: float) -> list[_Bars]:
    """Wires of a chain-link fence: at 45 degrees both ways, cut off at the panel's edges."""
    foot = np.arange(-height, length, apart)
    low, high = np.clip(foot, 0.0, length), np.clip(foot + height, 0.0, length)
    rising = _Bars(np.column_stack([low, low - foot]), np.column_stack([high, high - foot]), 0.005, 3)
    falling = _Bars(
        np.column_stack([low, foot + height - low]), np.column_stack([high, foot + height - high]), 0.005, 3
    )
    return [rising, falling]


def _add_boards(
    builder: MeshBuilder,
    first: NDArray[np.float64],
    last: NDArray[np.float64],
    height: float,
    texture: str,
    tint: tuple[float, float, float],
) -> None:
    """Boards without gaps: two faces 3 cm apart and the edge on top."""
    along = last - first
    length = float(np.linalg.norm(along))
    aside = 0.015 * np.array([-along[1], along[0], 0.0]) / length
    low, high = np.array([0.0, 0.0, -0.03]), np.array([0.0, 0.0, -height])
    ring = [first - aside, last - aside, last + aside, first + aside]
    vertices = [corner + low for corner in ring] + [corner + high for corner in ring]
    quads = [(0, 1, 5, 4), (2, 3, 7, 6), (4, 5, 6, 7), (1, 2, 6, 5), (3, 0, 4, 7)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    across = [(0.0, height), (length, height), (length, height), (0.0, height)]
    uv = across + [(place, 0.0) for place, _ in across]
    builder.add(vertices, faces, uv, texture, tint)
