"""Three frames of one rendered flight with exact depth and exact relative poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from training.photometric.geometry import back_project, project
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import load_scene

WIDTH, HEIGHT = 160, 120
CAMERA = CameraModel.from_fov(WIDTH, HEIGHT, 80.0)


@dataclass(frozen=True)
class RenderedTriplet:
    """The middle frame and its neighbours, half a metre before and behind it.

    Args:
        target: (1, 3, H, W) RGB in 0..1.
        depth_m: (1, 1, H, W), infinite in the sky.
        sources: like `target`.
        source_depths_m: like `depth_m`.
        intrinsics: (1, 3, 3).
        source_from_target: (1, 4, 4) each.
    """

    target: Tensor
    depth_m: Tensor
    sources: tuple[Tensor, ...]
    source_depths_m: tuple[Tensor, ...]
    intrinsics: Tensor
    source_from_target: tuple[Tensor, ...]

    def visible(self, source: int) -> Tensor:
        """(1, 1, H, W): pixels of the target, not sky, whose surface the source shows too."""
        near = torch.isfinite(self.depth_m)
        points = back_project(torch.where(near, self.depth_m, 1.0), self.intrinsics).flatten(2)
        transform = self.source_from_target[source]
        there = (transform[:, :3, :3] @ points + transform[:, :3, 3:]).view(1, 3, HEIGHT, WIDTH)
        place = torch.nan_to_num(project(there, self.intrinsics), nan=-1.0)
        u, v = place[:, :1], place[:, 1:]
        inside = (u >= 0) & (u <= WIDTH - 1) & (v >= 0) & (v <= HEIGHT - 1)
        column, row = u.round().long().clamp(0, WIDTH - 1), v.round().long().clamp(0, HEIGHT - 1)
        seen_m = self.source_depths_m[source][0, 0][row, column]
        return near & inside & ((seen_m / there[:, 2:] - 1.0).abs() < 0.03)


@cache
def rendered_triplet() -> RenderedTriplet:
    """A copter that climbs, turns and nods a little while it flies towards the wall."""
    scene = load_scene("wall")
    ground_m = scene.ground_height_m(0.0, 0.0)
    frames = []
    for step in (0.0, -1.0, 1.0):
        attitude = Attitude(0.01 * step, -0.01 * step, 0.01 * step)
        position = (0.5 * step, 0.15 * step, -(ground_m + 4.0 + 0.05 * step))
        picture = scene.render(CAMERA, CameraMount(), position, attitude)
        rgb = np.ascontiguousarray(picture.image_bgr[..., ::-1]).astype(np.float32) / 255.0
        image = torch.from_numpy(rgb).permute(2, 0, 1)[None]
        frames.append(
            (image, torch.from_numpy(picture.depth_m)[None, None], _ned_from_camera(attitude, position))
        )
    (target, depth_m, here), *neighbours = frames
    return RenderedTriplet(
        target=target,
        depth_m=depth_m,
        sources=tuple(image for image, _, _ in neighbours),
        source_depths_m=tuple(depth for _, depth, _ in neighbours),
        intrinsics=torch.tensor(
            [[[CAMERA.fx, 0.0, CAMERA.cx], [0.0, CAMERA.fy, CAMERA.cy], [0.0, 0.0, 1.0]]]
        ),
        source_from_target=tuple(
            torch.from_numpy(np.linalg.inv(there) @ here).float()[None] for _, _, there in neighbours
        ),
    )


def _ned_from_camera(attitude: Attitude, position: tuple[float, float, float]) -> NDArray[np.float64]:
    mount = CameraMount()
    transform = np.eye(4)
    transform[:3, :3] = attitude.ned_from_body @ mount.body_from_camera
    transform[:3, 3] = np.asarray(position) + attitude.ned_from_body @ mount.position_body_m
    return transform
