"""Copies of models that keep their size: vehicles and people at places and headings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.mesh import Mesh, MeshBuilder

ModelMaker = Callable[[np.random.Generator], Mesh]
"""Makes one model at the origin, its nose to the north, standing on down = 0."""


@dataclass
class Stamps:
    """Places for a few models in many colours.

    Args:
        rng: source of models and colours.
        makers: one for each model.
        palettes: (C, 3) BGR factors that copies draw from, for each texture that takes a colour.
    """

    rng: np.random.Generator
    makers: Sequence[ModelMaker]
    palettes: Mapping[str, NDArray[np.float64]]
    _places: list[tuple[float, float, float, float]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._places)

    def put(self, north_m: float, east_m: float, ground_m: float, heading_rad: float) -> None:
        """One copy here, its nose along `heading_rad`."""
        self._places.append((north_m, east_m, ground_m, heading_rad))

    def build(self, builder: MeshBuilder) -> None:
        """Add all copies to a mesh."""
        places = np.array(self._places, float).reshape(-1, 4)
        which = self.rng.integers(len(self.makers), size=len(places))
        colors = {name: self._draw(palette, len(places)) for name, palette in self.palettes.items()}
        for number, make in enumerate(self.makers):
            model = make(self.rng)
            here = which == number
            if here.any():
                _add(builder, model, places[here], {name: color[here] for name, color in colors.items()})

    def _draw(self, palette: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        picked = palette[self.rng.integers(len(palette), size=count)]
        return np.asarray(picked * self.rng.uniform(0.8, 1.0, (count, 1)))


def _add(
    builder: MeshBuilder,
    model: Mesh,
    places: NDArray[np.float64],
    colors: Mapping[str, NDArray[np.float64]],
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
        if texture in colors:
            tint = tint * colors[texture][:, None]
        builder.add(
            vertices.reshape(-1, 3),
            faces.reshape(-1, 3),
            uv.reshape(-1, 3, 2),
            texture,
            tint.reshape(-1, 3),
            smooth=bool(model.smooth[part][0]),
        )
