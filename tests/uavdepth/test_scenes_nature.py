"""The scenes `mountain`, `forest` and `park`: take-off place, corridor, ground, flights, variety."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("numba")

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import Scene, load_scene, mountain
from uavdepth.scenes.path_growth import CLEARANCE_M

NORTH = (1.0, 0.0, 0.0)
DOWN = (0.0, 0.0, 1.0)
WORLDS = [("mountain", 0), ("mountain", 3), ("forest", 0), ("forest", 2), ("park", 0), ("park", 3)]


_loaded = lru_cache(load_scene)


@pytest.fixture(scope="module", autouse=True)
def _forget_scenes() -> Iterator[None]:
    yield
    _loaded.cache_clear()


@pytest.fixture(scope="module", params=WORLDS, ids=lambda world: f"{world[0]}:{world[1]}")
def scene(request: pytest.FixtureRequest) -> Scene:
    return _loaded(*request.param)


def _window(half_width_m: float) -> np.ndarray:
    """Points above the origin's east-west line, 1 to 8 m high."""
    east, height = np.meshgrid(np.linspace(-half_width_m, half_width_m, 25), np.linspace(1.0, 8.0, 15))
    return np.column_stack([np.zeros(east.size), east.ravel(), -height.ravel()])


def test_the_origin_is_free_ground(scene: Scene) -> None:
    assert scene.ground_height_m(0.0, 0.0) == pytest.approx(0.0, abs=1e-9)
    assert scene.rangefinder_m((0.0, 0.0, -5.0)) == pytest.approx(5.0, abs=0.01)
    assert scene.clearance_m((0.0, 0.0, -3.0)) > 2.5


def test_the_corridor_to_the_north_is_free_and_ends_30_to_45_m_away(scene: Scene) -> None:
    distance = scene.ray_distance_m(_window(3.0), NORTH)
    assert distance.min() >= 30.0
    assert distance.max() <= 45.0


def test_the_end_of_the_corridor_is_at_least_20_m_wide_without_gaps(scene: Scene) -> None:
    assert scene.ray_distance_m(_window(10.0), NORTH).max() <= 45.0


def test_the_ground_before_the_end_of_the_corridor_is_nearly_flat(scene: Scene) -> None:
    height = [scene.ground_height_m(north, 0.0) for north in np.linspace(0.0, 28.0, 57)]
    assert np.abs(height).max() < 0.8


def test_ground_height_agrees_with_rays_on_bare_ground(scene: Scene) -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(-0.9, 0.9, (1500, 2)) * scene.extent_m
    ground = scene.ground_heights_m(places[:, 0], places[:, 1])
    # Just above the ground most rays start below every crown and boulder.
    reading = scene.ray_distance_m(np.column_stack([places, -(ground + 0.3)]), DOWN)
    bare = np.abs(reading - 0.3) < 0.03
    assert bare.mean() > 0.95


def test_flights_are_clear_of_the_scene(scene: Scene) -> None:
    for seed in range(2):
        flight = scene.flight(seed, 6.0)
        clearances = [scene.clearance_m(flight.at(t).position_ned_m) for t in np.arange(0.0, 6.01, 0.2)]
        assert min(clearances) >= CLEARANCE_M


@pytest.mark.parametrize(
    ("name", "seed", "other_seed"), [("mountain", 0, 3), ("forest", 0, 2), ("park", 0, 3)]
)
def test_the_same_seed_is_the_same_picture_and_another_seed_is_another(
    name: str, seed: int, other_seed: int
) -> None:
    camera = CameraModel.from_fov(96, 64, 80)

    def picture(scene: Scene) -> np.ndarray:
        view = scene.render(camera, CameraMount(), (0.0, 0.0, -4.0), Attitude(0.0, 0.0, 0.6))
        assert np.isfinite(view.depth_m).any()
        return view.image_bgr.astype(int)

    first, again = picture(_loaded(name, seed)), picture(load_scene(name, seed))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - picture(_loaded(name, other_seed))).mean() > 10.0


def test_a_river_runs_through_the_mountain_valley() -> None:
    mesh = mountain.build(0).mesh
    water = mesh.faces[mesh.texture == mesh.texture_names.index("water")]
    corners = mesh.vertices_m[water]
    assert np.ptp(corners[..., 2]) == 0.0, "its surface is level"
    assert np.ptp(corners[..., 1]) > 300.0
