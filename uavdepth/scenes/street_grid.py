"""The plan of a town: streets in a grid, blocks between them, the height of the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.description import GroundHeight
from uavdepth.scenes.solids import Rect

KERB_M = 0.15
PAVEMENT_M = 4.0
REACH_M = 130.0
"""How far from the origin streets are laid; houses go on for another block."""

CORRIDOR_M = 3.4
"""Nothing but the ground stands nearer than this to the straight line north of the origin."""


@dataclass(frozen=True)
class Street:
    """A street by its middle line and half the width of its lanes, metres; the asphalt goes on to the kerbs
    for the width of a pavement."""

    middle_m: float
    half_road_m: float

    @property
    def half_width_m(self) -> float:
        """From the middle line to the kerb."""
        return self.half_road_m + PAVEMENT_M


def draw_street(rng: np.random.Generator) -> Street:
    """A street of random width through the origin."""
    return Street(0.0, float(rng.uniform(3.5, 6.5)))


def parallel_streets(
    rng: np.random.Generator,
    first: Street,
    apart_m: tuple[float, float] = (42.0, 64.0),
    half_road_m: tuple[float, float] = (3.5, 6.5),
) -> list[Street]:
    """Streets on both sides of `first`, sorted, of random distances and widths between two bounds."""
    streets = [first]
    for side in (-1.0, 1.0):
        place = first.middle_m
        while abs(place - first.middle_m) < REACH_M - 40.0:
            place += side * rng.uniform(*apart_m)
            streets.append(Street(place, float(rng.uniform(*half_road_m))))
    return sorted(streets, key=lambda street: street.middle_m)


def _gaps(streets: list[Street]) -> list[tuple[float, float]]:
    """The stretches between streets, and the ones beyond the outermost."""
    edges = [-REACH_M - 60.0]
    for street in streets:
        edges += [street.middle_m - street.half_width_m, street.middle_m + street.half_width_m]
    edges.append(REACH_M + 60.0)
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(low + PAVEMENT_M, high - PAVEMENT_M) for low, high in pairs if high - low > 16.0]


def draw_blocks(easts: list[Street], norths: list[Street], facade_m: float) -> list[Rect]:
    """Plots between the streets, without their pavements; north of the facade the street is built over."""
    blocks = []
    for north_low, north_high in _gaps(norths):
        behind = abs(north_low - PAVEMENT_M - facade_m) < 1.0
        streets = [street for street in easts if not (behind and street.middle_m == 0.0)]
        for east_low, east_high in _gaps(streets):
            low = facade_m if behind else north_low
            blocks.append(Rect(low, north_high, east_low, east_high))
    return blocks


def off_corridor(north_m: float, east_m: float, reach_m: float) -> bool:
    """Whether a thing stands clear of the line that the vehicle takes north from the origin."""
    return not (-6.0 < north_m < 46.0 and abs(east_m) < CORRIDOR_M + reach_m)


def ground_height(blocks: list[Rect]) -> GroundHeight:
    """Pavement and plots one kerb above the roads."""
    low = np.array([(b.north_low_m - PAVEMENT_M, b.east_low_m - PAVEMENT_M) for b in blocks])
    high = np.array([(b.north_high_m + PAVEMENT_M, b.east_high_m + PAVEMENT_M) for b in blocks])

    def height(north_m: ArrayLike, east_m: ArrayLike) -> NDArray[np.float64]:
        place = np.stack(np.broadcast_arrays(north_m, east_m), axis=-1).astype(float)[..., None, :]
        inside = ((place >= low) & (place <= high)).all(axis=-1).any(axis=-1)
        return np.where(inside, KERB_M, 0.0)

    return height
