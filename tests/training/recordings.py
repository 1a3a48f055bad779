"""Small recordings in AirSim's layout for tests: a camera that slides sideways past a textured wall."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from training.sequences.pfm import write_pfm

WALL_M = 4.0
FOCAL_PX = 48.0
STEP_PX = 3
STEP_M = STEP_PX * WALL_M / FOCAL_PX


def write_wall_recording(folder: Path, frames: int = 8, width: int = 96, height: int = 64) -> Path:
    """A flat wall 4 m ahead; each frame the camera moves `STEP_M` to the right, `STEP_PX` in the picture."""
    rng = np.random.default_rng(3)
    # Blobs wider than a step: re-projection finds its way by slopes of brightness, as in real pictures.
    wall = rng.integers(0, 256, (height // 16, (width + frames * STEP_PX) // 16 + 1, 3), dtype=np.uint8)
    wall = cv2.resize(wall, None, fx=16, fy=16, interpolation=cv2.INTER_CUBIC)
    (folder / "images").mkdir(parents=True)
    camera = {"width": width, "height": height, "fx": FOCAL_PX, "fy": FOCAL_PX}
    camera |= {"cx": (width - 1) / 2, "cy": (height - 1) / 2}
    (folder / "camera.json").write_text(json.dumps(camera))
    lines = ["VehicleName\tTimeStamp\tPOS_X\tPOS_Y\tPOS_Z\tQ_W\tQ_X\tQ_Y\tQ_Z\tImageFile\n"]
    for index in range(frames):
        left = index * STEP_PX
        cv2.imwrite(str(folder / "images" / f"img_{index}.png"), wall[:height, left : left + width])
        write_pfm(folder / "images" / f"depth_{index}.pfm", np.full((height, width), WALL_M, np.float32))
        lines.append(
            f"uav\t{index * 100}\t0\t{index * STEP_M}\t0\t1\t0\t0\t0\timg_{index}.png;depth_{index}.pfm\n"
        )
    (folder / "airsim_rec.txt").write_text("".join(lines))
    return folder
