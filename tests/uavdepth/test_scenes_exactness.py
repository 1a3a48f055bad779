"""Depth, distances and light of the renderer against solids whose geometry is known in closed form."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("numba")

from numpy.typing import ArrayLike, NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import SceneError
from uavdepth.scenes import Scene
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Rect, add_box, add_slab

WALL_M = 25.0
CAMERA = CameraModel.from_fov(96, 64, 80)
MOUNT = CameraMount()
LEVEL = Attitude(0.0, 0.0, 0.0)
SUN = np.array([-0.5, 0.6, -0.7]) / np.linalg.norm([-0.5, 0.6, -0.7])


def _flat(north_m: ArrayLike, east_m: ArrayLike) -> NDArray[np.float64]:
    return np.zeros(np.broadcast(north_m, east_m).shape)


def _describe(builder: MeshBuilder, haze_per_m: float = 0.0, clouds: float = 0.0) -> SceneDescription:
    return SceneDescription(
        mesh=builder.build(),
        ground_height_m=_flat,
        sun_direction_ned=SUN,
        sun_bgr=(1.0, 1.0, 1.0),
        ambient_bgr=(0.35, 0.35, 0.35),
        sky_top_bgr=(0.9, 0.6, 0.3),
        sky_horizon_bgr=(0.9, 0.85, 0.8),
        haze_per_m=haze_per_m,
        cloud_amount=clouds,
        extent_m=40.0,
    )


def _ground(builder: MeshBuilder) -> None:
    add_slab(builder, Rect(-2000.0, 2000.0, -2000.0, 2000.0), 0.0, "concrete")


@pytest.fixture(scope="module")
def plain() -> Scene:
    """Nothing but level ground."""
    builder = MeshBuilder()
    _ground(builder)
    return Scene("plain", 0, _describe(builder))


@pytest.fixture(scope="module")
def yard() -> Scene:
    """Level ground; a wall 30 m wide and 10 m high to the north; a cube of 4 m to the south."""
    builder = MeshBuilder()
    _ground(builder)
    add_box(builder, (WALL_M + 1.0, 0.0), (2.0, 30.0), 0.0, 10.0, "brick")
    add_box(builder, (-20.0, 0.0), (4.0, 4.0), 0.0, 4.0, "plaster")
    return Scene("yard", 0, _describe(builder))


def _plane_depth(
    camera: CameraModel, mount: CameraMount, position: ArrayLike, attitude: Attitude
) -> NDArray[np.float64]:
    """z-depth of the plane down = 0 at each pixel, +inf where the ray does not go down."""
    rotation = attitude.ned_from_body
    origin = np.asarray(position) + rotation @ mount.position_body_m
    down = (camera.normalized_rays.astype(float) @ (rotation @ mount.body_from_camera).T)[..., 2]
    with np.errstate(divide="ignore"):
        return np.where(down > 0, -origin[2] / down, np.inf)


def test_a_wall_ahead_has_its_distance_as_depth_in_every_pixel(yard: Scene) -> None:
    depth = yard.render(CAMERA, MOUNT, (0.0, 0.0, -5.0), LEVEL).depth_m
    middle = depth[22:42, 20:76]
    assert depth.dtype == np.float32
    np.testing.assert_allclose(middle, WALL_M, rtol=1e-5)


@pytest.mark.parametrize(
    ("attitude_deg", "mount"),
    [
        ((0, 0, 0), CameraMount()),
        ((20, -10, 75), CameraMount()),
        ((-30, 25, 200), CameraMount(pitch_deg=-35)),
        ((8, 12, -140), CameraMount(roll_deg=10, pitch_deg=-15, yaw_deg=40, forward_m=0.3, down_m=-0.5)),
        ((0, 0, 30), CameraMount(pitch_deg=-90, right_m=0.4)),
    ],
)
@pytest.mark.parametrize("height_m", [1.0, 12.0])
def test_level_ground_has_the_depth_of_its_plane_for_any_attitude_and_mount(
    plain: Scene, attitude_deg: tuple[float, float, float], mount: CameraMount, height_m: float
) -> None:
    attitude = Attitude(*np.radians(attitude_deg))
    position = (3.0, -2.0, -height_m)
    depth = plain.render(CAMERA, mount, position, attitude).depth_m
    expected = _plane_depth(CAMERA, mount, position, attitude)
    near = expected < 300.0
    assert near.any()
    np.testing.assert_allclose(depth[near], expected[near], rtol=2e-5)


def test_the_sky_is_infinitely_far_and_ends_where_the_plane_begins(plain: Scene) -> None:
    attitude = Attitude(0.3, 0.1, 1.0)
    depth = plain.render(CAMERA, MOUNT, (0.0, 0.0, -2.0), attitude).depth_m
    sky = np.isinf(_plane_depth(CAMERA, MOUNT, (0.0, 0.0, -2.0), attitude))
    assert sky.any()
    assert np.isposinf(depth[sky]).all()
    assert not np.isnan(depth).any()


def test_depth_of_a_distorted_camera_belongs_to_its_bent_rays(yard: Scene) -> None:
    bent = CameraModel(96, 64, 57.0, 57.0, 47.5, 31.5, (-0.25, 0.06, 0.001, -0.002, 0.0))
    attitude = Attitude(0.0, -0.6, math.pi / 2)
    depth = yard.render(bent, MOUNT, (0.0, 20.0, -6.0), attitude).depth_m
    expected = _plane_depth(bent, MOUNT, (0.0, 20.0, -6.0), attitude)
    near = expected < 200.0
    np.testing.assert_allclose(depth[near], expected[near], rtol=2e-5)


def test_the_edge_of_a_wall_lies_where_opencv_projects_it_through_distortion(yard: Scene) -> None:
    bent = CameraModel(192, 128, 100.0, 100.0, 95.5, 63.5, (-0.2, 0.05, 0.0, 0.0, 0.0))
    depth = yard.render(bent, MOUNT, (0.0, 0.0, -5.0), LEVEL).depth_m
    # The wall's upper right corner: 25 m ahead, 15 m right, 5 m above the camera.
    corner, _ = cv2.projectPoints(
        np.array([[15.0, -5.0, WALL_M]]), np.zeros(3), np.zeros(3), bent.matrix, np.array(bent.distortion)
    )
    u, v = corner.ravel()
    assert np.isfinite(depth[math.ceil(v) + 1, math.floor(u) - 1])
    assert np.isinf(depth[math.floor(v) - 1, math.floor(u) - 1])
    assert np.isinf(depth[math.ceil(v) + 1, math.ceil(u) + 1])


def test_rays_measure_along_directions_of_any_length(yard: Scene) -> None:
    origins = np.array([[0.0, 0.0, -3.0], [0.0, 0.0, -3.0], [0.0, 0.0, -3.0], [0.0, 0.0, -3.0]])
    directions = np.array([[1.0, 0.0, 0.0], [-7.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.3, 0.0, 0.4]])
    measured = yard.ray_distance_m(origins, directions)
    np.testing.assert_allclose(measured, [WALL_M, 18.0, np.inf, 3.0 / 0.8], rtol=1e-6)
    assert yard.ray_distance_m((0.0, 0.0, -3.0), (1.0, 0.0, 0.0)).shape == (1,)
    assert yard.ray_distance_m((0.0, 0.0, -3.0), directions).shape == (4,)


def test_a_ray_without_direction_is_refused(yard: Scene) -> None:
    with pytest.raises(SceneError, match="longer than 0"):
        yard.ray_distance_m((0.0, 0.0, -3.0), (0.0, 0.0, 0.0))


def test_the_rangefinder_reads_the_first_surface_below(yard: Scene) -> None:
    assert yard.rangefinder_m((0.0, 0.0, -7.0)) == pytest.approx(7.0, abs=1e-4)
    assert yard.rangefinder_m((-20.0, 0.5, -7.0)) == pytest.approx(3.0, abs=1e-4)
    assert yard.rangefinder_m((5000.0, 0.0, -7.0)) is None


@pytest.mark.parametrize(
    ("place", "distance_m"),
    [
        ((0.0, 0.0, -2.0), 2.0),
        ((WALL_M - 1.5, 3.0, -5.0), 1.5),
        ((-20.0, 0.0, -4.7), 0.7),
        ((-17.0, 3.0, -2.0), math.sqrt(2.0)),
        ((-17.0, 3.0, -5.0), math.sqrt(3.0)),
    ],
    ids=["ground", "wall", "roof", "edge", "corner"],
)
def test_clearance_is_the_distance_to_the_nearest_surface(
    yard: Scene, place: tuple[float, float, float], distance_m: float
) -> None:
    assert yard.clearance_m(place) == pytest.approx(distance_m, abs=1e-4)


@pytest.mark.parametrize("place", [(-20.0, 0.0, -2.0), (-18.5, 1.5, -3.5), (WALL_M + 1.0, -9.0, -1.0)])
def test_clearance_inside_a_solid_is_zero(yard: Scene, place: tuple[float, float, float]) -> None:
    assert yard.clearance_m(place) == 0.0


def test_clearance_below_the_ground_is_zero(yard: Scene) -> None:
    assert yard.clearance_m((0.0, 0.0, 0.5)) == 0.0


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.0, math.nan, 1.0), (math.inf, 0.0, 0.0)])
def test_an_impossible_position_is_refused_by_its_value(yard: Scene, place: tuple[float, ...]) -> None:
    with pytest.raises(SceneError, match="not three finite numbers"):
        yard.render(CAMERA, MOUNT, place, LEVEL)


def test_a_cube_casts_its_shadow_away_from_the_sun(yard: Scene) -> None:
    """Seen from above, ground that the cube hides from the sun is darker than open ground."""
    lookdown = CameraMount(pitch_deg=-90)
    height = 30.0
    picture = yard.render(CAMERA, lookdown, (-20.0, 0.0, -height), LEVEL).image_bgr.astype(float)

    def brightness(north_m: float, east_m: float) -> float:
        u = CAMERA.cx + CAMERA.fx * east_m / height
        v = CAMERA.cy - CAMERA.fy * (north_m + 20.0) / height
        return float(picture[round(v) - 1 : round(v) + 2, round(u) - 1 : round(u) + 2].mean())

    # The shadow of the lid's middle, 4 m up: one step along the sun's ray to the ground.
    shadow = np.array([-20.0, 0.0]) - SUN[:2] / -SUN[2] * 4.0
    opposite = np.array([-20.0, 0.0]) + SUN[:2] / -SUN[2] * 4.0
    assert brightness(*shadow) < 0.75 * brightness(*opposite)


def test_haze_pulls_far_surfaces_towards_the_colour_of_the_horizon() -> None:
    def far_ground(haze_per_m: float) -> NDArray[np.float64]:
        builder = MeshBuilder()
        _ground(builder)
        scene = Scene("haze", 0, _describe(builder, haze_per_m))
        view = scene.render(CAMERA, MOUNT, (0.0, 0.0, -10.0), LEVEL)
        far = np.isfinite(view.depth_m) & (view.depth_m > 200.0)
        horizon = view.image_bgr[np.isinf(view.depth_m).nonzero()[0].max()].mean(axis=0)
        return np.abs(view.image_bgr[far].mean(axis=0) - horizon)

    assert far_ground(0.02).max() < 0.3 * far_ground(0.0).max()


def test_clouds_change_the_sky_and_never_the_depth() -> None:
    def view(clouds: float) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        builder = MeshBuilder()
        _ground(builder)
        picture = Scene("sky", 0, _describe(builder, clouds=clouds)).render(
            CAMERA, CameraMount(pitch_deg=30), (0.0, 0.0, -3.0), LEVEL
        )
        return picture.image_bgr, picture.depth_m

    clear, clear_depth = view(0.0)
    cloudy, cloudy_depth = view(0.6)
    assert np.abs(clear.astype(int) - cloudy).mean() > 5.0
    np.testing.assert_array_equal(clear_depth, cloudy_depth)


def test_textures_far_away_do_not_shimmer(plain: Scene) -> None:
    """A small step sideways moves distant ground by less than a pixel: its colours barely change."""

    def ground(east_m: float) -> NDArray[np.float64]:
        view = plain.render(CAMERA, MOUNT, (0.0, east_m, -20.0), LEVEL)
        return view.image_bgr[view.depth_m.astype(float).clip(0, 1e6) > 150.0].astype(float)

    first, second = ground(0.0), ground(0.7)
    rows = min(len(first), len(second))
    assert np.abs(first[:rows] - second[:rows]).mean() < 6.0
