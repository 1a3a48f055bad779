"""Wheels of vehicles."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import tube

_PROUD_M = 0.015
"""How far wheels stand out of the body's side, so that no two faces share a plane."""

_SIDES = 8
_TYRE, _DISC = (1.0, 1.0, 1.0), (2.2, 2.2, 2.2)


def add_wheel(
    builder: MeshBuilder, ahead_m: float, side_m: float, radius_m: float = 0.31, width_m: float = 0.2
) -> None:
    """A wheel that stands on down = 0 and rolls north, its middle `ahead_m` and `side_m` from the origin."""
    hub = np.array([ahead_m, side_m, -radius_m])
    out = 0.5 * width_m + _PROUD_M
    line = hub + np.outer((-out - 0.01, -out, out, out + 0.01), (0.0, 1.0, 0.0))
    (vertices, faces), uv = tube(line, np.array([0.02, 1.0, 1.0, 0.02]) * radius_m, _SIDES)
    on_tread = (np.arange(len(faces)) % (3 * _SIDES)) // _SIDES == 1
    builder.add(vertices, faces, uv, "rubber", np.where(on_tread[:, None], _TYRE, _DISC))
