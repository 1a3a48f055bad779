"""`wires`: poles, masts and wires hung low across open ground. Test only: no network is trained on it."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.bars import add_bars, add_wires
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.fences import add_fence
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.overhead import add_mast
from uavdepth.scenes.plots import add_patches, patch_lines
from uavdepth.scenes.terrain import level_ground
from uavdepth.scenes.weather import draw_weather

_HORIZON_M = 700.0
_HALF_M = 80.0
_ROW_M = 32.0
"""Between two rows of wires: room to fly along, and to approach one."""

_WIRE_HEIGHTS_M = (1.5, 2.2, 2.9, 3.6, 4.3, 5.0)
_CABLE_RADIUS_M = 0.02
"""40 mm, a trunk cable: a pixel of a 384 pixels wide picture of 90 degrees sees that much at 8 m."""


def build(seed: int) -> SceneDescription:
    """Rows of poles across the way north, with wires between them at heights that a vehicle flies at."""
    rng = np.random.default_rng([seed, 0x317E])
    builder = MeshBuilder()
    ground = str(rng.choice(["grass", "gravel", "asphalt", "soil"]))
    lines = patch_lines(_HALF_M, 16.0, _HORIZON_M)
    add_patches(builder, lines, lambda _: (ground, np.full(3, rng.uniform(0.85, 1.1))))
    for north_m in np.arange(-_HALF_M + 10.0, _HALF_M, _ROW_M):
        _add_row(builder, rng, float(north_m + rng.uniform(-2.0, 2.0)))
    weather = draw_weather(rng, (0.0005, 0.004))
    return weather.over(builder.build(), level_ground, _HALF_M - 10.0)


def _add_row(builder: MeshBuilder, rng: np.random.Generator, north_m: float) -> None:
    """One row across: wires between poles, single poles, a fence of bars, or masts."""
    kind = int(rng.integers(4))
    easts = np.arange(-_HALF_M, _HALF_M + 1.0, 10.0 if kind < 2 else 5.0)
    feet = np.column_stack(
        [np.full_like(easts, north_m), easts + rng.uniform(-0.5, 0.5, len(easts)), 0 * easts]
    )
    if kind < 2:
        add_bars(builder, feet, feet - [0.0, 0.0, 5.6], 0.12, (0.8, 0.8, 0.8), "bark", sides=7)
        for height_m in _WIRE_HEIGHTS_M:
            ends = feet - [0.0, 0.0, height_m]
            add_wires(builder, ends[:-1], ends[1:], 0.01, _CABLE_RADIUS_M)
    elif kind == 2:
        add_bars(builder, feet, feet - [0.0, 0.0, 7.0], 0.06, (0.6, 0.6, 0.62), sides=6)
    else:
        add_fence(builder, rng, [tuple(feet[0]), tuple(feet[-1])], "chain")
        for foot in feet[::4]:
            add_mast(builder, rng, float(foot[0]) + 3.0, float(foot[1]), 0.0)
