"""Renders scene seeds into a frame store."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from training.data.camera_sampling import sample_camera, sample_mount
from training.data.frame_store import NewFrame, has_frames, write_frames
from training.data.pose_sampling import sample_poses
from training.data.seed_split import SeedSplit
from uavdepth.errors import SceneError
from uavdepth.scenes import Scene, load_scene

RENDER_SIZE = (480, 240)
"""Width and height: 1.25 times the network's picture, so that crops are never blown up."""


@dataclass(frozen=True)
class RenderPlan:
    """What to render.

    Args:
        root: the frame store.
        scenes: names, each with its own share of the frames.
        split: which seeds are allowed.
        first_seed, seeds: range of seeds of each scene.
        frames_per_seed: pictures of each world.
        size: width and height in pixels.
        thin_share: of the pictures, taken right before poles, wires and trunks.
    """

    root: Path
    scenes: Sequence[str]
    split: SeedSplit
    first_seed: int
    seeds: int
    frames_per_seed: int
    size: tuple[int, int] = RENDER_SIZE
    thin_share: float = 0.0

    def worlds(self) -> Iterable[tuple[str, int]]:
        """Scene and seed of each world, seeds outermost, so that an unfinished store is balanced."""
        for seed in range(self.first_seed, self.first_seed + self.seeds):
            for scene in self.scenes:
                self.split.require_world(scene, seed)
                yield scene, seed


def render_plan(
    plan: RenderPlan,
    done: Callable[[str, int, int], None] | None = None,
    left_out: Callable[[str, int, str], None] | None = None,
) -> int:
    """Render what is missing of a plan. Returns the number of frames written.

    Args:
        plan: what to render; a world that is already complete is left alone.
        done: called with scene, seed and frames after each world.
        left_out: called with scene, seed and reason of a world that has no room to fly in; without it
            such a world ends the rendering.

    Raises:
        SceneError: a scene that cannot be built.
        TrainingDataError: a seed that the plan's split does not allow.
    """
    total = 0
    for name, seed in plan.worlds():
        if has_frames(plan.root, name, seed):
            continue
        scene = load_scene(name, seed)
        try:
            frames = render_world(scene, plan.frames_per_seed, plan.size, plan.thin_share)
        except SceneError as error:
            if left_out is None:
                raise
            left_out(name, seed, str(error))
            continue
        write_frames(plan.root, name, seed, frames)
        total += len(frames)
        if done is not None:
            done(name, seed, len(frames))
    return total


def render_world(
    scene: Scene, count: int, size: tuple[int, int] = RENDER_SIZE, thin_share: float = 0.0
) -> list[NewFrame]:
    """`count` pictures of a scene from random cameras; the same scene gives the same pictures."""
    rng = np.random.default_rng([zlib.crc32(scene.name.encode()), scene.seed])
    frames = []
    for position, attitude in sample_poses(scene, rng, count, thin_share):
        camera, mount = sample_camera(rng, *size), sample_mount(rng)
        picture = scene.render(camera, mount, position.tolist(), attitude)
        height_m = scene.rangefinder_m(position.tolist())
        frames.append(NewFrame(picture.image_bgr, picture.depth_m, camera, mount, attitude, height_m))
    return frames
