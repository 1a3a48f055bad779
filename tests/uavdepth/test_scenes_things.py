"""True sizes of what fills the worlds: people, vehicles, fences, wires, bridges, scaffolding, hedges."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from uavdepth.scenes.bars import WIRE_RADIUS_M, add_bars, add_wires, hanging
from uavdepth.scenes.bridges import add_bridge
from uavdepth.scenes.cars import car
from uavdepth.scenes.cranes import add_gantry_crane, add_tower_crane
from uavdepth.scenes.cycles import cyclist
from uavdepth.scenes.fences import FENCE_KINDS, HEIGHTS_M, FenceKind, add_fence
from uavdepth.scenes.hedges import add_hedge
from uavdepth.scenes.lorries import bus, fork_lift, lorry
from uavdepth.scenes.mesh import Mesh, MeshBuilder
from uavdepth.scenes.overhead import add_line, add_mast
from uavdepth.scenes.people import HEIGHTS_M as PEOPLE_M
from uavdepth.scenes.people import person
from uavdepth.scenes.plant_parts import add_containers, add_pipe_bridge, add_silo, add_tank
from uavdepth.scenes.scaffolding import add_scaffold
from uavdepth.scenes.shelters import add_bus_shelter, add_covered_walk, add_stall
from uavdepth.scenes.solids import Rect
from uavdepth.scenes.stamps import Stamps
from uavdepth.scenes.textures import TEXTURES
from uavdepth.scenes.trellises import add_hoops, add_hop_garden, add_low_cables, add_trellis, add_wire_fence

Box = NDArray[np.float64]


def _built(make: Callable[[MeshBuilder, np.random.Generator], None], seed: int = 0) -> Mesh:
    builder = MeshBuilder()
    make(builder, np.random.default_rng(seed))
    return builder.build()


def _size_m(mesh: Mesh) -> Box:
    """Length, width and height."""
    return np.asarray(np.ptp(mesh.vertices_m, axis=0), float)


@pytest.mark.parametrize("walks", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_a_person_stands_on_the_ground_1_5_to_1_95_m_high(seed: int, walks: bool) -> None:
    mesh = person(np.random.default_rng(seed), walks)
    assert mesh.vertices_m[:, 2].max() == pytest.approx(0.0, abs=1e-5)
    length, width, height = _size_m(mesh)
    assert PEOPLE_M[0] - 1e-4 <= height <= PEOPLE_M[1] + 1e-4
    assert 0.3 < width < 0.9
    assert length < (1.5 if walks else 1.0)


def test_a_walker_steps_further_than_one_who_stands() -> None:
    walks, stands = (_size_m(person(np.random.default_rng(3), way))[0] for way in (True, False))
    assert walks > stands + 0.2


@pytest.mark.parametrize(
    ("make", "lowest", "highest"),
    [
        (car, (3.6, 1.6, 1.35), (4.8, 1.95, 1.6)),
        (partial(car, van=True), (4.7, 1.85, 1.9), (5.7, 2.1, 2.4)),
        (lorry, (5.9, 2.1, 2.3), (10.2, 2.6, 4.0)),
        (bus, (9.9, 2.4, 2.9), (12.4, 2.6, 3.9)),
        (cyclist, (1.6, 0.4, 1.5), (1.9, 0.9, 2.1)),
        (fork_lift, (2.8, 1.0, 2.1), (3.6, 1.4, 3.0)),
    ],
    ids=["car", "van", "lorry", "bus", "cyclist", "fork-lift"],
)
@pytest.mark.parametrize("seed", range(4))
def test_a_vehicle_has_its_size_and_stands_on_its_wheels(
    make: Callable[[np.random.Generator], Mesh],
    lowest: tuple[float, ...],
    highest: tuple[float, ...],
    seed: int,
) -> None:
    mesh = make(np.random.default_rng(seed))
    size = _size_m(mesh)
    assert (size >= lowest).all(), size
    assert (size <= highest).all(), size
    # A wheel of eight sides stands on a corner or on an edge.
    assert mesh.vertices_m[:, 2].max() == pytest.approx(0.0, abs=0.045)


def test_copies_keep_their_size_and_look_along_their_heading() -> None:
    stamps = Stamps(np.random.default_rng(1), [lorry], {})
    stamps.put(100.0, 50.0, 2.0, np.pi / 2)
    builder = MeshBuilder()
    stamps.build(builder)
    turned = builder.build().vertices_m
    model = lorry(np.random.default_rng(1)).vertices_m
    reach = np.ptp(turned, axis=0)
    assert reach[1] > 2 * reach[0], "its nose points east"
    assert turned[:, 2].max() == pytest.approx(model[:, 2].max() - 2.0, abs=1e-4)
    assert np.abs(turned[:, :2].mean(axis=0) - [100.0, 50.0]).max() < 3.0


@pytest.mark.parametrize("kind", FENCE_KINDS)
def test_a_fence_runs_from_foot_to_foot_with_its_height_and_posts_in_the_ground(kind: FenceKind) -> None:
    feet = [(0.0, 0.0, 0.0), (9.0, 0.0, -1.0), (9.0, 7.0, -1.0)]
    vertices = _built(lambda builder, rng: add_fence(builder, rng, feet, kind)).vertices_m
    low, high = HEIGHTS_M[kind]
    assert 1.0 + low <= -vertices[:, 2].min() <= 1.0 + high + 0.1
    assert 0.0 < vertices[:, 2].max() <= 0.25
    assert np.abs(vertices[:, 0].max() - 9.0) < 0.1
    assert np.abs(vertices[:, 1].max() - 7.0) < 0.1


@pytest.mark.parametrize("kind", FENCE_KINDS)
def test_ten_metres_of_fence_are_of_few_triangles(kind: FenceKind) -> None:
    mesh = _built(lambda builder, rng: add_fence(builder, rng, [(0, 0, 0), (10.0, 0, 0)], kind))
    assert 20 < len(mesh.faces) < 1700


def test_wires_hang_between_their_ends_lowest_in_the_middle() -> None:
    start, end = (0.0, 0.0, -8.0), (30.0, 0.0, -9.0)
    (line,) = hanging(start, end, sag=0.02)
    np.testing.assert_allclose(line[[0, -1]], [start, end])
    straight = np.linspace(start, end, len(line))
    below = line[:, 2] - straight[:, 2]
    span = float(np.linalg.norm(np.subtract(end, start)))
    assert below.argmax() == len(line) // 2
    assert below.max() == pytest.approx(0.02 * span)
    assert (below >= -1e-9).all()


def test_a_wire_is_at_least_15_mm_thick() -> None:
    mesh = _built(lambda builder, _: add_wires(builder, (0.0, 0.0, -8.0), (0.0, 30.0, -8.0), sag=0.0))
    assert 2 * WIRE_RADIUS_M >= 0.015
    assert _size_m(mesh)[2] == pytest.approx(1.5 * WIRE_RADIUS_M, rel=0.35)


@pytest.mark.parametrize("seed", range(6))
def test_the_wires_of_a_line_reach_from_the_first_pole_to_the_last_above_head_height(seed: int) -> None:
    feet = np.array([(0.0, east, 0.0) for east in (0.0, 30.0, 60.0)])
    vertices = _built(lambda builder, rng: add_line(builder, rng, feet), seed).vertices_m
    between = vertices[(np.abs(vertices[:, 1] - 15.0) < 5.0) | (np.abs(vertices[:, 1] - 45.0) < 5.0)]
    assert len(between) > 0
    assert -between[:, 2].max() > 4.0
    assert vertices[:, 1].max() > 59.9


@pytest.mark.parametrize("make", [add_trellis, add_low_cables])
@pytest.mark.parametrize("seed", range(6))
def test_wires_of_a_farm_run_at_the_heights_of_vehicles_from_post_to_post(
    make: Callable[..., None], seed: int
) -> None:
    first, last = np.zeros(3), np.array([0.0, 24.0, 0.0])
    vertices = _built(lambda builder, rng: make(builder, rng, first, last), seed).vertices_m
    reach = vertices[np.abs(vertices[:, 0]) < 0.8, 1]
    assert reach.max() > 23.0
    assert reach.min() < 1.0
    levels = -vertices[:, 2]
    assert 1.4 < levels.max() <= 8.01
    wires = (levels > 0.3) & (levels < levels.max() - 0.02)
    assert len(np.unique(np.round(vertices[wires, 1]))) > 8, "between the posts too"


def test_bars_have_their_radius_ends_and_outward_faces() -> None:
    mesh = _built(lambda builder, _: add_bars(builder, (1.0, 2.0, 0.0), (1.0, 2.0, -3.0), 0.1, sides=6))
    np.testing.assert_allclose(np.hypot(*(mesh.vertices_m[:, :2] - [1.0, 2.0]).T), 0.1, rtol=1e-5)
    assert _size_m(mesh)[2] == pytest.approx(3.0)
    a, b, c = (mesh.vertices_m[mesh.faces[:, corner]].astype(float) for corner in range(3))
    outwards = (a + b + c) / 3 - [1.0, 2.0, -1.5]
    outwards[:, 2] = 0.0
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), outwards) > 0).all()


def test_bars_without_length_are_left_out() -> None:
    starts = np.array([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0)])
    ends = np.array([(0.0, 0.0, 0.0), (5.0, 0.0, -1.0)])
    mesh = _built(lambda builder, _: add_bars(builder, starts, ends, 0.05))
    assert len(mesh.faces) == 8


@pytest.mark.parametrize("stairs", [False, True])
def test_below_a_bridge_the_way_is_free_up_to_its_clear_height(stairs: bool) -> None:
    mesh = _built(
        lambda builder, rng: add_bridge(builder, rng, (0.0, -8.0), (0.0, 8.0), 0.0, 4.5, 2.5, stairs)
    )
    corners = mesh.vertices_m[mesh.faces]
    # Any triangle that overlaps the open middle stays above.
    over = (corners[..., 1].min(axis=1) < 5.0) & (corners[..., 1].max(axis=1) > -5.0)
    assert -corners[over][..., 2].max() >= 4.5 - 1e-5
    if stairs:
        assert np.abs(mesh.vertices_m[:, 1]).max() > 14.0


def test_a_scaffold_stands_before_its_wall_and_one_rail_higher() -> None:
    mesh = _built(
        lambda builder, rng: add_scaffold(builder, rng, (5.0, -6.0), (5.0, 6.0), (-1.0, 0.0), 0.0, 9.0)
    )
    assert mesh.vertices_m[:, 0].max() < 5.0 - 0.2
    assert 8.0 < -mesh.vertices_m[:, 2].min() < 10.0


def test_a_covered_walk_leaves_head_room() -> None:
    mesh = _built(lambda builder, rng: add_covered_walk(builder, rng, (0.0, 0.0), (12.0, 0.0), 0.0, 3.0))
    middle = np.abs(mesh.vertices_m[:, 1]) < 0.6
    roof = mesh.vertices_m[:, 2] < -2.5
    assert not (middle & ~roof).any()
    assert 2.7 < -mesh.vertices_m[:, 2].min() < 4.2


def test_a_hedge_has_its_height_and_width() -> None:
    mesh = _built(lambda builder, rng: add_hedge(builder, rng, (0.0, 0.0, 0.0), (10.0, 0.0, 0.0), 1.5, 0.8))
    length, width, height = _size_m(mesh)
    assert length == pytest.approx(10.0, abs=0.4)
    assert 0.7 < width < 1.3
    assert 1.4 < height < 2.1


@pytest.mark.parametrize(
    "make",
    [
        lambda builder, rng: add_tower_crane(builder, rng, 0.0, 0.0, 0.0),
        lambda builder, rng: add_gantry_crane(builder, rng, (0.0, 0.0), (0.0, 20.0), 0.0, 7.0),
        lambda builder, rng: add_mast(builder, rng, 0.0, 0.0, 0.0),
        lambda builder, rng: add_stall(builder, rng, 0.0, 0.0, 0.0, 0.3),
        lambda builder, _: add_bus_shelter(builder, 0.0, 0.0, 0.0, 0.3),
        lambda builder, rng: add_tank(builder, rng, 0.0, 0.0, 4.0),
        lambda builder, rng: add_silo(builder, rng, 0.0, 0.0, 2.0),
        lambda builder, rng: add_pipe_bridge(builder, rng, (0.0, 0.0), (30.0, 0.0), 4.5),
        lambda builder, rng: add_containers(builder, rng, Rect(0.0, 20.0, 0.0, 20.0)),
        lambda builder, rng: add_hop_garden(builder, rng, Rect(0.0, 20.0, 0.0, 20.0)),
        lambda builder, rng: add_hoops(builder, rng, Rect(0.0, 20.0, 0.0, 7.0)),
        lambda builder, rng: add_wire_fence(
            builder, rng, [(0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 20.0, 0.0)]
        ),
    ],
    ids=[
        *["tower", "gantry", "mast", "stall", "shelter", "tank", "silo", "pipes", "containers"],
        *["hops", "hoops", "pasture"],
    ],
)
def test_large_things_stand_on_the_ground_in_known_textures_and_few_triangles(
    make: Callable[[MeshBuilder, np.random.Generator], None],
) -> None:
    mesh = _built(make)
    assert -0.05 <= mesh.vertices_m[:, 2].max() <= 0.35
    assert set(mesh.texture_names) <= TEXTURES.keys()
    assert len(mesh.faces) < 6000
    assert np.isfinite(mesh.uv_m).all()
