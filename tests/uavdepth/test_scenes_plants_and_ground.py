"""Parts that the nature scenes are made of: textures, trees, boulders, terrain, copies."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavdepth.scenes.copies import Template, add_copies
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.painting import smooth_noise
from uavdepth.scenes.rocks import add_boulder
from uavdepth.scenes.shapes import box_uv, tube, unit_sphere
from uavdepth.scenes.terrain import LandNoise, TerrainGrid, stretched_axis
from uavdepth.scenes.textures_nature import NATURE_TEXTURES
from uavdepth.scenes.undergrowth import add_bush, add_log, add_tuft
from uavdepth.scenes.vegetation import TreeKind, add_far_tree, add_tree

KINDS = get_args(TreeKind)


@pytest.mark.parametrize("name", sorted(NATURE_TEXTURES))
def test_a_texture_tiles_without_a_seam_and_has_detail(name: str) -> None:
    picture = NATURE_TEXTURES[name].make(np.random.default_rng(3))[..., :3].astype(float)
    assert picture.shape[0] == picture.shape[1]
    assert picture.shape[0].bit_count() == 1
    seam = np.abs(picture[0] - picture[-1]).mean()
    inside = np.abs(np.diff(picture, axis=0)).mean(axis=(1, 2))
    assert seam < 1.3 * inside.max() + 1.0
    assert picture.std() > 8.0


def test_the_same_generator_paints_the_same_texture() -> None:
    make = NATURE_TEXTURES["leaves"].make
    first, again, other = (make(np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).mean() > 0.5


def test_noise_wraps_around() -> None:
    noise = smooth_noise(np.random.default_rng(0), 128, 6)
    steps = np.abs(np.diff(noise, axis=1)).max()
    assert np.abs(noise[:, 0] - noise[:, -1]).max() <= 1.5 * steps


@pytest.mark.parametrize("kind", KINDS)
def test_a_tree_stands_at_its_foot_with_its_height_in_a_few_hundred_triangles(kind: TreeKind) -> None:
    builder = MeshBuilder()
    add_tree(builder, np.random.default_rng(1), 20.0, -7.0, 2.0, 12.0, kind)
    mesh = builder.build()
    assert 100 <= len(mesh.faces) <= 500
    assert np.isfinite(mesh.uv_m).all()
    top = 2.0 - mesh.vertices_m[:, 2].min()
    assert 10.0 <= top <= 16.0
    assert mesh.vertices_m[:, 2].max() > 2.0, "the trunk reaches into the ground"
    assert np.abs(mesh.vertices_m[:, :2] - [20.0, -7.0]).max() < 9.0
    assert set(mesh.texture_names) <= NATURE_TEXTURES.keys()


def test_undergrowth_uses_known_textures_only() -> None:
    rng = np.random.default_rng(2)
    builder = MeshBuilder()
    add_bush(builder, rng, 0.0, 0.0, 0.0, 1.2)
    add_log(builder, rng, 3.0, 0.0, 0.0, 6.0, 0.3)
    add_tuft(builder, rng, 0.5)
    for kind in KINDS:
        add_far_tree(builder, rng, 10.0, kind)
    add_boulder(builder, rng, 5.0, 5.0, 0.0, 2.0)
    assert set(builder.build().texture_names) <= NATURE_TEXTURES.keys()


def test_a_boulder_lies_partly_in_the_ground() -> None:
    builder = MeshBuilder()
    add_boulder(builder, np.random.default_rng(4), 5.0, 6.0, 1.0, 3.0, sunk=0.3)
    down = builder.build().vertices_m[:, 2]
    below = (down.max() - 1.0) / np.ptp(down)
    assert below == pytest.approx(0.3, abs=0.02)
    assert 1.2 < np.ptp(down) < 4.5


@pytest.mark.parametrize("subdivisions", [0, 1, 2])
def test_a_sphere_is_closed_round_and_faces_outwards(subdivisions: int) -> None:
    vertices, faces = unit_sphere(subdivisions)
    assert len(faces) == 20 * 4**subdivisions
    assert len(vertices) - len(faces) * 3 // 2 + len(faces) == 2, "Euler's formula of a closed surface"
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1.0)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0).all()


def test_a_tube_has_its_radius_and_its_texture_at_true_size() -> None:
    (vertices, faces), uv = tube([[0.0, 0.0, 0.0], [0.0, 0.0, -4.0]], [0.5, 0.5], 12)
    np.testing.assert_allclose(np.hypot(vertices[:, 0], vertices[:, 1]), 0.5)
    assert len(faces) == 24
    assert np.ptp(uv[:, 0]) == pytest.approx(2 * np.pi * 0.5)
    assert np.ptp(uv[:, 1]) == pytest.approx(4.0)


def test_texture_coordinates_of_a_wall_are_metres_on_it() -> None:
    corners = np.array([[7.0, 0.0, 0.0], [7.0, 3.0, 0.0], [7.0, 3.0, -2.0]])
    uv = box_uv(corners, [[0, 1, 2]])[0]
    assert np.linalg.norm(uv[1] - uv[0]) == pytest.approx(3.0)
    assert np.linalg.norm(uv[2] - uv[1]) == pytest.approx(2.0)


def test_copies_stand_on_their_feet_with_their_heights() -> None:
    rng = np.random.default_rng(0)
    template = Template.of(lambda builder: add_tree(builder, rng, 0.0, 0.0, 0.0, 10.0, "conifer"), 10.0)
    builder = MeshBuilder()
    feet = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, -3.0]])
    add_copies(builder, rng, template, feet, np.array([5.0, 20.0]))
    vertices = builder.build().vertices_m
    for foot, height in zip(feet, (5.0, 20.0), strict=True):
        own = vertices[np.hypot(*(vertices[:, :2] - foot[:2]).T) < 40.0]
        assert foot[2] - own[:, 2].min() == pytest.approx(height, rel=0.02)
        assert np.hypot(*(own[:, :2] - foot[:2]).T).max() <= template.reach * height + 1e-3


def test_an_axis_is_even_in_the_middle_and_ever_wider_outside() -> None:
    lines = stretched_axis(10.0, 1.0, 100.0)
    np.testing.assert_allclose(lines, -lines[::-1])
    steps = np.diff(lines)
    assert (steps > 0).all()
    np.testing.assert_allclose(steps[np.abs(lines[:-1] + 0.5) < 10.0], 1.0)
    assert lines[-1] >= 100.0


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


@settings(max_examples=60, deadline=None)
@given(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0))
def test_terrain_height_is_the_height_of_its_triangles(north_m: float, east_m: float) -> None:
    lines = stretched_axis(20.0, 2.0, 55.0)
    north, east = np.meshgrid(lines, lines, indexing="ij")
    grid = TerrainGrid(lines, lines, 5.0 * LandNoise(np.random.default_rng(1), 17.0).at(north, east))
    vertices, faces = grid.triangles()
    corners = vertices[faces]
    point = np.clip([north_m, east_m], lines[0], lines[-1])
    a, b, c = (corners[:, corner, :2] for corner in range(3))
    double_area = _cross(b - a, c - a)
    weights = np.stack(
        [_cross(b - point, c - point), _cross(c - point, a - point), _cross(a - point, b - point)]
    )
    inside = (weights / double_area).min(axis=0).argmax()
    expected = -(weights[:, inside] / double_area[inside]) @ corners[inside, :, 2]
    assert float(grid.at(north_m, east_m)) == pytest.approx(expected, abs=1e-6)


def test_terrain_faces_up() -> None:
    lines = stretched_axis(4.0, 1.0, 6.0)
    grid = TerrainGrid(lines, lines, np.zeros((len(lines), len(lines))))
    vertices, faces = grid.triangles()
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()
