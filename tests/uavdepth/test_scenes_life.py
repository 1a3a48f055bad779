"""What fills the worlds stands where it belongs: off the corridor, on the ground, the same for a seed."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavdepth.scenes import HELD_OUT_SCENES, SCENE_NAMES, suburb
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.lawns import Lawns
from uavdepth.scenes.mesh import Mesh

SEED = 1
SNOWY = 4
"""A suburb in winter."""
NAMES = ("city", "farm", "park", "suburb", "wall", "works")


def _build(name: str) -> SceneDescription:
    module = importlib.import_module(f"uavdepth.scenes.{name}")
    description: SceneDescription = module.build(SEED)
    return description


_built = lru_cache(_build)


@pytest.fixture(scope="module", autouse=True)
def _forget_worlds() -> Iterator[None]:
    yield
    _built.cache_clear()


def _part(mesh: Mesh, texture: str) -> np.ndarray:
    """(M, 3, 3) corners of the faces of one texture."""
    assert texture in mesh.texture_names
    corners: np.ndarray = mesh.vertices_m[mesh.faces[mesh.texture == mesh.texture_names.index(texture)]]
    return corners


def test_scenes_held_out_of_training_are_scenes() -> None:
    assert HELD_OUT_SCENES == ("works",)
    assert set(HELD_OUT_SCENES) < set(SCENE_NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_is_one_world_and_fits_a_renderer(name: str) -> None:
    first, again = _built(name), _build(name)
    np.testing.assert_array_equal(first.mesh.vertices_m, again.mesh.vertices_m)
    np.testing.assert_array_equal(first.mesh.faces, again.mesh.faces)
    assert first.sun_bgr == again.sun_bgr
    assert 2_000 < len(first.mesh.faces) < 600_000
    assert np.isfinite(first.mesh.vertices_m).all()


@pytest.mark.parametrize("name", ["city", "farm", "park", "suburb", "works"])
def test_people_stand_on_the_ground_of_their_world(name: str) -> None:
    world = _built(name)
    trousers = _part(world.mesh, "denim").reshape(-1, 3).astype(float)
    height = -trousers[:, 2] - world.ground_height_m(trousers[:, 0], trousers[:, 1])
    assert len(trousers) > 500
    assert height.min() > -0.2
    assert np.percentile(height, 99.5) < 1.3, "a saddle is the highest seat"


def test_traffic_and_people_keep_the_corridor_of_the_city_free() -> None:
    mesh = _built("city").mesh
    for texture in ("denim", "rubber", "car_glass"):
        north, east, _ = _part(mesh, texture).reshape(-1, 3).T
        in_corridor = (north > 0.0) & (north < 30.0) & (np.abs(east) < 2.9)
        assert not in_corridor.any(), texture


@given(st.floats(-60, 60), st.floats(-60, 60), st.floats(0.1, 8.0))
def test_what_the_corridor_accepts_leaves_its_strip_and_the_take_off_place_empty(
    north_m: float, east_m: float, reach_m: float
) -> None:
    corridor = Corridor(35.0)
    low, high = (north_m - reach_m, east_m - reach_m), (north_m + reach_m, east_m + reach_m)
    free = corridor.is_free(low, high)
    assert free == bool(corridor.is_free_around((north_m, east_m), reach_m)[0])
    if free:
        strip = np.array([(n, e) for n in np.linspace(0, 35, 36) for e in np.linspace(-3.7, 3.7, 9)])
        inside = ((strip > low) & (strip < high)).all(axis=1)
        assert not inside.any()
        nearest = np.maximum(np.abs([north_m, east_m]) - reach_m, 0.0)
        assert np.hypot(*nearest) >= corridor.origin_m


def test_the_ground_of_a_park_is_gentle_and_its_pond_level() -> None:
    lawns = Lawns(np.random.default_rng(4), 35.0)
    places = np.random.default_rng(0).uniform(-75.0, 75.0, (4000, 2))
    dry = lawns.pond.off(places[:, 0], places[:, 1]) > 1.8
    step = 0.5
    rise = lawns.height_m(places[:, 0] + step, places[:, 1]) - lawns.height_m(places[:, 0], places[:, 1])
    slope_deg = np.degrees(np.arctan(np.abs(rise) / step))[dry]
    assert np.percentile(slope_deg, 95) < 12.0
    assert slope_deg.max() > 0.5, "it is not a plane"
    shore = lawns.pond.shore(0.8, 20)
    np.testing.assert_allclose(lawns.height_m(shore[:, 0], shore[:, 1]), lawns.pond.level_m)


def test_paths_lead_around_the_pond() -> None:
    for seed in range(5):
        lawns = Lawns(np.random.default_rng(seed), 35.0)
        for path in lawns.paths:
            assert lawns.pond.off(*path.points_m.T).min() > 1.3


def test_where_snow_lies_no_grass_shows() -> None:
    names = {seed: suburb.build(seed).mesh.texture_names for seed in (SNOWY, SEED)}
    assert "snow" in names[SNOWY]
    assert "grass" not in names[SNOWY]
    assert "grass" in names[SEED]
    assert "snow" not in names[SEED]
