"""Small worlds for the tests of the flight evaluation: flat ground, and what each test puts on it."""

from __future__ import annotations

import numpy as np

from service.flight_evaluation.routes import Route
from service.settings import Settings
from uavdepth.scenes import Scene
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Rect, add_box, add_slab
from uavdepth.scenes.terrain import level_ground
from uavdepth.scenes.weather import draw_weather

NORTH = Route(0.0, 0.0, 0.0, 3.0, 16.0)
"""From the origin straight north, 3 m high, 16 m to the wall."""

SMALL = Settings.model_validate(
    {
        "camera": {"source": "sim:wall", "width": 192, "height": 96, "horizontal_fov_deg": 90.0},
        "mount": {"pitch_deg": -10.0, "forward_m": 0.1},
        "scan": {"below_m": 2.0, "above_m": 1.5},
    }
)


def world_with(*boxes: tuple[float, float, float, float, float]) -> Scene:
    """Flat ground with boxes: north and east of the middle, size north and east, height, in metres."""
    builder = MeshBuilder()
    add_slab(builder, Rect(-300.0, 300.0, -300.0, 300.0), 0.0, "concrete")
    for north_m, east_m, long_m, wide_m, high_m in boxes:
        add_box(builder, (north_m, east_m), (long_m, wide_m), 0.0, high_m, "brick")
    weather = draw_weather(np.random.default_rng(0), (0.001, 0.002))
    return Scene("plain", 0, weather.over(builder.build(), level_ground, 40.0))


WALL_AHEAD = (16.5, 0.0, 1.0, 60.0, 8.0)
"""A wall across the way north, its face 16 m from the origin."""
