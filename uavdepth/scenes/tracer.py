"""Rays against the triangles of one mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.embree import RAY_HIT_ROWS, EmbreeTriangles, aligned_rows, call_packet
from uavdepth.scenes.kernels import kernel
from uavdepth.scenes.mesh import Mesh

_ORIGIN, _NEAR, _DIRECTION, _TIME, _FAR, _MASK, _ID, _FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
_U, _V, _FACE, _GEOMETRY = 15, 16, 17, 18
"""Rows of an RTCRayHit4, 8 or 16."""


@dataclass(frozen=True)
class Hits:
    """Nearest hit of each ray.

    Args:
        face: (N,) int32 face number, -1 where the ray meets nothing.
        u, v: (N,) float32 barycentric weights of the face's second and third corner.
        t: (N,) float32 distance in lengths of the ray's direction, +inf where the ray meets nothing.
    """

    face: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    t: NDArray[np.float32]


class RayTracer:
    """The triangles of one mesh, ready for rays.

    Args:
        mesh: the triangles.
        packet: rays traced at a time, 4, 8 or 16; None takes what suits the processor.
    """

    def __init__(self, mesh: Mesh, packet: int | None = None) -> None:
        self._triangles = EmbreeTriangles(mesh.vertices_m, mesh.faces, packet)

    @property
    def vertices_m(self) -> NDArray[np.float32]:
        """(N, 3) float32, the mesh's vertices."""
        return self._triangles.vertices_m

    def nearest(
        self,
        origins_m: NDArray[np.float32],
        directions: NDArray[np.float32],
        order: NDArray[np.int32] | None = None,
    ) -> Hits:
        """First surface along each ray.

        Args:
            origins_m: (N, 3) or (3,) float32 NED; one origin serves all rays.
            directions: (N, 3) float32, any length above 0.
            order: (N,) int32 sequence in which rays that start and lead close together follow each other,
                which makes them quick; None where they have nothing in common. Answers come in the order
                of the directions all the same.
        """
        count = len(directions)
        hits = Hits(
            np.empty(count, np.int32),
            np.empty(count, np.float32),
            np.empty(count, np.float32),
            np.empty(count, np.float32),
        )
        triangles = self._triangles
        _intersect(
            triangles.intersect,
            triangles.handle,
            triangles.incoherent if order is None else triangles.coherent,
            _rows(origins_m),
            _rows(directions),
            np.arange(count, dtype=np.int32) if order is None else order,
            *_packet(triangles.packet),
            hits.face,
            hits.u,
            hits.v,
            hits.t,
        )
        return hits

    def occluded(self, origins_m: NDArray[np.float32], direction: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) True where anything lies, at any distance, along one (3,) direction from (N, 3) points,
        neighbours in the order given."""
        triangles = self._triangles
        stopped = np.empty(len(origins_m), np.bool_)
        _occlude(
            triangles.occluded,
            triangles.handle,
            triangles.coherent,
            _rows(origins_m),
            np.asarray(direction, np.float32),
            *_packet(triangles.packet),
            stopped,
        )
        return stopped


def _packet(packet: int) -> tuple[int, NDArray[np.float32], NDArray[np.int32], int]:
    """An empty RTCRayHit of so many rays: its address, its rows as float32 and as int32, and the address of
    one more row, which says with -1 which of its rays are valid."""
    rows = aligned_rows(RAY_HIT_ROWS + 1, packet)
    return rows.ctypes.data, rows, rows.view(np.int32), rows[RAY_HIT_ROWS:].ctypes.data


def _rows(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.ascontiguousarray(vectors, np.float32).reshape(-1, 3)


@kernel
def _intersect(call, scene, arguments, origins, directions, order, at, packet, numbers, valid, face, u, v, t):  # type: ignore[no-untyped-def]
    """Fill face, u, v, t for all rays. at, packet, numbers, valid: from `_packet`."""
    shared = len(origins) == 1
    most = packet.shape[1]
    for first in range(0, len(order), most):
        width = min(most, len(order) - first)
        for k in range(most):
            numbers[RAY_HIT_ROWS, k] = -1 if k < width else 0
            i = order[first + min(k, width - 1)]
            j = 0 if shared else i
            for axis in range(3):
                packet[_ORIGIN + axis, k] = origins[j, axis]
                packet[_DIRECTION + axis, k] = directions[i, axis]
            packet[_NEAR, k] = 0.0
            packet[_TIME, k] = 0.0
            packet[_FAR, k] = np.inf
            numbers[_MASK, k] = -1
            numbers[_ID, k] = 0
            numbers[_FLAGS, k] = 0
            numbers[_FACE, k] = -1
            numbers[_GEOMETRY, k] = -1
        call_packet(call, valid, scene, at, arguments)
        for k in range(width):
            i = order[first + k]
            hit = numbers[_GEOMETRY, k] != -1
            face[i] = numbers[_FACE, k] if hit else -1
            u[i] = packet[_U, k] if hit else 0.0
            v[i] = packet[_V, k] if hit else 0.0
            t[i] = packet[_FAR, k] if hit else np.inf


@kernel
def _occlude(call, scene, arguments, origins, direction, at, packet, numbers, valid, stopped):  # type: ignore[no-untyped-def]
    """Fill stopped for all rays. at, packet, numbers, valid: from `_packet`."""
    most = packet.shape[1]
    for first in range(0, len(origins), most):
        width = min(most, len(origins) - first)
        for k in range(most):
            numbers[RAY_HIT_ROWS, k] = -1 if k < width else 0
            i = first + min(k, width - 1)
            for axis in range(3):
                packet[_ORIGIN + axis, k] = origins[i, axis]
                packet[_DIRECTION + axis, k] = direction[axis]
            packet[_NEAR, k] = 0.0
            packet[_TIME, k] = 0.0
            packet[_FAR, k] = np.inf
            numbers[_MASK, k] = -1
            numbers[_ID, k] = 0
            numbers[_FLAGS, k] = 0
        call_packet(call, valid, scene, at, arguments)
        for k in range(width):
            stopped[first + k] = packet[_FAR, k] < 0.0  # Embree writes -inf
