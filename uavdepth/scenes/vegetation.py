"""Trees of a few hundred triangles each, with crowns ragged enough to look grown."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv, lumpy_sphere
from uavdepth.scenes.tree_parts import ROOT_DEPTH_M, add_leaf_ball, add_trunk, add_tube, leaf_tint

TreeKind = Literal["broadleaf", "poplar", "birch", "conifer", "snowy_conifer", "dead", "bare"]


def add_tree(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_down_m: float,
    height_m: float,
    kind: TreeKind = "broadleaf",
    trunk_radius_m: float | None = None,
    autumn: float = 0.0,
) -> None:
    """Plant one tree.

    Args:
        builder: the scene's mesh.
        rng: source of its shape and colour.
        north_m, east_m: foot of the trunk.
        ground_down_m: the ground there, NED down.
        height_m: from the ground to the top.
        kind: what grows; "birch" is a slender broadleaf with white bark, "bare" a broadleaf in winter,
            "dead" a snag.
        trunk_radius_m: at breast height; None takes one that suits the height.
        autumn: chance that the leaves are yellow to red, 0 to 1.
    """
    foot = np.array([north_m, east_m, ground_down_m])
    radius = height_m * rng.uniform(0.014, 0.022) if trunk_radius_m is None else trunk_radius_m
    tint = leaf_tint(rng, autumn)
    if kind in ("conifer", "snowy_conifer"):
        _conifer(builder, rng, foot, height_m, radius, kind == "snowy_conifer")
    elif kind == "dead":
        _dead(builder, rng, foot, height_m, radius)
    elif kind == "bare":
        _bare(builder, rng, foot, height_m, radius)
    elif kind == "poplar":
        add_trunk(builder, rng, foot, 0.6 * height_m, radius, "bark", sway=0.02)
        middle = foot - [0.0, 0.0, 0.58 * height_m]
        spread = height_m * rng.uniform(0.09, 0.13)
        add_leaf_ball(builder, rng, middle, (spread, spread, 0.43 * height_m), tint, 2, shards=26)
    else:
        slender = kind == "birch"
        _broadleaf(builder, rng, foot, height_m, radius, tint, slender)


def _broadleaf(
    builder: MeshBuilder,
    rng: np.random.Generator,
    foot: NDArray[np.float64],
    height_m: float,
    radius_m: float,
    tint: NDArray[np.float64],
    slender: bool,
) -> None:
    bark = "birch_bark" if slender else "bark"
    line = add_trunk(builder, rng, foot, 0.8 * height_m, radius_m, bark, sway=0.035)
    spread = 0.6 if slender else 1.0
    boughs = 3
    turn = rng.uniform(0.0, 2 * np.pi)
    for bough in range(boughs):
        heading = turn + 2 * np.pi * bough / boughs + rng.normal(0.0, 0.3)
        reach = spread * height_m * rng.uniform(0.14, 0.24)
        top = foot[2] - height_m * rng.uniform(0.5, 0.72)
        tip = np.array([line[3, 0] + reach * np.cos(heading), line[3, 1] + reach * np.sin(heading), top])
        add_tube(builder, np.array([line[2], tip]), [0.45 * radius_m, 0.03], 4, bark, np.ones(3))
        size = spread * height_m * rng.uniform(0.15, 0.22)
        add_leaf_ball(builder, rng, tip, (size, size, size * (1.1 if slender else 0.8)), tint, 1, shards=11)
    size = spread * height_m * rng.uniform(0.17, 0.22)
    rise = height_m * 0.2
    add_leaf_ball(builder, rng, line[4] + [0, 0, 0.2 * rise], (size, size, rise), tint * 1.08, 1, shards=11)


def _conifer(
    builder: MeshBuilder,
    rng: np.random.Generator,
    foot: NDArray[np.float64],
    height_m: float,
    radius_m: float,
    snowy: bool,
) -> None:
    """Skirts of drooping boughs around a straight trunk, each skirt a star whose tips hang."""
    add_trunk(builder, rng, foot, 0.9 * height_m, radius_m, "bark", sway=0.006)
    tiers = int(np.clip(height_m * 0.7, 5, 8))
    boughs = 8
    bare = rng.uniform(0.06, 0.22)
    width = height_m * rng.uniform(0.16, 0.24)
    shape = np.linspace(0.0, 1.0, tiers)
    corner_list, face_list, offset = [], [], 0
    for tier in shape:
        low = height_m * (bare + (0.93 - bare) * tier * rng.uniform(0.97, 1.0))
        rise = height_m * (0.24 - 0.12 * tier)
        reach = width * (1.0 - tier) ** 0.85 + 0.05 * height_m * 0.5
        turn = rng.uniform(0.0, 2 * np.pi) + np.arange(2 * boughs) * np.pi / boughs
        out = reach * np.where(np.arange(2 * boughs) % 2, 0.5, 1.0) * rng.uniform(0.8, 1.15, 2 * boughs)
        hang = np.where(np.arange(2 * boughs) % 2, 0.35, -0.12) * rise * rng.uniform(0.6, 1.2, 2 * boughs)
        ring = np.column_stack([out * np.cos(turn), out * np.sin(turn), -(low + hang)])
        apex = np.array([[0.0, 0.0, -min(low + rise, height_m)], [0.0, 0.0, -(low + 0.4 * rise)]])
        corner_list.append(np.concatenate([ring, apex]))
        here = np.arange(2 * boughs)
        after = (here + 1) % (2 * boughs)
        top = np.stack([here, after, np.full_like(here, 2 * boughs)], axis=1)
        below = np.stack([after, here, np.full_like(here, 2 * boughs + 1)], axis=1)
        face_list.append(np.concatenate([top, below]) + offset)
        offset += 2 * boughs + 2
    corners = np.concatenate(corner_list)
    faces = np.concatenate(face_list).astype(np.int32)
    tint = np.array([0.8, 1.0, 0.85]) * rng.uniform(0.7, 1.1)
    # The foot anchors the texture, so that neighbours do not show the same spot of it.
    anchored = box_uv(corners + foot, faces)
    under = np.tile(np.repeat([False, True], 2 * boughs), tiers)
    shade = np.where(under, 0.6, 1.0) * rng.uniform(0.85, 1.12, len(faces))
    for part, texture in ((under, "needles"), (~under, "snowy_needles" if snowy else "needles")):
        part_tint = np.ones(3) if texture == "snowy_needles" else tint
        builder.add(corners + foot, faces[part], anchored[part], texture, part_tint * shade[part, None])


def _dead(
    builder: MeshBuilder,
    rng: np.random.Generator,
    foot: NDArray[np.float64],
    height_m: float,
    radius_m: float,
) -> None:
    line = add_trunk(builder, rng, foot, height_m, radius_m, "bark", sway=0.03)
    for _ in range(int(rng.integers(8, 14))):
        part = rng.uniform(1.2, 3.9)
        start = line[int(part)] + (part % 1) * (line[int(part) + 1] - line[int(part)])
        heading = rng.uniform(0.0, 2 * np.pi)
        reach = height_m * rng.uniform(0.06, 0.2)
        bend = start + reach * np.array([np.cos(heading), np.sin(heading), -rng.uniform(0.1, 0.9)])
        tip = bend + 0.6 * reach * (rng.normal(0.0, 0.5, 3) - [0.0, 0.0, 0.5])
        add_tube(
            builder,
            np.array([start, bend, tip]),
            [0.3 * radius_m, 0.15 * radius_m, 0.01],
            4,
            "bark",
            np.ones(3),
        )


def _bare(
    builder: MeshBuilder,
    rng: np.random.Generator,
    foot: NDArray[np.float64],
    height_m: float,
    radius_m: float,
) -> None:
    """Rising boughs, each with a fan of twigs: the crown of a broadleaf without leaves."""
    line = add_trunk(builder, rng, foot, 0.78 * height_m, radius_m, "bark", sway=0.03)
    boughs = 9
    turn = rng.uniform(0.0, 2 * np.pi)
    roots, tips = [], []
    for bough in range(boughs):
        part = 1.7 + 2.2 * bough / (boughs - 1)
        start = line[int(part)] + (part % 1) * (line[min(int(part) + 1, 4)] - line[int(part)])
        heading = turn + 2.4 * bough + rng.normal(0.0, 0.2)
        out = np.array([np.cos(heading), np.sin(heading), 0.0])
        reach, rise = height_m * rng.uniform(0.14, 0.24), height_m * rng.uniform(0.12, 0.24)
        bend = start + 0.6 * reach * out - [0.0, 0.0, 0.4 * rise]
        tip = start + reach * out - [0.0, 0.0, rise]
        thick = radius_m * np.array([0.42, 0.28, 0.12])
        add_tube(builder, np.array([start, bend, tip]), thick, 4, "bark", np.full(3, 0.9))
        for root in np.linspace(bend, tip, 4):
            twig = 0.5 * (tip - start) + reach * rng.normal(0.0, 0.5, 3) - [0.0, 0.0, 0.2 * rise]
            roots.append(root)
            tips.append(root + rng.uniform(0.5, 0.8) * twig)
    add_bars(builder, roots, tips, 0.0028 * height_m, (0.8, 0.8, 0.8), "bark", sides=3)


def add_far_tree(builder: MeshBuilder, rng: np.random.Generator, height_m: float, kind: TreeKind) -> None:
    """Grow a tree of few triangles at the origin, for where it is only seen from afar."""
    if kind in ("conifer", "snowy_conifer"):
        crown = "needles" if kind == "conifer" else "snowy_needles"
        for low in (0.1, 0.36, 0.62):
            turn = np.arange(7) * 2 * np.pi / 7 + rng.uniform(0, 1)
            out = height_m * (0.2 - 0.17 * low) * rng.uniform(0.8, 1.2, 7)
            ring = np.column_stack([out * np.cos(turn), out * np.sin(turn), np.full(7, -low * height_m)])
            cone = np.vstack([ring, [0.0, 0.0, -min(low + 0.45, 1.0) * height_m]])
            faces = np.stack([np.arange(7), (np.arange(7) + 1) % 7, np.full(7, 7)], axis=1)
            builder.add(cone, faces, box_uv(cone, faces), crown, np.full(3, rng.uniform(0.7, 1.0)))
    elif kind not in ("dead", "bare"):
        width, half = 0.24 * height_m, 0.36 * height_m
        vertices, faces = lumpy_sphere(rng, 1, (width, width, half), 0.2, 0.08)
        vertices = vertices - [0.0, 0.0, 0.62 * height_m]
        builder.add(vertices, faces, box_uv(vertices, faces), "leaves", leaf_tint(rng, 0.0))
    line = np.array([[0.0, 0.0, ROOT_DEPTH_M], [0.0, 0.0, -0.6 * height_m]])
    add_tube(builder, line, [0.02 * height_m, 0.01 * height_m], 4, "bark", np.ones(3))
