"""Parked cars and vans of true size."""

from __future__ import annotations

from functools import partial

import numpy as np

from uavdepth.scenes.mesh import Mesh, MeshBuilder
from uavdepth.scenes.solids import add_box
from uavdepth.scenes.stamps import Stamps
from uavdepth.scenes.wheels import add_wheel

PAINTS_BGR = np.array(
    [
        (1.1, 1.1, 1.1),
        (0.25, 0.25, 0.27),
        (0.55, 0.57, 0.6),
        (0.25, 0.25, 0.95),
        (0.85, 0.45, 0.2),
        (0.35, 0.6, 0.3),
        (0.3, 0.75, 1.0),
    ]
)
"""Colours of vehicles."""

_MODELS = 6
_VAN_SHARE = 0.2


class CarPark:
    """Places for cars; `build` puts one of a few models, in many colours, on each.

    Args:
        rng: source of models and colours.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        makers = [partial(car, van=number < _MODELS * _VAN_SHARE) for number in range(_MODELS)]
        self._cars = Stamps(rng, makers, {"paint": PAINTS_BGR})

    def park(self, north_m: float, east_m: float, ground_m: float, heading_rad: float) -> None:
        """A car here, its nose along `heading_rad`."""
        self._cars.put(north_m, east_m, ground_m, heading_rad)

    def build(self, builder: MeshBuilder) -> None:
        """Add all cars to a mesh."""
        self._cars.build(builder)


def car(rng: np.random.Generator, van: bool = False) -> Mesh:
    """A car or a delivery van; parts of texture "paint" take its colour."""
    builder = MeshBuilder()
    length = rng.uniform(4.8, 5.6) if van else rng.uniform(3.7, 4.7)
    width = rng.uniform(1.9, 2.0) if van else rng.uniform(1.68, 1.84)
    waist = 1.05 if van else rng.uniform(0.78, 0.92)
    roof = rng.uniform(1.95, 2.3) if van else rng.uniform(1.4, 1.55)
    cabin = (length * (0.92 if van else 0.6), width * 0.94)
    back = (-0.03 * length if van else -0.07 * length, 0.0)
    taper = 0.92 if van else 0.78
    add_box(builder, (0.0, 0.0), (length, width), 0.28, waist, "paint")
    add_box(builder, back, cabin, waist, roof - 0.06, "car_glass", taper=taper)
    add_box(builder, back, (cabin[0] * taper + 0.04, cabin[1] * taper + 0.04), roof - 0.07, roof, "paint")
    if van and length > 5.1:  # a panel van
        panel = (back[0] - 0.17 * length, 0.0)
        add_box(builder, panel, (0.6 * length, width * 0.95), waist, roof - 0.03, "paint", taper=0.93)
    for ahead in (0.31 * length, -0.31 * length):
        for side in (0.5 * width - 0.1, -0.5 * width + 0.1):
            add_wheel(builder, ahead, side)
    for end, tint in ((0.5, (2.6, 2.8, 2.8)), (-0.5, (0.4, 0.4, 3.0))):
        for side in (0.36 * width, -0.36 * width):
            place = (end * length, side)
            add_box(builder, place, (0.05, 0.3), waist - 0.3, waist - 0.14, "rubber", tint)
    return builder.build()
