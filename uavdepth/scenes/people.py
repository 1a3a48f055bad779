"""People who stand and walk, 1.5 to 1.95 m high."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from uavdepth.scenes.bodies import SKINS_BGR, Joints, add_body
from uavdepth.scenes.mesh import Mesh, MeshBuilder
from uavdepth.scenes.stamps import Stamps

HEIGHTS_M = (1.5, 1.95)
_MODELS = 8

TOPS_BGR = np.array(
    [
        (0.15, 0.15, 0.16), (0.95, 0.95, 0.95), (0.25, 0.2, 0.75), (0.65, 0.3, 0.15), (0.3, 0.45, 0.25),
        (0.2, 0.75, 0.95), (0.5, 0.5, 0.5), (0.3, 0.2, 0.12), (0.75, 0.6, 0.95), (0.2, 0.45, 0.9),
    ]
)  # fmt: skip
TROUSERS_BGR = np.array(
    [(0.6, 0.42, 0.3), (0.15, 0.14, 0.14), (0.5, 0.6, 0.68), (0.3, 0.35, 0.32), (0.85, 0.88, 0.9)]
)


class Crowd:
    """Places for people; `build` puts a person, standing or walking, on each.

    Args:
        rng: source of bodies, postures and clothes.
        walking: share of those who walk.
    """

    def __init__(self, rng: np.random.Generator, walking: float = 0.7) -> None:
        makers = [partial(person, walks=number < walking * _MODELS) for number in range(_MODELS)]
        palettes = {"fabric": TOPS_BGR, "denim": TROUSERS_BGR, "skin": SKINS_BGR}
        self._people = Stamps(rng, makers, palettes)

    def __len__(self) -> int:
        return len(self._people)

    def put(self, north_m: float, east_m: float, ground_m: float, heading_rad: float) -> None:
        """A person here, who looks along `heading_rad`."""
        self._people.put(north_m, east_m, ground_m, heading_rad)

    def build(self, builder: MeshBuilder) -> None:
        """Add all people to a mesh."""
        self._people.build(builder)


def person(rng: np.random.Generator, walks: bool = False) -> Mesh:
    """One person at the origin, who looks north."""
    height = float(rng.uniform(*HEIGHTS_M))
    builder = MeshBuilder()
    stride = float(rng.uniform(0.2, 0.42)) if walks else float(rng.uniform(0.0, 0.06))
    add_body(builder, rng, Joints.upright(rng, stride), height)
    mesh = builder.build()
    # A stride lowers the hips: put the lower foot on the ground, and the crown at the height.
    vertices = mesh.vertices_m.copy()
    lowest, highest = vertices[:, 2].max(), vertices[:, 2].min()
    vertices[:, 2] = (vertices[:, 2] - lowest) * np.float32(height / (lowest - highest))
    return replace(mesh, vertices_m=vertices)
