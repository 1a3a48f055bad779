"""Frames of steel bars: masts, pylons, cranes, gantries."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.mesh import MeshBuilder

_SQUARE = np.array([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])


def add_lattice(
    builder: MeshBuilder,
    start_m: ArrayLike,
    end_m: ArrayLike,
    widths_m: tuple[float, float],
    radius_m: float = 0.04,
    tint: ArrayLike = (0.5, 0.52, 0.54),
    bay: float = 1.2,
) -> None:
    """A beam of four chords with diagonals on its four sides.

    Args:
        builder: the scene's mesh.
        start_m, end_m: (3,) ends of its middle line, NED.
        widths_m: its side at both ends.
        radius_m: of the chords; diagonals are of 0.6 of it.
        tint: BGR factor.
        bay: length of a bay as a multiple of its width.
    """
    start, end = np.asarray(start_m, float), np.asarray(end_m, float)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[2]) > 0.8 else np.array([0.0, 0.0, 1.0])
    right = np.cross(along, helper)
    right /= np.linalg.norm(right)
    ahead = np.cross(along, right)
    bays = max(1, round(length / (bay * 0.5 * (widths_m[0] + widths_m[1]))))
    t = np.linspace(0.0, 1.0, bays + 1)
    half = 0.5 * (widths_m[0] + (widths_m[1] - widths_m[0]) * t)
    offset = _SQUARE[:, :1] * right + _SQUARE[:, 1:] * ahead
    rings = start + t[:, None, None] * (end - start) + half[:, None, None] * offset
    add_bars(builder, rings[0], rings[-1], radius_m, tint)
    turned = np.roll(rings, -1, axis=1)
    zigzag = np.where((np.arange(bays) % 2 == 0)[:, None, None], rings[:-1], turned[:-1])
    zagzig = np.where((np.arange(bays) % 2 == 0)[:, None, None], turned[1:], rings[1:])
    add_bars(builder, zigzag, zagzig, 0.6 * radius_m, tint, sides=3)
    add_bars(builder, rings, turned, 0.6 * radius_m, tint, sides=3)
