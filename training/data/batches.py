"""Batches for training: each one is a function of its number, so that resuming needs no hidden state."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from training.data.augmentation import change_light, cut_depth, cut_image, sample_crop
from training.data.camera_effects import camera_effects
from training.data.frame_store import FrameRecord, FrameStore
from training.data.hint_sampling import HintShares, hint_maps, sample_hints
from training.data.photo_textures import PhotoTextures
from training.data.seed_split import SeedSplit
from training.data.surface_patterns import AppearanceShares, change_surfaces
from training.data.views import View, view_of_crop
from training.errors import TrainingDataError
from training.normalization import IMAGE_MEAN, IMAGE_STD, MAX_DEPTH_M, log_inverse_depth

SCENE_SHARES: Mapping[str, float] = {"city": 2.5, "farm": 2.5}
"""How often scenes are drawn against each other, 1 if not named: streets hold the most kinds of fine
obstacles, and farms the most wires and poles."""

_ENOUGH_FRAMES = 300
"""A scene with fewer is drawn less, in proportion: it would be learnt by heart."""


@dataclass(frozen=True)
class Batch:
    """Pictures and their truth.

    Args:
        image: (N, 3, H, W) normalised RGB.
        log_inverse_depth: (N, 1, H, W), as the network says it.
        far: (N, 1, H, W) bool: sky or beyond the largest depth, where the truth is only a lower limit.
        ground: (N, 1, H, W) the ground's hint, 0 where there is none.
        points: (N, 2, H, W) the points' hint, 0 where there is none.
        focal_px: (N,) focal length of each picture in its own pixels.
    """

    image: Tensor
    log_inverse_depth: Tensor
    far: Tensor
    ground: Tensor
    points: Tensor
    focal_px: Tensor


class FramePool:
    """The frames of a store that are for learning, by scene. It grows while a renderer fills the store.

    Args:
        root: folder of the store.
        shares: how often frames of each scene come.
        photos: to lay on the frames' surfaces; None for none.

    Raises:
        TrainingDataError: no store, none complete, or a seed kept for tests.
    """

    def __init__(
        self, root: Path, shares: Mapping[str, float] = SCENE_SHARES, photos: PhotoTextures | None = None
    ) -> None:
        self.photos = photos
        self._store = FrameStore(root)
        self._shares = shares
        self._by_scene: dict[str, list[FrameRecord]] = {}
        self.rescan()

    def __len__(self) -> int:
        return sum(len(records) for records in self._by_scene.values())

    @property
    def worlds(self) -> int:
        """How many scene seeds there are."""
        return len({record.folder for records in self._by_scene.values() for record in records})

    def rescan(self) -> None:
        """Look again. Raises TrainingDataError: no store, none complete, or a seed kept for tests."""
        by_scene: dict[str, list[FrameRecord]] = {}
        for record in self._store.frames():
            SeedSplit.TRAIN.require_world(record.scene, record.seed)
            by_scene.setdefault(record.scene, []).append(record)
        if not by_scene:
            raise TrainingDataError(f"no training frames in {self._store.root}")
        self._by_scene = by_scene

    def draw(self, rng: np.random.Generator, count: int) -> list[FrameRecord]:
        """`count` random frames, scenes by their shares."""
        by_scene = self._by_scene
        names = sorted(by_scene)
        shares = np.array(
            [self._shares.get(name, 1.0) * min(1.0, len(by_scene[name]) / _ENOUGH_FRAMES) for name in names]
        )
        chosen = rng.choice(len(names), size=count, p=shares / shares.sum())
        scenes = [by_scene[names[index]] for index in chosen]
        return [records[int(rng.integers(len(records)))] for records in scenes]


def make_batch(
    records: Sequence[FrameRecord],
    rng: np.random.Generator,
    width: int,
    height: int,
    shares: HintShares | None = None,
    appearance: AppearanceShares | None = None,
    photos: PhotoTextures | None = None,
) -> Batch:
    """Augmented batch of the given frames at the network's size.

    Args:
        records: the frames.
        rng: random numbers.
        width, height: the network's size.
        shares: how often each subset of hints comes; None takes the usual ones.
        appearance: how often surfaces get another look; None takes the usual shares.
        photos: to lay on surfaces; None for none.
    """
    shares, appearance = shares or HintShares(), appearance or AppearanceShares()
    items = [_make_item(record, rng, width, height, shares, appearance, photos) for record in records]
    images, depths, grounds, points, focals = (list(column) for column in zip(*items, strict=True))
    targets = [log_inverse_depth(depth, focal) for depth, focal in zip(depths, focals, strict=True)]
    return Batch(
        torch.from_numpy(np.stack(images)).to(memory_format=torch.channels_last),
        torch.from_numpy(np.stack(targets)[:, None]),
        torch.from_numpy(np.stack(depths)[:, None] >= MAX_DEPTH_M),
        torch.from_numpy(np.stack(grounds)),
        torch.from_numpy(np.stack(points)),
        torch.tensor(focals, dtype=torch.float32),
    )


_Array = NDArray[np.float32]


def _make_item(
    record: FrameRecord,
    rng: np.random.Generator,
    width: int,
    height: int,
    shares: HintShares,
    appearance: AppearanceShares,
    photos: PhotoTextures | None,
) -> tuple[_Array, _Array, _Array, _Array, float]:
    """Picture, depth, ground, points and focal length of one frame, augmented."""
    crop = sample_crop(rng, record.camera.width, record.camera.height)
    depth_m = cut_depth(record.depth_m(), crop, width, height)
    view = view_of_crop(View(record.camera, record.mount, record.attitude), crop, width, height)
    picture = cut_image(record.image_bgr(), crop, width, height)
    picture = change_surfaces(rng, picture, depth_m, view.camera, appearance, photos)
    picture = change_light(rng, camera_effects(rng, picture, depth_m))
    hints = sample_hints(rng, view, record.height_m, picture, depth_m, shares)
    ground, points = hint_maps(hints, view, width, height)
    return network_image(picture), depth_m, ground, points, view.camera.fx


def network_image(image_bgr: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(3, H, W) normalised RGB of a (H, W, 3) picture that has the network's size already."""
    rgb = image_bgr[:, :, ::-1].astype(np.float32) / np.float32(255.0)
    normalised = (rgb - np.array(IMAGE_MEAN, np.float32)) / np.array(IMAGE_STD, np.float32)
    return np.ascontiguousarray(normalised.transpose(2, 0, 1), dtype=np.float32)


