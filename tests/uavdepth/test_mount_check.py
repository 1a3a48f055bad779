"""The ground tells how the camera is tilted, and says nothing where it is not level."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavdepth import Attitude, CameraModel, CameraMount, ImageSizeError
from uavdepth.mount_check import MountState, MountVerdict, check_mount
from uavdepth.scale.ground_plane import GroundPlane, find_ground_plane

CAMERA = CameraModel.from_fov(160, 120, 80)
CONFIGURED = CameraMount(pitch_deg=-15.0)
FACTOR = 0.37
"""The depth's unit is unknown: nothing may depend on it."""


def ground_depth(
    mount: CameraMount,
    attitude: Attitude,
    slope: tuple[float, float] = (0.0, 0.0),
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> NDArray[np.float32]:
    """(H, W) depth of a plane 5 m below the camera that falls by `slope` to north and east; sky is inf."""
    rays = CAMERA.normalized_rays.astype(np.float64) @ mount.body_from_camera.T @ attitude.ned_from_body.T
    towards = rays @ np.array([slope[0], slope[1], 1.0])
    with np.errstate(divide="ignore"):
        depth = np.where(towards > 1e-3, 5.0 / towards, np.inf)
    if rng is not None:
        # Networks err smoothly: patches of 20 pixels are wrong together.
        patches = rng.normal(0, noise, (CAMERA.height // 20, CAMERA.width // 20))
        depth = depth * np.exp(np.kron(patches, np.ones((20, 20))))
    return (FACTOR * depth).astype(np.float32)


def flight(
    true: CameraMount,
    configured: CameraMount = CONFIGURED,
    turn_rad: float = 2 * math.pi,
    slope: tuple[float, float] = (0.0, 0.0),
    noise: float = 0.02,
    count: int = 48,
    wall: bool = False,
) -> list[GroundPlane]:
    """Planes of pictures along a turn, with the vehicle rocking by some degrees."""
    rng = np.random.default_rng(5)
    planes = []
    for number in range(count):
        roll, pitch = rng.normal(0, 0.05, 2)
        attitude = Attitude(roll, pitch, turn_rad * number / count)
        depth = ground_depth(true, attitude, slope, noise, rng)
        if wall:
            depth[:, 100:] = np.minimum(depth[:, 100:], FACTOR * 4.0)
        plane = find_ground_plane(depth, CAMERA, configured, attitude)
        if plane is not None:
            planes.append(plane)
    return planes


def verdict(true: CameraMount, configured: CameraMount = CONFIGURED, **flown: object) -> MountVerdict:
    return check_mount(flight(true, configured, **flown), configured)  # type: ignore[arg-type]


def test_the_normal_of_exact_ground_is_down():
    attitude = Attitude(0.05, -0.1, 1.0)
    plane = find_ground_plane(ground_depth(CONFIGURED, attitude), CAMERA, CONFIGURED, attitude)
    assert plane is not None
    down = attitude.ned_from_body @ CONFIGURED.body_from_camera @ np.array(plane.normal_camera)
    np.testing.assert_allclose(down, [0, 0, 1], atol=1e-4)
    assert plane.share == pytest.approx(1.0)


def test_a_mount_as_configured_agrees():
    said = verdict(CameraMount(roll_deg=0.5, pitch_deg=-15.5))
    assert said.state is MountState.AGREES
    assert "as configured" in said.text
    assert said.pitch_deg == pytest.approx(-15.5, abs=0.4)


def test_a_mount_that_looks_4_degrees_lower_is_reported_with_the_angle():
    said = verdict(CameraMount(pitch_deg=-19.0))
    assert said.state is MountState.DIFFERS
    assert "pitch is -19" in said.text
    assert "configured pitch_deg is -15" in said.text
    assert "roll is" not in said.text
    assert said.pitch_deg == pytest.approx(-19.0, abs=0.4)
    assert said.pitch_sigma_deg < 0.5


def test_a_camera_that_is_rolled_by_5_degrees_is_reported():
    said = verdict(CameraMount(roll_deg=5.0, pitch_deg=-15.0))
    assert said.state is MountState.DIFFERS
    assert "configured roll_deg is 0" in said.text
    assert said.roll_deg == pytest.approx(5.0, abs=0.5)


def test_a_camera_that_looks_to_the_right_is_measured_along_its_own_axes():
    configured = CameraMount(pitch_deg=-20.0, yaw_deg=60.0)
    said = verdict(CameraMount(pitch_deg=-25.0, yaw_deg=60.0), configured)
    assert said.state is MountState.DIFFERS
    assert said.pitch_deg == pytest.approx(-25.0, abs=0.6)
    assert said.roll_deg == pytest.approx(0.0, abs=0.6)


@settings(max_examples=12, deadline=None)
@given(st.floats(-12, 12), st.floats(-12, 12), st.floats(-90, 90))
def test_any_small_tilt_is_found_again_on_exact_ground(pitch_off_deg, roll_off_deg, yaw_deg):
    configured = CameraMount(pitch_deg=-25.0, yaw_deg=yaw_deg)
    true = CameraMount(roll_off_deg, -25.0 + pitch_off_deg, yaw_deg)
    said = verdict(true, configured, noise=0.0, count=24)
    assert said.pitch_deg == pytest.approx(true.pitch_deg, abs=0.4)
    assert said.roll_deg == pytest.approx(true.roll_deg, abs=0.4)


@pytest.mark.parametrize("slope", [(0.1, 0.0), (0.0, -0.08), (0.06, 0.06)])
def test_a_slope_is_not_level_ground_and_gives_no_verdict(slope):
    said = verdict(CONFIGURED, slope=slope)
    assert said.state is MountState.NOT_LEVEL
    assert "not level ground, no verdict" in said.text
    assert said.slope_deg == pytest.approx(math.degrees(math.atan(math.hypot(*slope))), abs=0.5)


def test_a_slope_seen_along_one_heading_is_not_taken_for_a_tilted_camera():
    said = verdict(CONFIGURED, slope=(0.1, 0.0), turn_rad=0.3)
    assert said.state is MountState.TURN_NEEDED
    assert "not level ground, no verdict" in said.text
    assert math.isnan(said.pitch_deg)


def test_hills_that_fall_to_all_sides_are_not_level_ground():
    rng = np.random.default_rng(1)
    planes = []
    for number in range(48):
        attitude = Attitude(0.0, 0.0, 2 * math.pi * number / 48)
        slope = tuple(rng.normal(0, 0.12, 2))
        plane = find_ground_plane(ground_depth(CONFIGURED, attitude, slope), CAMERA, CONFIGURED, attitude)
        if plane is not None:
            planes.append(plane)
    assert check_mount(planes, CONFIGURED).state is MountState.NOT_LEVEL


def test_a_wall_beside_the_ground_does_not_tilt_the_camera():
    said = verdict(CONFIGURED, wall=True)
    assert said.state is MountState.AGREES
    assert said.planes > 30


def test_a_wall_that_fills_the_picture_is_no_ground():
    attitude = Attitude(0.0, 0.0, 0.0)
    wall = np.full((CAMERA.height, CAMERA.width), 3.0, np.float32)
    assert find_ground_plane(wall, CAMERA, CONFIGURED, attitude) is None


def test_a_picture_of_nothing_is_no_ground():
    attitude = Attitude(0.0, 0.0, 0.0)
    nothing = np.full((CAMERA.height, CAMERA.width), np.nan, np.float32)
    assert find_ground_plane(nothing, CAMERA, CONFIGURED, attitude) is None


def test_a_few_wild_pictures_do_not_matter():
    planes = flight(CONFIGURED)
    for number in range(0, len(planes), 6):
        planes[number] = GroundPlane((0.3, 0.9, 0.3), 0.6, planes[number].attitude)
    said = check_mount(planes, CONFIGURED)
    assert said.state is MountState.AGREES
    assert said.pitch_deg == pytest.approx(-15.0, abs=0.6)


def test_few_pictures_give_no_verdict():
    said = check_mount(flight(CONFIGURED)[:10], CONFIGURED)
    assert said.state is MountState.TOO_FEW
    assert "10 pictures" in said.text


def test_errors_that_stay_for_many_pictures_count_as_one():
    """The same 40 normals in a random order are worth more than in blocks of ten alike."""
    rng = np.random.default_rng(2)
    blocks = np.repeat(rng.normal(0, 0.02, (8, 2)), 10, axis=0)
    attitudes = [Attitude(0.0, 0.0, 2 * math.pi * (7 * k % 80) / 80) for k in range(80)]

    def sigma(errors: NDArray[np.float64]) -> float:
        planes = []
        for error, attitude in zip(errors, attitudes, strict=True):
            body = np.array([error[0], error[1], 1.0]) / math.sqrt(1 + float(error @ error))
            normal = CONFIGURED.body_from_camera.T @ body
            planes.append(GroundPlane(tuple(normal.tolist()), 1.0, attitude))
        return check_mount(planes, CONFIGURED).pitch_sigma_deg

    assert sigma(blocks) > 2 * sigma(rng.permutation(blocks))


def test_a_depth_map_of_another_size_is_refused():
    with pytest.raises(ImageSizeError, match="depth map is 10x20, the camera 160x120"):
        find_ground_plane(np.ones((20, 10), np.float32), CAMERA, CONFIGURED, Attitude(0, 0, 0))
