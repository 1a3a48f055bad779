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
from training.data.frame_store import FrameRecord, read_frames
from training.data.seed_split import SeedSplit
from training.errors import TrainingDataError
from training.normalization import IMAGE_MEAN, IMAGE_STD, MAX_DEPTH_M, log_inverse_depth

SCENE_SHARES: Mapping[str, float] = {"city": 0.46, "mountain": 0.18, "forest": 0.18, "wall": 0.18}
"""How often each scene is drawn: streets hold the finest obstacles and the most kinds of them."""


@dataclass(frozen=True)
class Batch:
    """Pictures and their truth.

    Args:
        image: (N, 3, H, W) normalised RGB.
        log_inverse_depth: (N, 1, H, W), as the network says it.
        far: (N, 1, H, W) bool: sky or beyond the largest depth, where the truth is only a lower limit.
    """

    image: Tensor
    log_inverse_depth: Tensor
    far: Tensor


class FramePool:
    """The frames of a store that are for learning, by scene. It grows while a renderer fills the store."""

    def __init__(self, root: Path, shares: Mapping[str, float] = SCENE_SHARES) -> None:
        self._root = root
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
        for record in read_frames(self._root):
            SeedSplit.TRAIN.require(record.seed)
            by_scene.setdefault(record.scene, []).append(record)
        if not by_scene:
            raise TrainingDataError(f"no training frames in {self._root}")
        self._by_scene = by_scene

    def draw(self, rng: np.random.Generator, count: int) -> list[FrameRecord]:
        """`count` random frames, scenes by their shares."""
        by_scene = self._by_scene
        names = sorted(by_scene)
        shares = np.array([self._shares.get(name, 0.1) for name in names])
        chosen = rng.choice(len(names), size=count, p=shares / shares.sum())
        scenes = [by_scene[names[index]] for index in chosen]
        return [records[int(rng.integers(len(records)))] for records in scenes]


def make_batch(records: Sequence[FrameRecord], rng: np.random.Generator, width: int, height: int) -> Batch:
    """Augmented batch of the given frames at the network's size."""
    images, targets, far = [], [], []
    for record in records:
        crop = sample_crop(rng, record.camera.width, record.camera.height)
        picture = change_light(rng, cut_image(record.image_bgr(), crop, width, height))
        depth_m = cut_depth(record.depth_m(), crop, width, height)
        images.append(network_image(picture))
        targets.append(log_inverse_depth(depth_m, record.camera.fx * width / crop.width))
        far.append(depth_m >= MAX_DEPTH_M)
    return Batch(
        torch.from_numpy(np.stack(images)).to(memory_format=torch.channels_last),
        torch.from_numpy(np.stack(targets)[:, None]),
        torch.from_numpy(np.stack(far)[:, None]),
    )


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

    def __init__(self, pool: FramePool, seed: int, ahead: int = 2) -> None:
        self._pool = pool
        self._seed = seed
        self._ahead = ahead

    def make(self, request: BatchRequest) -> Batch:
        """The batch of that number; the same number over the same pool gives the same batch."""
        rng = np.random.default_rng([self._seed, request.number])
        return make_batch(self._pool.draw(rng, request.count), rng, request.width, request.height)

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
