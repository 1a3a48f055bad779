"""Light and air of a day outdoors, drawn at random: sun, sky, haze, clouds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import Color, GroundHeight, SceneDescription
from uavdepth.scenes.mesh import Mesh


@dataclass(frozen=True)
class Weather:
    """The light part of a `SceneDescription`; fields as there."""

    sun_direction_ned: NDArray[np.float64]
    sun_bgr: Color
    ambient_bgr: Color
    sky_top_bgr: Color
    sky_horizon_bgr: Color
    haze_per_m: float
    cloud_amount: float

    def over(self, mesh: Mesh, ground_height_m: GroundHeight, extent_m: float) -> SceneDescription:
        """The world of these parts on this day; arguments as in `SceneDescription`."""
        return SceneDescription(mesh=mesh, ground_height_m=ground_height_m, extent_m=extent_m, **vars(self))


def draw_weather(rng: np.random.Generator, haze_per_m: tuple[float, float]) -> Weather:
    """One day: blue, hazy, overcast, or low warm sun.

    Args:
        rng: source of the day.
        haze_per_m: least and most extinction.
    """
    azimuth = rng.uniform(0.0, 2 * math.pi)
    haze = math.exp(rng.uniform(math.log(haze_per_m[0]), math.log(haze_per_m[1])))
    kind = rng.choice(["blue", "bright", "overcast", "low"], p=[0.4, 0.25, 0.15, 0.2])
    if kind == "low":
        elevation, clouds = rng.uniform(12, 24), rng.uniform(0.1, 0.5)
        sun, ambient = (0.62, 0.86, 1.15), (0.46, 0.40, 0.38)
        top, horizon = (0.72, 0.52, 0.38), (0.72, 0.80, 0.90)
    elif kind == "overcast":
        elevation, clouds = rng.uniform(30, 60), rng.uniform(0.8, 1.0)
        sun, ambient = (0.38, 0.38, 0.38), (0.66, 0.64, 0.62)
        top, horizon = (0.70, 0.67, 0.64), (0.82, 0.80, 0.78)
    elif kind == "bright":
        elevation, clouds = rng.uniform(30, 65), rng.uniform(0.35, 0.7)
        sun, ambient = (0.98, 1.02, 1.05), (0.52, 0.46, 0.42)
        top, horizon = (0.82, 0.58, 0.38), (0.88, 0.84, 0.78)
    else:
        elevation, clouds = rng.uniform(25, 65), rng.uniform(0.0, 0.3)
        sun, ambient = (1.00, 1.08, 1.14), (0.48, 0.40, 0.34)
        top, horizon = (0.78, 0.48, 0.26), (0.90, 0.82, 0.72)
    high = math.radians(elevation)
    direction = np.array(
        [math.cos(azimuth) * math.cos(high), math.sin(azimuth) * math.cos(high), -math.sin(high)]
    )
    shift = rng.uniform(0.92, 1.08, 3)
    return Weather(
        direction,
        _scaled(sun, rng.uniform(0.9, 1.08)),
        _scaled(ambient, rng.uniform(0.85, 1.1)),
        _scaled(top, shift),
        _scaled(horizon, 0.5 + 0.5 * shift),
        haze,
        float(clouds),
    )


def _scaled(color: Color, factor: float | NDArray[np.float64]) -> Color:
    blue, green, red = np.asarray(color) * factor
    return float(blue), float(green), float(red)
