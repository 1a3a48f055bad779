"""What a scene module hands to the renderer: the mesh, the ground beneath it, the light and the air."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.mesh import Mesh

GroundHeight = Callable[[ArrayLike, ArrayLike], NDArray[np.float64]]
"""Height of the bare ground in metres, up positive, for north and east in metres (any equal shapes)."""

TextureMaker = Callable[[np.random.Generator], NDArray[np.uint8]]
"""Paints one tileable (S, S, 3) uint8 BGR picture, S a power of two, or (S, S, 4) where the fourth channel
is gloss: 0 dull, 255 reflects the sky as glass or water does."""

Color = tuple[float, float, float]
"""Blue, green, red. Colours of light are linear factors: 1.0 shows a texture as it was painted."""


@dataclass(frozen=True)
class TextureSource:
    """How to paint one texture, and how large it is in the world.

    Args:
        make: paints the picture from a random generator (each scene seed gets its own variant).
            The picture shows the material in plain diffuse light, without shadows of the sun.
        size_m: metres that one repetition spans, in both directions.
        vertical: whether the picture has an upright direction; documentation only.
    """

    make: TextureMaker
    size_m: float
    vertical: bool = False


@dataclass(frozen=True)
class SceneDescription:
    """One world before it is loaded into the renderer.

    Args:
        mesh: triangles in NED metres. Surfaces are drawn on both sides; closed solids should wind their
            faces so that cross(v1 - v0, v2 - v0) points outwards (used to tell inside from outside).
        ground_height_m: height of bare ground (no objects), up positive.
        sun_direction_ned: (3,) unit vector towards the sun; its down component is negative by day.
        sun_bgr: light of the sun on a surface that faces it, about 0.8 to 1.3.
        ambient_bgr: light of the sky on a surface that faces up, about 0.3 to 0.6; surfaces facing
            down get about half.
        sky_top_bgr: colour of the sky overhead, 0 to 1.
        sky_horizon_bgr: colour of the sky at the horizon and of the haze, 0 to 1.
        haze_per_m: extinction: a surface at distance d keeps exp(-haze_per_m * d) of its own colour.
        cloud_amount: 0 (blue sky) to 1 (closed cover).
        extent_m: half the side of the square around the origin that is worth flying in.
    """

    mesh: Mesh
    ground_height_m: GroundHeight
    sun_direction_ned: NDArray[np.float64]
    sun_bgr: Color
    ambient_bgr: Color
    sky_top_bgr: Color
    sky_horizon_bgr: Color
    haze_per_m: float
    cloud_amount: float
    extent_m: float
