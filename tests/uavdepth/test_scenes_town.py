"""Built-up scenes: take-off place, corridor, ground, variety, repeatability."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("numba")

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import Scene, load_scene
from uavdepth.scenes.path_growth import CLEARANCE_M

NORTH = (1.0, 0.0, 0.0)
DOWN = (0.0, 0.0, 1.0)
WORLDS = [
    *[("city", 0), ("city", 3), ("wall", 0), ("wall", 4), ("suburb", 1), ("suburb", 2)],
    *[("farm", 8), ("works", 0)],
]
CAMERA = CameraModel.from_fov(96, 64, 80)


_loaded = lru_cache(load_scene)


@pytest.fixture(scope="module", autouse=True)
def _forget_scenes() -> Iterator[None]:
    yield
    _loaded.cache_clear()


@pytest.fixture(scope="module", params=WORLDS, ids=lambda world: f"{world[0]}:{world[1]}")
def scene(request: pytest.FixtureRequest) -> Scene:
    return _loaded(*request.param)


def _window(half_width_m: float, low_m: float = 1.0, high_m: float = 8.0) -> np.ndarray:
    """Points above the origin's east-west line."""
    east, height = np.meshgrid(np.linspace(-half_width_m, half_width_m, 25), np.linspace(low_m, high_m, 15))
    return np.column_stack([np.zeros(east.size), east.ravel(), -height.ravel()])


def test_the_origin_is_free_ground(scene: Scene) -> None:
    assert scene.ground_height_m(0.0, 0.0) == 0.0
    assert scene.rangefinder_m((0.0, 0.0, -5.0)) == pytest.approx(5.0, abs=0.01)
    assert scene.clearance_m((0.0, 0.0, -2.5)) > 2.0


def test_the_corridor_to_the_north_is_free_and_ends_30_to_45_m_away(scene: Scene) -> None:
    distance = scene.ray_distance_m(_window(3.0), NORTH)
    assert distance.min() >= 30.0
    assert distance.max() <= 45.0


def test_a_vehicle_fits_through_the_corridor(scene: Scene) -> None:
    end = float(scene.ray_distance_m((0.0, 0.0, -3.0), NORTH)[0])
    for north in np.arange(0.0, end - 4.0, 1.0):
        assert scene.clearance_m((north, 0.0, -3.5)) > 2.9


def test_the_end_is_a_front_20_m_wide_and_9_m_high_square_to_the_street(scene: Scene) -> None:
    end = float(scene.ray_distance_m((0.0, 0.0, -3.0), NORTH)[0])
    # Start beyond what stands on the pavements, 3 m before the front.
    start = _window(10.0, 2.2, 9.0) + np.array([end - 3.0, 0.0, 0.0])
    distance = scene.ray_distance_m(start, NORTH)
    assert distance.max() <= 3.01
    assert np.median(distance) == pytest.approx(3.0, abs=0.01)


def test_ground_height_agrees_with_rays_on_bare_ground(scene: Scene) -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(-0.9, 0.9, (800, 2)) * scene.extent_m
    ground = scene.ground_heights_m(places[:, 0], places[:, 1])
    outside = np.array(
        [scene.clearance_m((n, e, -(g + 0.3))) > 0 for (n, e), g in zip(places, ground, strict=True)]
    )
    reading = scene.ray_distance_m(np.column_stack([places, -(ground + 0.3)])[outside], DOWN)
    assert outside.mean() > 0.3
    assert (np.abs(reading - 0.3) < 0.03).mean() > 0.95


def test_flights_are_clear_of_the_scene(scene: Scene) -> None:
    for seed in range(2):
        flight = scene.flight(seed, 6.0)
        clearances = [scene.clearance_m(flight.at(t).position_ned_m) for t in np.arange(0.0, 6.01, 0.2)]
        assert min(clearances) >= CLEARANCE_M


def test_inside_of_the_building_ahead_there_is_no_clearance(scene: Scene) -> None:
    end = float(scene.ray_distance_m((0.0, 0.0, -3.0), NORTH)[0])
    for height in (1.5, 4.0, 7.0):
        assert scene.clearance_m((end + 1.2, 0.4, -height)) == 0.0


def test_every_surface_of_the_picture_has_texture(scene: Scene) -> None:
    """Blocks of the picture that show near surfaces have contrast: nothing is one flat colour."""
    camera = CameraModel.from_fov(192, 128, 80)
    view = scene.render(camera, CameraMount(), (0.0, 0.0, -3.0), Attitude(0.0, 0.0, 0.0))
    blocks = view.image_bgr.astype(float).mean(axis=2).reshape(8, 16, 12, 16).std(axis=(1, 3))
    near = (view.depth_m < 60.0).reshape(8, 16, 12, 16).all(axis=(1, 3))
    assert near.sum() > 20
    assert (blocks[near] > 1.5).mean() > 0.9


@pytest.mark.parametrize(
    ("name", "seed", "other_seed"), [("city", 0, 3), ("wall", 0, 4), ("suburb", 1, 2), ("farm", 8, 0)]
)
def test_the_same_seed_is_the_same_picture_and_another_seed_is_another(
    name: str, seed: int, other_seed: int
) -> None:
    def picture(scene: Scene) -> np.ndarray:
        view = scene.render(CAMERA, CameraMount(), (0.0, 0.0, -4.0), Attitude(0.0, 0.0, 0.6))
        return view.image_bgr.astype(int)

    first, again = picture(_loaded(name, seed)), picture(load_scene(name, seed))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - picture(_loaded(name, other_seed))).mean() > 10.0


def test_another_process_renders_the_same_picture_to_the_bit() -> None:
    code = (
        "import hashlib\n"
        "from uavdepth import Attitude, CameraModel, CameraMount\n"
        "from uavdepth.scenes import load_scene\n"
        "view = load_scene('wall', 2).render(CameraModel.from_fov(96, 64, 80), CameraMount(), (0, 0, -4),"
        " Attitude(0.0, -0.1, 0.3))\n"
        "print(hashlib.sha256(view.image_bgr.tobytes() + view.depth_m.tobytes()).hexdigest())\n"
    )
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert len(runs[0]) > 60
    assert runs[0] == runs[1]


def test_seeds_of_the_city_differ_in_plan_and_light() -> None:
    worlds = [_loaded(name, seed) for name, seed in WORLDS if name == "city"]
    ends = {round(float(world.ray_distance_m((0.0, 0.0, -3.0), NORTH)[0]), 2) for world in worlds}
    suns = {tuple(np.round(world.sun_direction_ned, 3)) for world in worlds}
    assert len(ends) == len(suns) == len(worlds) == 2
