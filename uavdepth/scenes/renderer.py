"""Pictures, distances and clearances of one described world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.scenes.atlas import build_atlas
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.mesh import Mesh
from uavdepth.scenes.nearest import nearest_surface
from uavdepth.scenes.noise import cloud_noise
from uavdepth.scenes.picture import RenderedPicture
from uavdepth.scenes.shading import develop, edge_pixels, shade, shadow_rays, surface_normals
from uavdepth.scenes.sky import cloud_map, light_table
from uavdepth.scenes.tracer import Hits, RayTracer

_SUBPIXELS = ((-0.125, -0.375), (0.375, -0.125), (0.125, 0.375), (-0.375, 0.125))
"""Where the samples of an edge pixel lie from its centre, in pixels: a rotated grid."""

_INSIDE_RAYS = 16


@dataclass(frozen=True)
class _Shaded:
    hits: Hits
    normals: NDArray[np.float32]
    lit: NDArray[np.float32]
    linear: NDArray[np.float32]


class Renderer:
    """One world, loaded: acceleration structure, textures, light. Everything in NED metres."""

    def __init__(self, description: SceneDescription, seed: int) -> None:
        mesh = description.mesh
        self._mesh = mesh
        self._tracer = RayTracer(mesh)
        self._atlas = build_atlas(mesh.texture_names, seed)
        self._light = light_table(description)
        self._clouds = cloud_map(seed)
        self._macro = cloud_noise(np.random.default_rng([seed, 8]), 256, slope=1.2, coarsest=1.0, finest=60.0)
        self._flat, self._vertex_normals = _normals(mesh)
        self._gradient = _uv_gradient(mesh)
        corners = mesh.vertices_m[mesh.faces]
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        # Exposed so that a white surface in full sun is white, as a camera would meter the scene.
        brightest = 0.8 * np.mean(description.sun_bgr) + np.mean(description.ambient_bgr)
        self._exposure = float(1.15 / brightest)
        self._inside_rays = _upward_directions(_INSIDE_RAYS)

    def picture(
        self, camera: CameraModel, ned_from_camera: NDArray[np.float64], position_m: NDArray[np.float64]
    ) -> RenderedPicture:
        """Picture and exact depth from one camera pose.

        Args:
            camera: intrinsics.
            ned_from_camera: (3, 3) rotation from camera axes into NED.
            position_m: (3,) camera position, NED.
        """
        origin = np.asarray(position_m, np.float32)
        rotation = np.asarray(ned_from_camera.T, np.float32)
        rays, across, along = _ray_field(camera)
        directions = rays @ rotation  # z = 1 in the camera frame, so Embree's t is z-depth
        pixel = 1.0 / float(np.sqrt(camera.fx * camera.fy))
        first = self._shade(origin, directions, pixel)
        linear = first.linear
        edges = edge_pixels(
            camera.height,
            camera.width,
            first.hits.face,
            first.hits.t,
            first.normals,
            first.lit,
            self._mesh.texture,
        )
        if len(edges):
            spread = np.concatenate(
                [(rays[edges] + dx * across[edges] + dy * along[edges]) @ rotation for dx, dy in _SUBPIXELS]
            )
            samples = self._shade(origin, spread, pixel).linear.reshape(len(_SUBPIXELS), -1, 3)
            # A lens and its sensor clip before they mix, so one sample of the sun does not fill a pixel.
            linear[edges] = np.minimum(samples, 1.5).mean(axis=0)
        image = develop(linear, self._exposure).reshape(camera.height, camera.width, 3)
        return RenderedPicture(image, first.hits.t.reshape(camera.height, camera.width))

    def distances(
        self, origins_m: NDArray[np.float32], directions: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """(N,) float32 distance along unit directions (N, 3) from (N, 3) or (3,) points; +inf = free."""
        return self._tracer.nearest(origins_m, directions).t

    def clearance_m(self, point_m: NDArray[np.float64], limit_m: float) -> float:
        """Distance to the nearest surface, at most `limit_m`; 0 inside a closed solid.

        Inside means that no ray of a fan over the upper half sphere is free and that most of them first
        meet the back of a face. Most, not all: neighbouring houses share the plane of a party wall.
        """
        if self._inside(point_m):
            return 0.0
        return float(
            nearest_surface(point_m, self._mesh.vertices_m, self._mesh.faces, self._low, self._high, limit_m)
        )

    def _inside(self, point_m: NDArray[np.float64]) -> bool:
        hits = self._tracer.nearest(np.asarray(point_m, np.float32), self._inside_rays)
        if bool(np.any(hits.face < 0)):
            return False
        leaving = np.einsum("ij,ij->i", self._flat[hits.face], self._inside_rays)
        return bool(2 * np.count_nonzero(leaving > 0) >= len(leaving))

    def _shade(self, origin: NDArray[np.float32], directions: NDArray[np.float32], pixel: float) -> _Shaded:
        mesh, atlas = self._mesh, self._atlas
        hits = self._tracer.nearest(origin, directions)
        normals = surface_normals(
            directions, hits.face, hits.u, hits.v, mesh.faces, self._flat, self._vertex_normals, mesh.smooth
        )
        which, points = shadow_rays(
            origin, directions, hits.face, hits.t, normals, self._flat, self._light[0]
        )
        lit = np.zeros(len(directions), np.float32)
        towards_sun = np.broadcast_to(self._light[0], (len(which), 3))
        lit[which] = ~self._tracer.occluded(points, towards_sun)
        linear = shade(
            origin,
            directions,
            hits.face,
            hits.u,
            hits.v,
            hits.t,
            normals,
            lit,
            pixel,
            mesh.uv_m,
            self._gradient,
            mesh.texture,
            mesh.tint,
            atlas.texels,
            atlas.start,
            atlas.levels,
            atlas.per_metre,
            self._light,
            self._clouds,
            self._macro,
        )
        return _Shaded(hits, normals, lit, linear)


@lru_cache(maxsize=4)
def _ray_field(
    camera: CameraModel,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """(H*W, 3) rays with z = 1, and their change per pixel to the right and downwards."""
    rays = camera.normalized_rays
    across = np.gradient(rays, axis=1) if camera.width > 1 else np.zeros_like(rays)
    along = np.gradient(rays, axis=0) if camera.height > 1 else np.zeros_like(rays)
    flat = tuple(np.ascontiguousarray(field.reshape(-1, 3), np.float32) for field in (rays, across, along))
    return flat[0], flat[1], flat[2]


def _normals(mesh: Mesh) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(M, 3) unit normals of the faces and (V, 3) area-weighted normals of the vertices of smooth ones."""
    a, b, c = (mesh.vertices_m[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    area = np.cross(b - a, c - a)
    vertex = np.zeros((len(mesh.vertices_m), 3))
    chosen = mesh.smooth
    for corner in range(3):
        for axis in range(3):
            vertex[:, axis] += np.bincount(
                mesh.faces[chosen, corner], weights=area[chosen, axis], minlength=len(vertex)
            )
    return _unit(area), _unit(vertex)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float32]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-30), np.float32)


