"""Where a pixel of one frame lies in another (Wei, Ding and Li 2025, equations 1 to 4).

Pixel centres are at whole numbers, x to the right, y down; cameras look along +z; depth is a point's z.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import torch
import torch.nn.functional as F  # noqa: N812 (torch's own convention)
from torch import Tensor
from torch.autograd.function import once_differentiable

from training.errors import PhotometricShapeError

MIN_DEPTH_RATIO = 1e-3
"""A point is in front of the source camera if its depth there exceeds this part of that in the target."""

_SMALL_ANGLE_SQUARED = 1e-3


def transform_from_pose(pose: Tensor, inverse: bool = False) -> Tensor:
    """(N, 4, 4) rigid transforms of N poses, differentiable everywhere, at zero rotation too.

    Args:
        pose: (N, 6), rotation as axis times angle in radians, then translation; a point p goes to R p + t.
        inverse: give the transforms that undo these.

    Raises:
        PhotometricShapeError: another shape.
    """
    if pose.ndim != 2 or pose.shape[1] != 6:
        raise PhotometricShapeError(f"poses have the shape {tuple(pose.shape)}: (N, 6) is needed")
    pose = _at_least_single(pose)
    with torch.autocast(pose.device.type, enabled=False):
        rotation = rotation_from_axis_angle(pose[:, :3])
        translation = pose[:, 3:, None]
        if inverse:
            rotation = rotation.transpose(1, 2)
            translation = -(rotation @ translation)
        bottom = pose.new_tensor([0.0, 0.0, 0.0, 1.0]).expand(len(pose), 1, 4)
        return torch.cat((torch.cat((rotation, translation), dim=2), bottom), dim=1)


def rotation_from_axis_angle(vector: Tensor) -> Tensor:
    """(N, 3, 3) rotations about (N, 3) axes by their lengths in radians (Rodrigues)."""
    squared = (vector * vector).sum(dim=1)
    small = squared < _SMALL_ANGLE_SQUARED
    # The unused branch of a where gets a gradient too: it must be finite, so it never sees the zero.
    angle = torch.where(small, 1.0, squared).sqrt()
    half = torch.sin(0.5 * angle)
    sine = torch.where(small, 1.0 - squared / 6.0 + squared * squared / 120.0, torch.sin(angle) / angle)
    cosine = torch.where(
        small, 0.5 - squared / 24.0 + squared * squared / 720.0, 2.0 * half * half / (angle * angle)
    )
    x, y, z = vector.unbind(dim=1)
    zero = torch.zeros_like(x)
    cross = torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), dim=1).view(-1, 3, 3)
    outer = vector[:, :, None] * vector[:, None, :]
    identity = torch.eye(3, dtype=vector.dtype, device=vector.device)
    # cross @ cross = outer - |v|^2 I
    squared_cross = outer - squared[:, None, None] * identity
    return identity + sine[:, None, None] * cross + cosine[:, None, None] * squared_cross


def back_project(depth: Tensor, intrinsics: Tensor) -> Tensor:
    """(N, 3, H, W) points in the camera's frame, in the unit of `depth`.

    Args:
        depth: (N, 1, H, W).
        intrinsics: (N, 3, 3) in pixels of this picture.
    """
    height, width = depth.shape[-2:]
    pixels = pixel_grid(height, width, depth.dtype, depth.device)
    rays = torch.linalg.inv(intrinsics.to(depth.dtype)) @ pixels
    points: Tensor = rays.view(-1, 3, height, width) * depth
    return points


def project(points: Tensor, intrinsics: Tensor) -> Tensor:
    """(N, 2, H, W) pixel coordinates x, y of (N, 3, H, W) points; NaN for a point that is not in front.

    Args:
        points: in the camera's frame.
        intrinsics: (N, 3, 3) in pixels.
    """
    homogeneous = (intrinsics.to(points.dtype) @ points.flatten(2)).view_as(points)
    z = homogeneous[:, 2:]
    pixels: Tensor = homogeneous[:, :2] / torch.where(z > 0, z, 1.0)
    return pixels.masked_fill(z <= 0, torch.nan)


def reproject(source: Tensor, depth: Tensor, intrinsics: Tensor, source_from_target: Tensor) -> Tensor:
    """The target frame rebuilt from the source frame: Z2 p2 = Z1 K R K^-1 p1 + K T.

    Args:
        source: (N, 3, H, W), any number of channels.
        depth: (N, 1, H, W) of the target frame, above 0; infinite for points at infinity.
        intrinsics: (N, 3, 3) in pixels, those of both frames.
        source_from_target: (N, 4, 4), takes points of the target camera into the source camera.

    Returns:
        The source frame sampled bilinearly at p2, (N, 3, H, W). Outside of the source frame its border is
        repeated; a point behind the source camera shows the picture's centre. Neither has a gradient.

    Raises:
        PhotometricShapeError: shapes that do not belong together.
    """
    check_pair(source, intrinsics, source_from_target)
    expected = (source.shape[0], 1, *source.shape[2:])
    if tuple(depth.shape) != expected:
        raise PhotometricShapeError(f"depth has the shape {tuple(depth.shape)}: {expected} is needed")
    depth = _at_least_single(depth)
    with torch.autocast(depth.device.type, enabled=False):
        motion = PixelMotion(intrinsics, source_from_target, source.shape[-2], source.shape[-1])
        return motion.sample(source, depth.reciprocal())


class PixelMotion:
    """The motion between two cameras, ready to place the target's pixels for any depth.

    Divided by Z1, equation 4 is linear in inverse depth q: (Z2 / Z1) p2 = (K R K^-1) p1 + q K T. The first
    part is the same for all scales and is computed once.

    Args:
        intrinsics: (N, 3, 3) in pixels.
        source_from_target: (N, 4, 4).
        height, width: of the pictures in pixels.
    """

    def __init__(self, intrinsics: Tensor, source_from_target: Tensor, height: int, width: int) -> None:
        transform = _at_least_single(source_from_target)
        camera = intrinsics.to(transform.dtype)
        # grid_sample with align_corners=False takes -1 and 1 for the outer edges of the first and last pixel,
        # which are at -1/2 and W - 1/2 here: x becomes (2 x + 1) / W - 1.
        grid_from_pixel = camera.new_tensor(
            [[2.0 / width, 0.0, 1.0 / width - 1.0], [0.0, 2.0 / height, 1.0 / height - 1.0], [0.0, 0.0, 1.0]]
        )
        grid_from_camera = grid_from_pixel @ camera
        at_infinity = grid_from_camera @ transform[:, :3, :3] @ torch.linalg.inv(camera)
        self._motion = torch.cat((at_infinity, grid_from_camera @ transform[:, :3, 3:]), dim=2)
        self._pixels = pixel_grid(height, width, transform.dtype, transform.device)
        self._at_infinity = (at_infinity.detach() @ self._pixels).view(-1, 3, height, width)

    def sample(self, source: Tensor, inverse_depth: Tensor) -> Tensor:
        """The source (N, C, H, W) seen from the target, whose inverse depth is (N, 1, H, W)."""
        rebuilt: Tensor = F.grid_sample(
            source.to(inverse_depth.dtype),
            self.grid(inverse_depth),
            mode="bilinear",
            padding_mode="border",
            align_corners=False,
        )
        return rebuilt

    def grid(self, inverse_depth: Tensor) -> Tensor:
        """(N, H, W, 2) coordinates for grid_sample with align_corners=False; 0, 0 for a point behind."""
        inverse_depth = inverse_depth.to(self._motion.dtype)
        grid: Tensor = _Grid.apply(inverse_depth, self._motion, self._at_infinity, self._pixels)  # type: ignore[no-untyped-call]
        return grid


class _Grid(torch.autograd.Function):
    """Across (a0 + q b0) / (a2 + q b2), down (a1 + q b1) / (a2 + q b2), for motion [A | b] and a = A p.

    By hand, because autograd would write a picture-sized gradient of `a` only to sum it up into A's.
    """

    @staticmethod
    def forward(
        ctx: Any, inverse_depth: Tensor, motion: Tensor, at_infinity: Tensor, pixels: Tensor
    ) -> Tensor:
        count, _, height, width = inverse_depth.shape
        shift = motion[:, :, 3:, None]
        ratio = torch.addcmul(at_infinity[:, 2:], inverse_depth, shift[:, 2:])
        # What is not in front gets the factor 1 / inf = 0, and with it no gradient.
        factor = F.threshold(ratio, MIN_DEPTH_RATIO, math.inf).reciprocal_()
        grid = inverse_depth.new_empty((count, height, width, 2))
        for axis in (0, 1):
            place = torch.addcmul(at_infinity[:, axis : axis + 1], inverse_depth, shift[:, axis : axis + 1])
            torch.mul(place[:, 0], factor[:, 0], out=grid[..., axis])
        ctx.save_for_backward(inverse_depth, motion, factor, grid)
        ctx.pixels = pixels
        return grid

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, by_grid: Tensor) -> tuple[Tensor | None, Tensor | None, None, None]:
        inverse_depth, motion, factor, grid = ctx.saved_tensors
        count, _, height, width = inverse_depth.shape
        by_point = inverse_depth.new_empty((count, 3, height, width))
        torch.mul(by_grid[..., 0], factor[:, 0], out=by_point[:, 0])
        torch.mul(by_grid[..., 1], factor[:, 0], out=by_point[:, 1])
        torch.mul(by_point[:, 0], grid[..., 0], out=by_point[:, 2])
        by_point[:, 2].addcmul_(by_point[:, 1], grid[..., 1]).neg_()
        by_point = by_point.flatten(2)
        by_inverse_depth = by_motion = None
        if ctx.needs_input_grad[0]:
            by_inverse_depth = (motion[:, :, 3:].transpose(1, 2) @ by_point).view_as(inverse_depth)
        if ctx.needs_input_grad[1]:
            by_shift = by_point @ inverse_depth.flatten(2).transpose(1, 2)
            by_motion = torch.cat((by_point @ ctx.pixels.T, by_shift), dim=2)
        return by_inverse_depth, by_motion, None, None


@lru_cache(maxsize=16)
def pixel_grid(height: int, width: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    """(3, H * W) homogeneous pixel coordinates x, y, 1 in row order; shared, not to be written to."""
    y, x = torch.meshgrid(
        torch.arange(height, dtype=dtype, device=device),
        torch.arange(width, dtype=dtype, device=device),
        indexing="ij",
    )
    return torch.stack((x.flatten(), y.flatten(), torch.ones_like(x).flatten()))


def check_pair(picture: Tensor, intrinsics: Tensor, source_from_target: Tensor) -> None:
    """Raise PhotometricShapeError unless the matrices belong to this batch of pictures."""
    if picture.ndim != 4:
        raise PhotometricShapeError(f"picture has the shape {tuple(picture.shape)}: (N, C, H, W) is needed")
    for name, matrices, size in (
        ("intrinsics", intrinsics, 3),
        ("source_from_target", source_from_target, 4),
    ):
        expected = (len(picture), size, size)
        if tuple(matrices.shape) != expected:
            raise PhotometricShapeError(
                f"{name} has the shape {tuple(matrices.shape)} for pictures of {tuple(picture.shape)}: "
                f"{expected} is needed"
            )


def _at_least_single(values: Tensor) -> Tensor:
    """Half precision places pixels to a tenth of a pixel only: geometry is computed in single or double."""
    return values if values.dtype == torch.float64 else values.float()
