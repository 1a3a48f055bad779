"""Parked cars and vans of true size."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.mesh import Mesh, MeshBuilder
from uavdepth.scenes.shapes import tube
from uavdepth.scenes.solids import add_box

_COLORS_BGR = np.array(
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
_MODELS = 6
_VAN_SHARE = 0.2


@dataclass
class CarPark:
    """Places for cars; `build` puts one of a few models, in many colours, on each.

    Args:
        rng: source of models and colours.
    """

    rng: np.random.Generator
    _places: list[tuple[float, float, float, float]] = field(default_factory=list)

    def park(self, north_m: float, east_m: float, ground_m: float, heading_rad: float) -> None:
        """A car here, its nose along `heading_rad`."""
        self._places.append((north_m, east_m, ground_m, heading_rad))

    def build(self, builder: MeshBuilder) -> None:
        """Add all cars to a mesh."""
        places = np.array(self._places, float).reshape(-1, 4)
        which = self.rng.integers(_MODELS, size=len(places))
        colors = _COLORS_BGR[self.rng.integers(len(_COLORS_BGR), size=len(places))]
        colors = colors * self.rng.uniform(0.8, 1.0, (len(places), 1))
        for number in range(_MODELS):
            model = _model(self.rng, number < _MODELS * _VAN_SHARE)
            here = which == number
            if here.any():
                _stamp(builder, model, places[here], colors[here])


def _stamp(
    builder: MeshBuilder, model: Mesh, places: NDArray[np.float64], colors: NDArray[np.float64]
) -> None:
    cosine, sine = np.cos(places[:, 3])[:, None], np.sin(places[:, 3])[:, None]
    for number, texture in enumerate(model.texture_names):
        part = model.texture == number
        used, local = np.unique(model.faces[part], return_inverse=True)
        ahead, right, down = model.vertices_m[used].T.astype(float)
        vertices = np.empty((len(places), len(used), 3))
        vertices[..., 0] = places[:, :1] + cosine * ahead - sine * right
        vertices[..., 1] = places[:, 1:2] + sine * ahead + cosine * right
        vertices[..., 2] = down - places[:, 2:3]
        faces = local.reshape(1, -1, 3) + len(used) * np.arange(len(places))[:, None, None]
        uv = np.broadcast_to(model.uv_m[part], (len(places), int(part.sum()), 3, 2))
        tint = np.broadcast_to(model.tint[part], (len(places), int(part.sum()), 3))
        if texture == "paint":
            tint = tint * colors[:, None]
        builder.add(
            vertices.reshape(-1, 3), faces.reshape(-1, 3), uv.reshape(-1, 3, 2), texture, tint.reshape(-1, 3)
        )


def _model(rng: np.random.Generator, van: bool) -> Mesh:
    """A car at the origin, its nose to the north; parts of texture "paint" take the car's colour."""
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
    for ahead in (0.31 * length, -0.31 * length):
        for side in (0.5 * width - 0.1, -0.5 * width + 0.1):
            hub = np.array([ahead, side, -0.31])
            axle = np.array([0.0, 0.1, 0.0])
            (vertices, faces), uv = tube([hub - axle, hub, hub + axle], [0.31, 0.31, 0.31], 10)
            builder.add(vertices, faces, uv, "rubber")
            add_box(builder, (ahead, side), (0.36, 0.2), 0.13, 0.49, "rubber", (2.0, 2.0, 2.0))
    for end, tint in ((0.5, (2.6, 2.8, 2.8)), (-0.5, (0.4, 0.4, 3.0))):
        for side in (0.36 * width, -0.36 * width):
            place = (end * length, side)
            add_box(builder, place, (0.05, 0.3), waist - 0.3, waist - 0.14, "rubber", tint)
    return builder.build()
