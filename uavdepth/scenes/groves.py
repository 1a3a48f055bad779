"""Trees as templates, and a stand of them too dense to fly through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.copies import Template, add_copies
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.undergrowth import add_bush
from uavdepth.scenes.vegetation import TreeKind, add_tree


def tree_template(rng: np.random.Generator, kind: TreeKind, height_m: float, autumn: float) -> Template:
    """A tree to copy; arguments as in `add_tree`."""
    radius = height_m * rng.uniform(0.012, 0.03)
    return Template.of(
        lambda builder: add_tree(builder, rng, 0.0, 0.0, 0.0, height_m, kind, radius, autumn), height_m
    )


def add_tree_wall(
    builder: MeshBuilder,
    rng: np.random.Generator,
    kind: TreeKind,
    autumn: float,
    north_m: float,
    half_width_m: float,
) -> None:
    """Bushes, a rank of young trees and three ranks of tall ones on ground at height 0, `north_m` north of
    the origin and `half_width_m` to both sides."""
    for rank, (low_m, high_m) in enumerate(((4.5, 7.5), (10.5, 15.0), (10.5, 15.0), (11.0, 16.0))):
        east = np.arange(-half_width_m, half_width_m + 0.1, 1.5) + 0.75 * (rank % 2)
        north = north_m + 1.6 * rank + rng.uniform(-0.4, 0.4, len(east))
        feet = np.column_stack([north, east + rng.uniform(-0.2, 0.2, len(east)), np.zeros(len(east))])
        heights = rng.uniform(low_m, high_m, len(east))
        which = rng.integers(3, size=len(east))
        for number in range(3):
            template = tree_template(rng, kind, 0.5 * (low_m + high_m), 0.0)
            add_copies(builder, rng, template, feet[which == number], heights[which == number])
    for east_m in np.arange(-half_width_m, half_width_m + 0.1, 1.1):
        place = north_m - 0.4 + rng.uniform(-0.3, 0.5)
        add_bush(builder, rng, place, east_m, 0.0, rng.uniform(1.6, 2.6), autumn)


def plant(
    builder: MeshBuilder,
    rng: np.random.Generator,
    templates: list[Template],
    feet_ned_m: NDArray[np.float64],
    heights_m: NDArray[np.float64],
) -> None:
    """Copies of random ones of the templates at (K, 3) feet with (K,) heights."""
    which = rng.integers(len(templates), size=len(feet_ned_m))
    for number, template in enumerate(templates):
        here = which == number
        add_copies(builder, rng, template, feet_ned_m[here], heights_m[here])
