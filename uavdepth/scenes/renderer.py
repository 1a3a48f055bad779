"""Pictures, distances and clearances of one described world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.scenes.atlas import build_atlas
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.edges import edge_pixels, edge_rays, mix_samples
from uavdepth.scenes.face_table import NORMAL, build_face_table, vertex_normals
from uavdepth.scenes.nearest import NearestSurface
from uavdepth.scenes.noise import cloud_noise
from uavdepth.scenes.picture import RenderedPicture
from uavdepth.scenes.shading import develop, shade, surfaces
from uavdepth.scenes.sky import cloud_map, light_table
from uavdepth.scenes.tracer import Hits, RayTracer

_INSIDE_RAYS = 16


@dataclass(frozen=True)
class _Shaded:
    hits: Hits
    normals: NDArray[np.float32]
    texture: NDArray[np.int32]
    lit: NDArray[np.bool_]
    linear: NDArray[np.float32]


class Renderer:
    """One world, loaded: acceleration structure, textures, light. Everything in NED metres."""

    def __init__(self, description: SceneDescription, seed: int) -> None:
        mesh = description.mesh
        self._faces = mesh.faces
        self._tracer = RayTracer(mesh)
        self._atlas = build_atlas(mesh.texture_names, seed)
        self._light = light_table(description)
        self._clouds = cloud_map(seed)
        self._macro = cloud_noise(np.random.default_rng([seed, 8]), 256, slope=1.2, coarsest=1.0, finest=60.0)
        self._table = build_face_table(mesh, self._atlas.per_metre)
        self._vertex_normals = vertex_normals(mesh)
        self._nearest = NearestSurface(self._tracer.vertices_m, mesh.faces)
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
        field = _ray_field(camera)
        directions = field.rays @ rotation  # z = 1 in the camera frame, so Embree's t is z-depth
        pixel = 1.0 / float(np.sqrt(camera.fx * camera.fy))
        first = self._shade(origin, directions, pixel, field.tiles)
        linear = first.linear
        edges = edge_pixels(
            camera.height,
            camera.width,
            first.hits.face,
            first.hits.t,
            first.normals,
            first.lit,
            first.texture,
        )
        if len(edges):
            spread = edge_rays(field.rays, field.across, field.along, edges) @ rotation
            samples = self._shade(origin, spread, pixel, np.arange(len(spread), dtype=np.int32))
            mix_samples(linear, edges, samples.linear)
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
        return self._nearest.distance_m(point_m, limit_m)

    def _inside(self, point_m: NDArray[np.float64]) -> bool:
        hits = self._tracer.nearest(np.asarray(point_m, np.float32), self._inside_rays)
        if bool(np.any(hits.face < 0)):
            return False
        leaving = np.einsum("ij,ij->i", self._table[hits.face, NORMAL : NORMAL + 3], self._inside_rays)
        return bool(2 * np.count_nonzero(leaving > 0) >= len(leaving))

    def _shade(
        self,
        origin: NDArray[np.float32],
        directions: NDArray[np.float32],
        pixel: float,
        order: NDArray[np.int32],
    ) -> _Shaded:
        atlas = self._atlas
        hits = self._tracer.nearest(origin, directions, order)
        normals, texture, which, points = surfaces(
            origin,
            directions,
            order,
            hits.face,
            hits.u,
            hits.v,
            hits.t,
            self._table,
            self._faces,
            self._vertex_normals,
            self._light[0],
        )
        lit = np.zeros(len(directions), np.bool_)
        lit[which] = ~self._tracer.occluded(points, self._light[0])
        linear = shade(
            origin,
            directions,
            hits.face,
            hits.t,
            normals,
            lit,
            pixel,
            self._table,
            atlas.address,
            atlas.levels,
            self._light,
            self._clouds,
            self._macro,
        )
        return _Shaded(hits, normals, texture, lit, linear)


@dataclass(frozen=True)
class _RayField:
    """Rays of all pixels, row by row, (H*W, 3) float32.

    Args:
        rays: with z = 1.
        across, along: their change per pixel to the right and downwards.
        tiles: (H*W,) int32 pixels in an order of small squares.
    """

    rays: NDArray[np.float32]
    across: NDArray[np.float32]
    along: NDArray[np.float32]
    tiles: NDArray[np.int32]


@lru_cache(maxsize=4)
def _ray_field(camera: CameraModel) -> _RayField:
    rays = camera.normalized_rays
    across = np.gradient(rays, axis=1) if camera.width > 1 else np.zeros_like(rays)
    along = np.gradient(rays, axis=0) if camera.height > 1 else np.zeros_like(rays)
    rays, across, along = (
        np.ascontiguousarray(field.reshape(-1, 3), np.float32) for field in (rays, across, along)
    )
    return _RayField(rays, across, along, _tiles(camera.height, camera.width))


def _tiles(height: int, width: int) -> NDArray[np.int32]:
    """Pixels in squares of 4 x 4, one packet of rays each, and these in squares of 16 x 16."""
    row, column = np.divmod(np.arange(height * width), width)
    keys = (column % 4, row % 4, column // 4 % 4, row // 4 % 4, column // 16, row // 16)
    return np.lexsort(keys).astype(np.int32)


def _upward_directions(count: int) -> NDArray[np.float32]:
    """(count, 3) unit directions spread over the half sphere from horizontal to straight up."""
    up = (np.arange(count) + 0.3) / count
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    level = np.sqrt(1.0 - up**2)
    return np.stack([level * np.cos(turn), level * np.sin(turn), -up], axis=1).astype(np.float32)
