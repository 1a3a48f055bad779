"""Where a pixel of one frame lies in another (Wei, Ding and Li 2025, equations 1 to 4).

Pixel centres are at whole numbers, x to the right, y down; cameras look along +z; depth is a point's z.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
import torch.nn.functional as F  # noqa: N812 (torch's own convention)
from torch import Tensor

from training.errors import PhotometricShapeError
from training.photometric.constants import MIN_DEPTH_RATIO

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
        repeated; a point behind the source camera shows its upper left pixel. Neither has a gradient.

    Raises:
        PhotometricShapeError: shapes that do not belong together.
    """
    check_pair(source, intrinsics, source_from_target)
    expected = (source.shape[0], 1, *source.shape[2:])
    if tuple(depth.shape) != expected:
        raise PhotometricShapeError(f"depth has the shape {tuple(depth.shape)}: {expected} is needed")
    depth = _at_least_single(depth)
    with torch.autocast(depth.device.type, enabled=False):
        return warp(source, depth.reciprocal(), pixel_motion(intrinsics, source_from_target))


def pixel_motion(intrinsics: Tensor, source_from_target: Tensor) -> Tensor:
    """(N, 3, 4) of how pixels move: K R K^-1 and K T side by side.

    Divided by Z1, equation 4 is linear in inverse depth q: (Z2 / Z1) p2 = (K R K^-1) p1 + q K T.
    """
    transform = _at_least_single(source_from_target)
    camera = intrinsics.to(transform.dtype)
    at_infinity = camera @ transform[:, :3, :3] @ torch.linalg.inv(camera)
    return torch.cat((at_infinity, camera @ transform[:, :3, 3:]), dim=2)


def warp(source: Tensor, inverse_depth: Tensor, motion: Tensor) -> Tensor:
    """The source (N, C, H, W) sampled where `motion` takes the pixels of inverse depth (N, 1, H, W).

    Outside of the source its border is repeated; a point behind its camera shows its upper left pixel. No
    gradient comes from either.
    """
    height, width = source.shape[-2:]
    pixels = pixel_grid(height, width, motion.dtype, motion.device)
    points = (motion[:, :, :3] @ pixels).view(-1, 3, height, width) + motion[:, :, 3:, None] * inverse_depth
    # What is not in front gets the factor 1 / inf = 0, and with it no gradient.
    factor = F.threshold(points[:, 2:], MIN_DEPTH_RATIO, math.inf).reciprocal()
    place = (points[:, :2] * factor).permute(0, 2, 3, 1)
    # With align_corners=False, -1 and 1 are the outer edges of the first and last pixel, here at -1/2 and
    # W - 1/2.
    grid = (2.0 * place + 1.0) / motion.new_tensor([width, height]) - 1.0
    rebuilt: Tensor = F.grid_sample(
        source.to(grid.dtype), grid, mode="bilinear", padding_mode="border", align_corners=False
    )
    return rebuilt


@lru_cache(maxsize=16)
def pixel_grid(height: int, width: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    """(3, H * W) homogeneous pixel coordinates x, y, 1 in row order; shared, not to be written to."""
    # What the first validation left here must serve the training that follows.
    with torch.inference_mode(False):
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