@dataclass(frozen=True)
class BatchRequest:
    """One batch to come: its number in the run, and its size."""

    number: int
    count: int
    width: int
    height: int


class BatchSource:
    """Makes batches ahead of the training step on a thread of its own (OpenCV and NumPy release the lock)."""

    def __init__(
        self,
        pool: FramePool,
        seed: int,
        ahead: int = 2,
        shares: HintShares | None = None,
        appearance: AppearanceShares | None = None,
    ) -> None:
        self._pool = pool
        self._shares = shares
        self._appearance = appearance
        self._seed = seed
        self._ahead = ahead

    def make(self, request: BatchRequest) -> Batch:
        """The batch of that number; the same number over the same pool gives the same batch."""
        rng = np.random.default_rng([self._seed, request.number])
        records = self._pool.draw(rng, request.count)
        size = request.width, request.height
        return make_batch(records, rng, *size, self._shares, self._appearance, self._pool.photos)

    def stream(self, requests: Iterator[BatchRequest]) -> Iterator[Batch]:
        """Batches in the order of `requests`, the next few already being made."""
        with ThreadPoolExecutor(max_workers=1) as worker:
            waiting: list[Future[Batch]] = []
            for request in requests:
                waiting.append(worker.submit(self.make, request))
                if len(waiting) > self._ahead:
                    yield waiting.pop(0).result()
            while waiting:
                yield waiting.pop(0).result()
