"""Frames to measure with: worlds that no network was trained on, rendered or read from a folder."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from training.data.frame_store import FrameRecord, NewFrame, read_frames, write_frames
from training.data.rendering import render_world
from training.data.seed_split import SeedSplit
from training.data.surface_patterns import AppearanceShares, change_surfaces
from training.errors import EvaluationError
from uavdepth.scenes import HELD_OUT_SCENES, SCENE_NAMES, load_scene

OTHER_SURFACES = AppearanceShares(patterns=0.7, filters=0.5, photos=0.0)
"""How many pictures get patterns and filters where surfaces are to look otherwise."""


@dataclass(frozen=True)
class EvaluationFrame:
    """One frame and the world it shows."""

    scene: str
    seed: int
    index: int
    frame: NewFrame


@dataclass(frozen=True)
class EvaluationPlan:
    """Which frames to measure with.

    Args:
        scenes: names of `uavdepth.scenes`.
        seeds: of each scene; all kept for tests, or all kept for validation.
        frames_per_seed: frames of each world.
        store: folder where rendered frames are kept for the next time, or None.
        other_surfaces: most pictures get patterns laid on their surfaces, or a random filter, each always the
            same: what a network still sees then, it does not owe to the renderer's materials.

    Raises:
        EvaluationError: an unknown scene, nothing to do, seeds of training, or seeds of two splits.
        TrainingDataError: a seed outside all splits.
    """

    scenes: Sequence[str]
    seeds: Sequence[int]
    frames_per_seed: int
    store: Path | None = None
    other_surfaces: bool = False

    def __post_init__(self) -> None:
        for scene in self.scenes:
            if scene not in SCENE_NAMES:
                raise EvaluationError(f"no scene is called {scene!r}; there are {', '.join(SCENE_NAMES)}")
        if not self.scenes or not self.seeds or self.frames_per_seed < 1:
            raise EvaluationError(
                f"{len(self.scenes)} scenes, {len(self.seeds)} seeds and {self.frames_per_seed} frames a "
                "seed are given: at least one of each is needed"
            )
        splits = {SeedSplit.of(seed) for seed in self.seeds}
        if SeedSplit.TRAIN in splits:
            seen = next(seed for seed in self.seeds if SeedSplit.of(seed) is SeedSplit.TRAIN)
            raise EvaluationError(
                f"seed {seen} is for training: errors on it say nothing; validation begins at "
                f"{SeedSplit.VALIDATION.value.start}, tests at {SeedSplit.TEST.value.start}"
            )
        if len(splits) > 1:
            raise EvaluationError("seeds of validation and of tests are mixed: measure them apart")

    @property
    def split(self) -> SeedSplit:
        """What the seeds are kept for."""
        return SeedSplit.of(self.seeds[0])

    @property
    def frames_count(self) -> int:
        """How many frames there are."""
        return len(self.scenes) * len(self.seeds) * self.frames_per_seed

    @property
    def seen_scenes(self) -> tuple[str, ...]:
        """Those of the scenes whose kind is trained on, with other seeds."""
        return tuple(scene for scene in self.scenes if scene not in HELD_OUT_SCENES)

    @property
    def held_out_scenes(self) -> tuple[str, ...]:
        """Those of the scenes whose kind is never trained on."""
        return tuple(scene for scene in self.scenes if scene in HELD_OUT_SCENES)

    def frames(self) -> Iterator[EvaluationFrame]:
        """The frames, world by world; what the store lacks is rendered.

        Raises:
            SceneError: a world that cannot be built.
            TrainingDataError: a store that cannot be read.
            EvaluationError: a stored frame whose parts do not fit each other.
        """
        stored: dict[tuple[str, int], list[FrameRecord]] = {}
        if self.store is not None and self.store.exists():
            stored = _by_world(self.store)
        for seed in self.seeds:
            for scene in self.scenes:
                records = stored.get((scene, seed), [])
                if len(records) >= self.frames_per_seed:
                    frames = [_load(record) for record in records[: self.frames_per_seed]]
                else:
                    frames = self._render(scene, seed)
                for index, frame in enumerate(frames):
                    if self.other_surfaces:
                        frame = _with_other_surfaces(frame, (zlib.crc32(scene.encode()), seed, index))
                    yield EvaluationFrame(scene, seed, index, frame)

    def _render(self, scene: str, seed: int) -> list[NewFrame]:
        """Frames of a world as they are read from a store, so that a stored world measures the same."""
        frames = render_world(load_scene(scene, seed), self.frames_per_seed)
        with TemporaryDirectory() as folder:
            root = Path(folder) if self.store is None else self.store
            write_frames(root, scene, seed, frames)
            return [_load(record) for record in _by_world(root)[scene, seed]]


def _with_other_surfaces(frame: NewFrame, number: tuple[int, int, int]) -> NewFrame:
    rng = np.random.default_rng(number)
    changed = change_surfaces(rng, frame.image_bgr, frame.depth_m, frame.camera, OTHER_SURFACES)
    return replace(frame, image_bgr=changed)


def _by_world(root: Path) -> dict[tuple[str, int], list[FrameRecord]]:
    """Stored frames by scene and seed."""
    worlds: dict[tuple[str, int], list[FrameRecord]] = {}
    for record in read_frames(root):
        worlds.setdefault((record.scene, record.seed), []).append(record)
    return worlds


def parse_seeds(text: str) -> tuple[int, ...]:
    """Seeds of a text such as "1000-1005,1010". Raises EvaluationError."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        numbers = [first, last] if dash else [first]
        if not all(number.isascii() and number.isdigit() for number in numbers):
            raise EvaluationError(
                f"seeds are {text!r}: whole numbers and ranges are needed, as 1000-1005,1010"
            )
        low, high = int(first), int(numbers[-1])
        if not low <= high <= low + 10_000:
            raise EvaluationError(f"seeds {part.strip()!r} are not a rising range of at most 10000")
        seeds.extend(range(low, high + 1))
    return tuple(dict.fromkeys(seeds))


def _load(record: FrameRecord) -> NewFrame:
    return NewFrame(
        record.image_bgr(), record.depth_m(), record.camera, record.mount, record.attitude, record.height_m
    )
