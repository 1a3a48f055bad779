"""Rays, distances and texture lookups of the renderer against plain double-precision arithmetic."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("numba")

from numpy.typing import NDArray

from uavdepth.scenes.atlas import TextureAtlas, build_atlas
from uavdepth.scenes.face_table import U, V, build_face_table
from uavdepth.scenes.mesh import Mesh
from uavdepth.scenes.nearest import NearestSurface
from uavdepth.scenes.texture_filter import filtered
from uavdepth.scenes.textures import texture_source
from uavdepth.scenes.tracer import RayTracer

TEXTURES = ("brick", "grass", "asphalt")


def _soup(count: int, seed: int) -> Mesh:
    """Triangles of very different sizes, anywhere."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2.0, 1.0, (count, 1, 1))
    vertices = rng.uniform(-20.0, 20.0, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    return Mesh(
        vertices.reshape(-1, 3).astype(np.float32),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        rng.uniform(-5.0, 5.0, (count, 3, 2)).astype(np.float32),
        rng.integers(len(TEXTURES), size=count).astype(np.int32),
        np.ones((count, 3), np.float32),
        np.zeros(count, np.bool_),
        TEXTURES,
    )


def _corners(mesh: Mesh) -> NDArray[np.float64]:
    return mesh.vertices_m.astype(float)[mesh.faces]


def _first_hits(
    mesh: Mesh, origin: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where rays first meet a triangle (Moeller and Trumbore, 1997), one triangle after the other."""
    nearest = np.full(len(directions), np.inf)
    for a, b, c in _corners(mesh):
        e1, e2 = b - a, c - a
        p = np.cross(directions, e2)
        determinant = p @ e1
        with np.errstate(divide="ignore", invalid="ignore"):
            u = p @ (origin - a) / determinant
            q = np.cross(origin - a, e1)
            v = directions @ q / determinant
            t = e2 @ q / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        nearest = np.where(hit & (t < nearest), t, nearest)
    return nearest


def _segment(p: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M,) distances from p to segments from a to b."""
    along = np.einsum("ij,ij->i", p - a, b - a) / np.maximum(np.einsum("ij,ij->i", b - a, b - a), 1e-30)
    return np.linalg.norm(p - a - np.clip(along, 0, 1)[:, None] * (b - a), axis=1)


def _distance(mesh: Mesh, p: NDArray[np.float64]) -> float:
    """Distance from p to the nearest triangle: its plane where p lies above it, else its sides."""
    a, b, c = np.moveaxis(_corners(mesh), 1, 0)
    sides = np.minimum.reduce([_segment(p, a, b), _segment(p, b, c), _segment(p, c, a)])
    normal = np.cross(b - a, c - a)
    above = np.ones(len(a), bool)
    for start, end in ((a, b), (b, c), (c, a)):
        above &= np.einsum("ij,ij->i", np.cross(end - start, p - start), normal) >= 0
    height = np.abs(np.einsum("ij,ij->i", p - a, normal)) / np.linalg.norm(normal, axis=1)
    return float(np.where(above, height, sides).min())


@pytest.mark.parametrize("packet", [4, 8, 16])
@pytest.mark.parametrize("rays", [1, 15, 16, 17, 500])
def test_rays_find_the_first_triangle_whatever_their_number_and_order(rays: int, packet: int) -> None:
    mesh = _soup(300, seed=4)
    rng = np.random.default_rng(rays)
    origin = np.array([1.0, -2.0, 3.0])
    directions = (np.array([1.0, 0.2, -0.1]) + 0.4 * rng.normal(size=(rays, 3))).astype(np.float32)
    tracer = RayTracer(mesh, packet)
    expected = _first_hits(mesh, origin, directions.astype(float))
    for order in (None, np.arange(rays, dtype=np.int32), rng.permutation(rays).astype(np.int32)):
        hits = tracer.nearest(origin.astype(np.float32), directions, order)
        np.testing.assert_array_equal(np.isinf(hits.t), np.isinf(expected))
        np.testing.assert_array_equal(hits.face < 0, np.isinf(expected))
        found = np.isfinite(expected)
        np.testing.assert_allclose(hits.t[found], expected[found], rtol=1e-4)
        a, b, c = np.moveaxis(_corners(mesh)[hits.face[found]], 1, 0)
        u, v = hits.u[found, None].astype(float), hits.v[found, None].astype(float)
        there = origin + hits.t[found, None].astype(float) * directions[found]
        np.testing.assert_allclose((1 - u - v) * a + u * b + v * c, there, atol=2e-3)


def test_some_rays_hit_and_some_miss_so_that_the_comparison_means_something() -> None:
    mesh = _soup(300, seed=4)
    rng = np.random.default_rng(500)
    directions = np.array([1.0, 0.2, -0.1]) + 0.4 * rng.normal(size=(500, 3))
    hit = np.isfinite(_first_hits(mesh, np.array([1.0, -2.0, 3.0]), directions))
    assert 0.2 < hit.mean() < 0.98


@pytest.mark.parametrize("packet", [4, 8, 16])
@pytest.mark.parametrize("points", [0, 1, 16, 333])
def test_a_point_is_in_shadow_when_a_ray_towards_the_sun_hits_anything(points: int, packet: int) -> None:
    mesh = _soup(300, seed=5)
    rng = np.random.default_rng(6)
    origins = rng.uniform(-20.0, 20.0, (points, 3)).astype(np.float32)
    sun = np.array([0.3, -0.4, -0.8660254], np.float32)
    tracer = RayTracer(mesh, packet)
    hits = tracer.nearest(origins, np.tile(sun, (points, 1)))
    np.testing.assert_array_equal(tracer.occluded(origins, sun), np.isfinite(hits.t))


@pytest.mark.parametrize("triangles", [1, 31, 32, 33, 700])
def test_the_nearest_surface_is_the_nearest_of_all_triangles(triangles: int) -> None:
    mesh = _soup(triangles, seed=triangles)
    nearest = NearestSurface(mesh.vertices_m, mesh.faces)
    rng = np.random.default_rng(2)
    for point in rng.uniform(-25.0, 25.0, (60, 3)):
        expected = _distance(mesh, point)
        assert nearest.distance_m(point, 1000.0) == pytest.approx(expected, rel=1e-5, abs=1e-5)
        assert nearest.distance_m(point, 0.5 * expected) == pytest.approx(0.5 * expected)


def test_the_face_table_gives_each_corner_its_texture_coordinates() -> None:
    mesh = _soup(400, seed=9)
    per_metre = np.array([0.5, 1.0, 2.0], np.float32)
    table = build_face_table(mesh, per_metre).astype(float)
    sizes = np.linalg.norm(np.ptp(_corners(mesh), axis=1), axis=1)
    for corner in range(3):
        place = _corners(mesh)[:, corner]
        for axis, column in ((0, U), (1, V)):
            found = np.einsum("ij,ij->i", table[:, column : column + 3], place) + table[:, column + 3]
            expected = mesh.uv_m[:, corner, axis].astype(float) * per_metre[mesh.texture]
            apart = (found - expected + 0.5) % 1.0 - 0.5  # whole repetitions look the same
            assert np.abs(apart[sizes > 1.0]).max() < 1e-3


@pytest.fixture(scope="module")
def atlas() -> TextureAtlas:
    return build_atlas(TEXTURES, 0)


def _level(atlas: TextureAtlas, number: int, level: int = 0) -> NDArray[np.float64]:
    """(S, S, 4) one level of a texture, 0 to 1; 0 is the finest."""
    sides = [1 << exponent for exponent in reversed(range(int(atlas.levels[number])))]
    start = sum(side * side for side in sides[:level])
    side = sides[level]
    packed = atlas.pyramids[number][start : start + side * side]
    return np.stack([packed >> shift & 255 for shift in (0, 8, 16, 24)], -1).reshape(side, side, 4) / 255.0


def _lookup(
    atlas: TextureAtlas,
    number: int,
    place: tuple[float, float],
    a: tuple[float, float],
    b: tuple[float, float],
) -> NDArray[np.float64]:
    values = filtered(atlas.address[number], atlas.levels[number], *place, *a, *b)
    blue, green, red, gloss = values
    return np.array([blue, green, red, gloss])


def _between(level: NDArray[np.float64], x: float, y: float) -> NDArray[np.float64]:
    """Bilinear between the four texels around x, y in repetitions."""
    side = len(level)
    px, py = x * side - 0.5, y * side - 0.5
    ax, ay = px - math.floor(px), py - math.floor(py)
    x0, y0 = math.floor(px) % side, math.floor(py) % side
    x1, y1 = (x0 + 1) % side, (y0 + 1) % side
    top = level[y0, x0] * (1 - ax) + level[y0, x1] * ax
    bottom = level[y1, x0] * (1 - ax) + level[y1, x1] * ax
    return np.asarray(top * (1 - ay) + bottom * ay)


@pytest.mark.parametrize("number", range(len(TEXTURES)))
def test_a_small_footprint_reads_between_the_four_texels_around_it(atlas: TextureAtlas, number: int) -> None:
    level = _level(atlas, number)
    side = len(level)
    rng = np.random.default_rng(3)
    for x, y in [(0.0, 0.0), (-3.2, 7.9), *rng.uniform(-2.0, 2.0, (50, 2))]:
        tiny = 0.01 / side
        found = _lookup(atlas, number, (x, y), (tiny, 0.0), (0.0, tiny))
        np.testing.assert_allclose(found, _between(level, x, y), atol=2.0 / 255)


@pytest.mark.parametrize("texels", [1.9, 3.0, 6.3, 40.0])
def test_a_larger_footprint_reads_between_two_levels(atlas: TextureAtlas, texels: float) -> None:
    exact = math.log2(texels) - 0.3  # the renderer takes levels a little finer than the footprint
    low = int(exact)
    finer, coarser = _level(atlas, 0, low), _level(atlas, 0, low + 1)
    width = texels / len(_level(atlas, 0))
    for x, y in np.random.default_rng(7).uniform(-2.0, 2.0, (50, 2)):
        expected = _between(finer, x, y) * (1 - exact + low) + _between(coarser, x, y) * (exact - low)
        found = _lookup(atlas, 0, (x, y), (width, 0.0), (0.0, width))
        np.testing.assert_allclose(found, expected, atol=2.0 / 255)


def test_which_axis_of_a_footprint_is_the_longer_one_does_not_matter(atlas: TextureAtlas) -> None:
    texel = 1.0 / len(_level(atlas, 0))
    long, short = (3 * texel, 7 * texel), (1.4 * texel, -0.6 * texel)
    for x, y in np.random.default_rng(8).uniform(0.0, 1.0, (20, 2)):
        np.testing.assert_array_equal(
            _lookup(atlas, 0, (x, y), long, short), _lookup(atlas, 0, (x, y), short, long)
        )


@pytest.mark.parametrize("number", range(len(TEXTURES)))
def test_a_footprint_of_many_repetitions_reads_the_mean(atlas: TextureAtlas, number: int) -> None:
    mean = np.sqrt((_level(atlas, number)[..., :3] ** 2).mean(axis=(0, 1)))
    found = _lookup(atlas, number, (0.3, 0.8), (40.0, 0.0), (0.0, 40.0))[:3]
    np.testing.assert_allclose(found, mean, atol=2.0 / 255)


def test_an_oblique_footprint_averages_along_itself_and_not_across(atlas: TextureAtlas) -> None:
    """Rows of bricks stay rows when seen along the wall, and blur when seen from below."""
    rows = np.linspace(0.0, 1.0, 64, endpoint=False)
    texel = 1.0 / len(_level(atlas, 0))
    along = [_lookup(atlas, 0, (0.4, y), (8 * texel, 0.0), (0.0, texel))[:3].mean() for y in rows]
    across = [_lookup(atlas, 0, (0.4, y), (0.0, 8 * texel), (texel, 0.0))[:3].mean() for y in rows]
    assert np.std(along) > 1.2 * np.std(across)


def test_textures_repeat_at_their_size(atlas: TextureAtlas) -> None:
    for number, name in enumerate(TEXTURES):
        assert atlas.per_metre[number] == pytest.approx(1.0 / texture_source(name).size_m)
    place = np.array([0.37, -0.21])
    small = (0.002, 0.0), (0.0, 0.002)
    np.testing.assert_allclose(
        _lookup(atlas, 1, (place[0], place[1]), *small),
        _lookup(atlas, 1, (place[0] + 3.0, place[1] - 5.0), *small),
        atol=1.0 / 255,
    )
