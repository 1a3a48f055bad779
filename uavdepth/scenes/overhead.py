"""Overhead lines: poles, pylons and the wires between them."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.bars import WIRE_RADIUS_M, add_bars, add_wires
from uavdepth.scenes.lattice import add_lattice
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import add_box

LineKind = Literal["wood", "concrete", "pylon"]
_HEIGHTS_M: dict[LineKind, tuple[float, float]] = {
    "wood": (6.5, 9.0),
    "concrete": (9.0, 12.0),
    "pylon": (18.0, 28.0),
}
_SAG = 0.025
_UP = np.array([0.0, 0.0, -1.0])


def add_line(
    builder: MeshBuilder, rng: np.random.Generator, feet_ned_m: ArrayLike, kind: LineKind = "wood"
) -> None:
    """A power or telephone line.

    Args:
        builder: the scene's mesh.
        rng: source of its height and number of wires.
        feet_ned_m: (N, 3) feet of its poles, in their order.
        kind: what the poles are.
    """
    feet = np.asarray(feet_ned_m, float)
    height = float(rng.uniform(*_HEIGHTS_M[kind]))
    along = np.gradient(feet[:, :2], axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(feet))])
    tops = feet - [0.0, 0.0, height]
    if kind == "pylon":
        places = _pylons(builder, feet, across, height)
    else:
        places = _poles(builder, rng, feet, tops, across, kind)
    for offset, down in places:
        ends = tops + offset * across + [0.0, 0.0, down]
        add_wires(builder, ends[:-1], ends[1:], _SAG, 0.016 if kind == "pylon" else WIRE_RADIUS_M)


def _poles(
    builder: MeshBuilder,
    rng: np.random.Generator,
    feet: NDArray[np.float64],
    tops: NDArray[np.float64],
    across: NDArray[np.float64],
    kind: LineKind,
) -> list[tuple[float, float]]:
    """Poles, some with cross-arms. Returns where wires hang: aside of and below the tops."""
    texture, tint = ("bark", (0.8, 0.8, 0.8)) if kind == "wood" else ("concrete", (0.95, 0.95, 0.95))
    root = np.array([0.0, 0.0, 0.3])
    add_bars(builder, feet + root, tops, 0.13, tint, texture, sides=7)
    if rng.random() < 0.4:
        return [(0.12, 0.25), (-0.12, 0.6)][: int(rng.integers(1, 3))]
    half = float(rng.uniform(0.7, 1.1))
    arms = tops - 0.35 * _UP
    add_bars(builder, arms - half * across, arms + half * across, 0.06, tint, texture)
    pins = [half - 0.08, -half + 0.08, 0.35 * half]
    for pin in pins:
        foot = arms + pin * across
        add_bars(builder, foot, foot - [0.0, 0.0, 0.2], 0.03, (0.5, 0.5, 0.5))
    if rng.random() < 0.5:
        for foot, top in zip(feet[1::4], tops[1::4], strict=True):
            low = -float(top[2]) - 2.2
            place = (float(foot[0]), float(foot[1]) + 0.4)
            add_box(builder, place, (0.5, 0.5), low, low + 0.8, "paint", (0.5, 0.55, 0.5))
    return [(pin, 0.15) for pin in pins]


def _pylons(
    builder: MeshBuilder, feet: NDArray[np.float64], across: NDArray[np.float64], height: float
) -> list[tuple[float, float]]:
    places = [(0.0, 0.0)]
    for foot in feet:
        add_lattice(builder, foot, foot - [0.0, 0.0, height], (0.16 * height, 0.6), 0.06, bay=1.1)
    for level, reach in ((0.82, 0.22), (0.68, 0.28)):
        for foot, aside in zip(feet, across, strict=True):
            middle = foot - [0.0, 0.0, level * height]
            for side in (-reach * height, reach * height):
                add_lattice(builder, middle, middle + side * aside, (0.9, 0.15), 0.04)
        places += [(side * reach * height, (1 - level) * height + 0.8) for side in (-1.0, 1.0)]
        for side in (-reach * height, reach * height):
            ends = feet - [0.0, 0.0, level * height] + side * across
            add_bars(builder, ends, ends - 0.8 * _UP, 0.05, (0.3, 0.35, 0.3))
    return places


def add_mast(
    builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float, ground_m: float
) -> None:
    """A flagpole, a thin aerial, or a lattice mast held by wires."""
    foot = np.array([north_m, east_m, -ground_m])
    kind = rng.choice(["pole", "aerial", "lattice"], p=[0.5, 0.3, 0.2])
    if kind == "pole":
        height, radius = rng.uniform(4.0, 10.0), rng.uniform(0.03, 0.06)
        add_bars(builder, foot, foot - [0, 0, height], radius, np.full(3, rng.uniform(0.2, 1.0)), sides=6)
        if rng.random() < 0.4:
            wind, width = rng.uniform(0, 2 * np.pi), rng.uniform(0.9, 1.8)
            reach = width * np.array([np.cos(wind), np.sin(wind), 0.12])
            top, low = foot - [0, 0, height - 0.1], foot - [0, 0, height - 0.1 - 0.6 * width]
            corners = [top, top + reach, low + reach, low]
            uv = [(0.0, 0.0), (width, 0.0), (width, 0.6 * width), (0.0, 0.6 * width)]
            builder.add(corners, [(0, 1, 2), (0, 2, 3)], uv, "fabric", rng.uniform(0.2, 1.1, 3))
    elif kind == "aerial":
        height = rng.uniform(6.0, 14.0)
        add_bars(builder, foot, foot - [0, 0, 0.6 * height], 0.045, sides=6)
        add_bars(builder, foot - [0, 0, 0.6 * height], foot - [0, 0, height], 0.02, sides=5)
    else:
        height = rng.uniform(12.0, 26.0)
        top = foot - [0.0, 0.0, height]
        add_lattice(builder, foot, top, (0.4, 0.4), 0.025, (0.3, 0.3, 0.9))
        turn = rng.uniform(0, 2 * np.pi) + np.arange(3) * 2 * np.pi / 3
        ground = foot + 0.4 * height * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
        add_wires(builder, np.repeat(top[None] + [0, 0, 0.1 * height], 3, axis=0), ground, 0.005)