def _uv_gradient(mesh: Mesh) -> NDArray[np.float32]:
    """(M, 2, 3) change of the texture coordinates per metre along north, east, down on each face."""
    a, b, c = (mesh.vertices_m[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    e1, e2 = b - a, c - a
    uv = mesh.uv_m.astype(np.float64)
    d1, d2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    # Dual basis of the edges in the face's plane: r1.e1 = 1, r1.e2 = 0 and the other way round.
    g11, g12, g22 = (np.einsum("ij,ij->i", x, y) for x, y in ((e1, e1), (e1, e2), (e2, e2)))
    determinant = np.maximum(g11 * g22 - g12 * g12, 1e-18)
    r1 = (g22[:, None] * e1 - g12[:, None] * e2) / determinant[:, None]
    r2 = (g11[:, None] * e2 - g12[:, None] * e1) / determinant[:, None]
    gradient = d1[:, :, None] * r1[:, None, :] + d2[:, :, None] * r2[:, None, :]
    return np.asarray(np.clip(gradient, -1e4, 1e4), np.float32)


def _upward_directions(count: int) -> NDArray[np.float32]:
    """(count, 3) unit directions spread over the half sphere from horizontal to straight up."""
    up = (np.arange(count) + 0.3) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    level = np.sqrt(1.0 - up**2)
    return np.stack([level * np.cos(turn), level * np.sin(turn), -up], axis=1).astype(np.float32)
