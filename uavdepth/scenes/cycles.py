"""Bicycles, ridden and parked."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.bars import add_bars, add_path_of_bars
from uavdepth.scenes.bodies import Joints, add_body
from uavdepth.scenes.mesh import Mesh, MeshBuilder

_WHEEL_M = 0.34
_AXLES_M = (0.53, -0.52)
_SADDLE_M = 0.95


def add_bicycle(builder: MeshBuilder) -> None:
    """A bicycle that stands on down = 0 at the origin, its nose to the north."""
    turn = np.linspace(0.0, 2 * np.pi, 13)
    for ahead in _AXLES_M:
        rim = np.column_stack(
            [ahead + _WHEEL_M * np.cos(turn), 0.0 * turn, _WHEEL_M * np.sin(turn) - _WHEEL_M]
        )
        add_path_of_bars(builder, rim, 0.022, (1.0, 1.0, 1.0), "rubber", sides=3)
        spokes = rim[[0, 2, 4]], rim[[6, 8, 10]]
        add_bars(builder, *spokes, 0.004, (0.6, 0.6, 0.6), sides=3)
    front, rear = (np.array([ahead, 0.0, -_WHEEL_M]) for ahead in _AXLES_M)
    pedals, saddle = np.array([-0.02, 0.0, -0.3]), np.array([-0.2, 0.0, -_SADDLE_M + 0.06])
    fork, bar = np.array([0.4, 0.0, -0.75]), np.array([0.36, 0.0, -1.0])
    frame = [(pedals, saddle), (pedals, fork), (saddle, fork), (pedals, rear), (saddle, rear), (fork, front)]
    seat, grips = np.array([0.12, 0.0, 0.0]), np.array([0.0, 0.28, 0.0])
    frame += [(fork, bar), (saddle - seat, saddle + seat), (bar - grips, bar + grips)]
    starts, ends = np.array(frame).transpose(1, 0, 2)
    add_bars(builder, starts, ends, 0.022, (1.0, 1.0, 1.0))


def cyclist(rng: np.random.Generator) -> Mesh:
    """A rider on a bicycle; "paint" is the bicycle's colour, "fabric" and "denim" the clothes'."""
    builder = MeshBuilder()
    add_bicycle(builder)
    rider = MeshBuilder()
    add_body(rider, rng, Joints.seated(float(rng.uniform(0.3, 0.65))), float(rng.uniform(1.6, 1.9)))
    mesh = rider.build()
    seat = np.array([-0.2, 0.0, -_SADDLE_M - 0.05])
    for number, texture in enumerate(mesh.texture_names):
        part = mesh.texture == number
        builder.add(
            mesh.vertices_m + seat, mesh.faces[part], mesh.uv_m[part], texture, mesh.tint[part], smooth=True
        )
    return builder.build()
