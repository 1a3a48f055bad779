"""A tiny frame store: flat ground under a small camera, painted by its depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from training.data.frame_store import NewFrame, write_frames
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount

WIDTH, HEIGHT = 160, 96


def ground_frame(height_m: float = 2.0, pitch_rad: float = -0.1) -> NewFrame:
    """Flat ground `height_m` below a camera that looks a little down; sky above the horizon."""
    camera = CameraModel.from_fov(WIDTH, HEIGHT, 80.0)
    mount, attitude = CameraMount(), Attitude(0.0, pitch_rad, 0.0)
    down = camera.normalized_rays @ (attitude.level_from_body @ mount.body_from_camera)[2].astype(np.float32)
    with np.errstate(divide="ignore"):
        depth = np.where(down > 0, np.float32(height_m) / down, np.float32(np.inf)).astype(np.float32)
    shade = np.where(np.isfinite(depth), 200.0 / (1.0 + depth), 240.0)
    image = np.repeat(np.clip(shade, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    return NewFrame(image, depth, camera, mount, attitude, height_m)


def make_store(root: Path, worlds: tuple[tuple[str, int], ...] = (("city", 0), ("wall", 1))) -> Path:
    """A store of three frames for each world."""
    for scene, seed in worlds:
        write_frames(root, scene, seed, [ground_frame(height) for height in (1.5, 3.0, 6.0)])
    return root
