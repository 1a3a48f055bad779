"""Where pixels go when the camera moves."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from training.errors import PhotometricShapeError
from training.photometric.geometry import back_project, project, reproject, transform_from_pose

WIDTH, HEIGHT = 32, 24
IDENTITY = torch.eye(4, dtype=torch.float64)[None]

components = st.floats(-3.0, 3.0, allow_subnormal=False)
poses = st.tuples(components, components, components, components, components, components)
tiny_poses = st.tuples(*[st.floats(-0.05, 0.05, allow_subnormal=False)] * 6)


def intrinsics(dtype: torch.dtype = torch.float64) -> Tensor:
    return torch.tensor([[[30.0, 0.0, 15.0], [0.0, 28.0, 12.0], [0.0, 0.0, 1.0]]], dtype=dtype)


def ramp(dtype: torch.dtype = torch.float64) -> Tensor:
    """A picture whose colours are its pixel coordinates: bilinear sampling reads off where it sampled."""
    y, x = torch.meshgrid(torch.arange(HEIGHT, dtype=dtype), torch.arange(WIDTH, dtype=dtype), indexing="ij")
    return torch.stack((x, y, x + y))[None]


def moved(x: float = 0.0, y: float = 0.0, z: float = 0.0, dtype: torch.dtype = torch.float64) -> Tensor:
    return transform_from_pose(torch.tensor([[0.0, 0.0, 0.0, x, y, z]], dtype=dtype))


@given(st.one_of(poses, tiny_poses))
def test_a_pose_is_the_rotation_that_opencv_makes_of_it(pose: tuple[float, ...]) -> None:
    transform = transform_from_pose(torch.tensor([pose], dtype=torch.float64))[0].numpy()
    expected = cv2.Rodrigues(np.array(pose[:3]))[0]
    np.testing.assert_allclose(transform[:3, :3], expected, atol=1e-10)
    np.testing.assert_allclose(transform[:3, 3], pose[3:])
    np.testing.assert_array_equal(transform[3], [0.0, 0.0, 0.0, 1.0])


@given(st.one_of(poses, tiny_poses))
def test_rotations_keep_lengths_angles_and_handedness(pose: tuple[float, ...]) -> None:
    rotation = transform_from_pose(torch.tensor([pose], dtype=torch.float64))[0, :3, :3]
    torch.testing.assert_close(rotation @ rotation.T, torch.eye(3, dtype=torch.float64), atol=1e-10, rtol=0)
    assert float(torch.linalg.det(rotation)) == pytest.approx(1.0, abs=1e-10)


@given(poses)
def test_there_and_back_is_no_motion(pose: tuple[float, ...]) -> None:
    vector = torch.tensor([pose], dtype=torch.float64)
    there_and_back = transform_from_pose(vector, inverse=True) @ transform_from_pose(vector)
    torch.testing.assert_close(there_and_back, IDENTITY, atol=1e-9, rtol=0)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-3, 0.0316, 0.0317, 1.0, math.pi])
def test_a_pose_has_its_exact_derivative_at_any_angle(angle: float) -> None:
    direction = torch.tensor([0.6, -0.48, 0.64], dtype=torch.float64)
    pose = torch.cat((angle * direction, torch.ones(3, dtype=torch.float64)))[None].requires_grad_()
    for inverse in (False, True):
        assert torch.autograd.gradcheck(lambda p, inverse=inverse: transform_from_pose(p, inverse), (pose,))


def test_without_motion_every_pixel_stays_where_it_is_at_any_depth() -> None:
    depth = torch.rand(1, 1, HEIGHT, WIDTH, dtype=torch.float64) * 50.0 + 0.1
    torch.testing.assert_close(reproject(ramp(), depth, intrinsics(), IDENTITY), ramp(), atol=1e-9, rtol=0)


def test_in_single_precision_it_stays_to_a_hundred_thousandth_of_a_pixel() -> None:
    depth = torch.rand(1, 1, HEIGHT, WIDTH) * 50.0 + 0.1
    still = reproject(ramp(torch.float32), depth, intrinsics(torch.float32), torch.eye(4)[None])
    torch.testing.assert_close(still, ramp(torch.float32), atol=1e-5, rtol=0)


def test_a_sideways_step_shifts_by_focal_length_times_step_over_depth() -> None:
    depth = torch.full((1, 1, HEIGHT, WIDTH), 10.0, dtype=torch.float64)
    seen = reproject(ramp(), depth, intrinsics(), moved(x=0.5, y=-0.25))
    shift = (seen - ramp())[0, :, 5:-5, 5:-5]
    torch.testing.assert_close(shift[0], torch.full_like(shift[0], 30.0 * 0.5 / 10.0))
    torch.testing.assert_close(shift[1], torch.full_like(shift[1], -28.0 * 0.25 / 10.0))


def test_reprojection_is_back_projection_motion_and_projection() -> None:
    generator = torch.Generator().manual_seed(3)
    depth = torch.rand(1, 1, HEIGHT, WIDTH, generator=generator, dtype=torch.float64) * 20.0 + 4.0
    transform = transform_from_pose(torch.tensor([[0.02, -0.03, 0.05, 0.1, 0.2, -0.3]], dtype=torch.float64))
    points = back_project(depth, intrinsics()).flatten(2)
    there = (transform[:, :3, :3] @ points + transform[:, :3, 3:]).view(1, 3, HEIGHT, WIDTH)
    place = project(there, intrinsics())
    limits = torch.tensor([WIDTH - 1.0, HEIGHT - 1.0], dtype=torch.float64)[None, :, None, None]
    expected = torch.minimum(place.clamp_min(0.0), limits)
    torch.testing.assert_close(reproject(ramp(), depth, intrinsics(), transform)[:, :2], expected)


def test_back_projection_and_projection_undo_each_other() -> None:
    depth = torch.rand(1, 1, HEIGHT, WIDTH, dtype=torch.float64) * 50.0 + 0.1
    torch.testing.assert_close(project(back_project(depth, intrinsics()), intrinsics()), ramp()[:, :2])


def test_a_point_behind_the_camera_has_no_pixel() -> None:
    points = torch.tensor([[[[1.0, 1.0]], [[1.0, 1.0]], [[-2.0, 0.0]]]])
    assert bool(project(points, intrinsics(torch.float32)).isnan().all())


def test_points_at_infinity_follow_the_rotation_alone() -> None:
    pose = torch.tensor([[0.0, 0.1, 0.0, 5.0, 5.0, 5.0]], dtype=torch.float64)
    sky = torch.full((1, 1, HEIGHT, WIDTH), torch.inf, dtype=torch.float64)
    turned = pose.clone()
    turned[:, 3:] = 0.0
    ten_metres = torch.full_like(sky, 10.0)
    torch.testing.assert_close(
        reproject(ramp(), sky, intrinsics(), transform_from_pose(pose)),
        reproject(ramp(), ten_metres, intrinsics(), transform_from_pose(turned)),
    )


@pytest.mark.parametrize("backwards_m", [-2.0, -1.9999999, -1.0, -50.0])
def test_points_that_fall_behind_the_source_camera_pull_at_nothing(backwards_m: float) -> None:
    """At 1 m everything lies in or behind the source camera's plane; at 60 m everything is in front of it."""
    depth = torch.full((1, 1, HEIGHT, WIDTH), 1.0, dtype=torch.float64)
    depth[..., WIDTH // 2 :] = 60.0
    depth.requires_grad_()
    pose = torch.tensor([[0.0, 0.0, 0.0, 0.1, 0.1, backwards_m]], dtype=torch.float64, requires_grad=True)
    seen = reproject(torch.rand(1, 3, HEIGHT, WIDTH).double(), depth, intrinsics(), transform_from_pose(pose))
    seen.square().sum().backward()  # type: ignore[no-untyped-call]
    assert bool(torch.isfinite(seen).all())
    assert depth.grad is not None
    assert pose.grad is not None
    assert bool(torch.isfinite(depth.grad).all())
    assert bool(torch.isfinite(pose.grad).all())
    assert float(depth.grad[..., : WIDTH // 2].abs().max()) == 0.0
    assert float(depth.grad[..., WIDTH // 2 :].abs().max()) > 0.0


def test_the_gradient_by_depth_and_pose_is_exact() -> None:
    generator = torch.Generator().manual_seed(5)
    source = torch.rand(2, 3, 5, 6, generator=generator, dtype=torch.float64)
    depth = (torch.rand(2, 1, 5, 6, generator=generator, dtype=torch.float64) * 3.0 + 1.0).requires_grad_()
    pose = (torch.rand(2, 6, generator=generator, dtype=torch.float64) * 0.2).requires_grad_()
    camera = torch.tensor([[6.0, 0, 2.5], [0, 5.0, 2.0], [0, 0, 1.0]], dtype=torch.float64).expand(2, 3, 3)
    assert torch.autograd.gradcheck(
        lambda d, p: reproject(source, d, camera, transform_from_pose(p)), (depth, pose)
    )


def test_half_precision_of_the_networks_does_not_reach_the_geometry() -> None:
    depth = torch.full((1, 1, HEIGHT, WIDTH), 7.0)
    pose = torch.tensor([[0.01, 0.02, 0.03, 0.1, 0.2, 0.3]])
    arguments = (ramp(torch.float32), depth, intrinsics(torch.float32))
    expected = reproject(*arguments, transform_from_pose(pose))
    with torch.autocast("cpu", torch.bfloat16):
        within = reproject(*arguments, transform_from_pose(pose))
    assert torch.equal(within, expected)


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("depth", (1, 1, HEIGHT, WIDTH + 1)),
        ("depth", (2, 1, HEIGHT, WIDTH)),
        ("intrinsics", (3, 3)),
        ("source_from_target", (1, 3, 4)),
        ("source", (3, HEIGHT, WIDTH)),
    ],
)
def test_shapes_that_do_not_belong_together_are_named(name: str, shape: tuple[int, ...]) -> None:
    arguments = {
        "source": torch.zeros(1, 3, HEIGHT, WIDTH),
        "depth": torch.ones(1, 1, HEIGHT, WIDTH),
        "intrinsics": torch.eye(3)[None],
        "source_from_target": torch.eye(4)[None],
    }
    arguments[name] = torch.zeros(shape)
    with pytest.raises(PhotometricShapeError) as caught:
        reproject(**arguments)
    assert str(shape) in str(caught.value)


def test_a_pose_of_seven_numbers_is_refused() -> None:
    with pytest.raises(PhotometricShapeError, match=r"\(2, 7\)"):
        transform_from_pose(torch.zeros(2, 7))
