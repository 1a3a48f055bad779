"""Where pixels look."""

from __future__ import annotations

import math
import subprocess
import sys

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavdepth import Attitude, CameraModel, CameraModelError, CameraMount
from uavdepth.scan.body_rays import body_rays

angles = st.floats(-math.pi, math.pi)


def test_the_edges_of_the_picture_span_the_field_of_view():
    camera = CameraModel.from_fov(640, 320, 90)
    left_edge = math.degrees(math.atan((-0.5 - camera.cx) / camera.fx))
    assert left_edge == pytest.approx(-45.0)


def test_rays_are_unit_vectors_through_the_pixel_centres():
    camera = CameraModel(9, 5, 4.0, 5.0, 4.0, 2.0)
    np.testing.assert_allclose(np.linalg.norm(camera.rays, axis=-1), 1.0, rtol=1e-6)
    np.testing.assert_allclose(camera.rays[2, 4], [0, 0, 1])
    np.testing.assert_allclose(camera.normalized_rays[0, 8], [1.0, -0.4, 1.0])


def test_the_rays_of_a_distorted_camera_project_back_to_their_pixels():
    camera = CameraModel(640, 320, 300, 300, 322, 158, (-0.2, 0.05, 0.001, -0.001))
    rays = camera.normalized_rays.reshape(-1, 3).astype(np.float64)
    pixels, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion))
    u, v = np.meshgrid(range(640), range(320))
    np.testing.assert_allclose(pixels.reshape(320, 640, 2), np.stack([u, v], -1), atol=1e-3)


@given(st.integers(16, 2000), st.integers(16, 2000))
def test_a_resized_picture_keeps_its_field_of_view(width, height):
    camera = CameraModel(640, 320, 300, 310, 322, 158)
    resized = camera.scaled(width, height)
    for size, new_size, c, new_c, f, new_f in (
        (camera.width, width, camera.cx, resized.cx, camera.fx, resized.fx),
        (camera.height, height, camera.cy, resized.cy, camera.fy, resized.fy),
    ):
        assert (-0.5 - new_c) / new_f == pytest.approx((-0.5 - c) / f)
        assert (new_size - 0.5 - new_c) / new_f == pytest.approx((size - 0.5 - c) / f)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"width": 0}, "width is 0"),
        ({"height": 2.5}, "height is 2.5"),
        ({"fx": -1.0}, "fx is -1.0"),
        ({"fy": math.nan}, "fy is nan"),
        ({"cx": math.inf}, "cx is inf"),
        ({"distortion": (0.1, 0.2, 0.3)}, "distortion has 3 numbers"),
        ({"distortion": (0.1, 0.2, 0.3, math.nan)}, "finite"),
    ],
)
def test_intrinsics_that_no_camera_has_are_refused_by_value(changes, text):
    values = {"width": 640, "height": 320, "fx": 300.0, "fy": 300.0, "cx": 320.0, "cy": 160.0} | changes
    with pytest.raises(CameraModelError, match=text):
        CameraModel(**values)


def test_a_mount_that_is_not_finite_is_refused_by_name():
    with pytest.raises(CameraModelError, match="mount pitch_deg is nan"):
        CameraMount(pitch_deg=math.nan)


@pytest.mark.parametrize(
    ("mount", "camera_axis", "body_direction"),
    [
        (CameraMount(), (0, 0, 1), (1, 0, 0)),
        (CameraMount(), (1, 0, 0), (0, 1, 0)),
        (CameraMount(), (0, 1, 0), (0, 0, 1)),
        (CameraMount(yaw_deg=90), (0, 0, 1), (0, 1, 0)),
        (CameraMount(pitch_deg=-90), (0, 0, 1), (0, 0, 1)),
        (CameraMount(roll_deg=90), (1, 0, 0), (0, 0, 1)),
    ],
)
def test_a_mount_turns_the_camera_as_its_angles_say(mount, camera_axis, body_direction):
    np.testing.assert_allclose(mount.body_from_camera @ camera_axis, body_direction, atol=1e-12)


@given(angles, angles, angles)
def test_an_attitude_is_a_rotation_and_yaw_is_what_level_leaves_out(roll, pitch, yaw):
    attitude = Attitude(roll, pitch, yaw)
    ned = attitude.ned_from_body
    np.testing.assert_allclose(ned @ ned.T, np.eye(3), atol=1e-9)
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    np.testing.assert_allclose(turn @ attitude.level_from_body, ned, atol=1e-9)


@pytest.mark.parametrize(
    ("attitude", "forward_in_ned"),
    [
        (Attitude(0, math.radians(30), 0), (math.cos(math.radians(30)), 0, -0.5)),
        (Attitude(0, 0, math.radians(90)), (0, 1, 0)),
    ],
    ids=["nose up looks up", "yaw turns from north to east"],
)
def test_attitude_has_the_signs_of_mavlink(attitude, forward_in_ned):
    np.testing.assert_allclose(attitude.ned_from_body @ (1, 0, 0), forward_in_ned, atol=1e-12)


def test_roll_lowers_the_right_side():
    assert (Attitude(math.radians(30), 0, 0).ned_from_body @ (0, 1, 0))[2] > 0


def test_body_rays_with_a_stride_are_some_of_all_rays():
    camera, mount = CameraModel.from_fov(64, 32, 80), CameraMount(pitch_deg=-10, yaw_deg=20)
    every = body_rays(camera, mount)
    np.testing.assert_array_equal(body_rays(camera, mount, 4), every[:, 2::4, 2::4])
    np.testing.assert_allclose(
        every[:, 5, 7], mount.body_from_camera @ camera.normalized_rays[5, 7], rtol=1e-5
    )


def test_importing_the_library_loads_nothing_heavy():
    heavy = ("onnxruntime", "pymavlink", "pydantic", "torch", "numba", "embreex")
    code = f"import sys, uavdepth; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there():
    import uavdepth

    assert all(getattr(uavdepth, name) is not None for name in uavdepth.__all__)
    with pytest.raises(AttributeError, match="no attribute 'DepthModle'"):
        _ = uavdepth.DepthModle


@pytest.mark.parametrize("distortion", [(), (-0.25, 0.06, 0.001, -0.0005)])
def test_points_are_seen_where_their_rays_start(distortion: tuple[float, ...]) -> None:
    camera = CameraModel(640, 320, 350, 345, 322.5, 158.0, distortion)
    pixels = np.array([[0.0, 0.0], [320.3, 160.7], [639.0, 319.0], [100.25, 250.5]])
    rays = np.concatenate([camera.straightened(pixels), np.ones((4, 1))], axis=1)
    np.testing.assert_allclose(camera.projected(rays * 7.0), pixels, atol=1e-3)
    np.testing.assert_allclose(rays[2], camera.normalized_rays[319, 639], atol=1e-5)
    assert camera.straightened(np.empty((0, 2))).shape == (0, 2)


def test_what_is_behind_the_camera_has_no_pixel() -> None:
    camera = CameraModel.from_fov(640, 320, 90)
    seen = camera.projected(np.array([[0.0, 0.0, -5.0], [0.0, 0.0, 5.0]]))
    assert np.isnan(seen[0]).all()
    np.testing.assert_allclose(seen[1], (319.5, 159.5))
    assert np.isnan(camera.projected(np.array([[1.0, 0.0, 0.0]]))).all()
