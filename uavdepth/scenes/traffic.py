"""Traffic on the lanes of roads, caught at one moment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from uavdepth.scenes.bodies import SKINS_BGR
from uavdepth.scenes.cars import PAINTS_BGR, car
from uavdepth.scenes.cycles import cyclist
from uavdepth.scenes.lorries import bus, lorry
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.people import TOPS_BGR, TROUSERS_BGR
from uavdepth.scenes.stamps import ModelMaker, Stamps


@dataclass(frozen=True)
class VehicleKind:
    """What takes part in traffic.

    Args:
        name: of the kind.
        share: how much of the traffic it is.
        half_length_m, half_width_m: of the largest.
        models: different ones in one world.
    """

    name: str
    share: float
    half_length_m: float
    half_width_m: float
    models: int


KINDS = (
    VehicleKind("car", 0.5, 2.4, 0.95, 4),
    VehicleKind("van", 0.13, 2.85, 1.0, 2),
    VehicleKind("lorry", 0.12, 5.1, 1.25, 3),
    VehicleKind("bus", 0.08, 6.2, 1.25, 1),
    VehicleKind("cyclist", 0.17, 0.95, 0.35, 3),
)
_MAKERS: dict[str, ModelMaker] = {
    "car": car,
    "van": partial(car, van=True),
    "lorry": lorry,
    "bus": bus,
    "cyclist": cyclist,
}


class Traffic:
    """Vehicles on lanes.

    Args:
        rng: source of kinds, models, colours and gaps.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        colors = {"paint": PAINTS_BGR, "fabric": TOPS_BGR, "denim": TROUSERS_BGR, "skin": SKINS_BGR}
        taken: dict[str, tuple[str, ...]] = {"cyclist": tuple(colors)}
        self._stamps = {
            kind.name: Stamps(
                rng,
                [_MAKERS[kind.name]] * kind.models,
                {name: colors[name] for name in taken.get(kind.name, ("paint",))},
            )
            for kind in KINDS
        }

    def draw(self, half_lane_m: float) -> VehicleKind:
        """A kind that fits into a lane of that half width."""
        fitting = [kind for kind in KINDS if kind.half_width_m <= half_lane_m]
        shares = np.array([kind.share for kind in fitting])
        return fitting[int(self._rng.choice(len(fitting), p=shares / shares.sum()))]

    def put(
        self, kind: VehicleKind, north_m: float, east_m: float, ground_m: float, heading_rad: float
    ) -> None:
        """A vehicle here, its nose along `heading_rad`."""
        self._stamps[kind.name].put(north_m, east_m, ground_m, heading_rad)

    def build(self, builder: MeshBuilder) -> None:
        """Add all vehicles to a mesh."""
        for stamps in self._stamps.values():
            if len(stamps):
                stamps.build(builder)
