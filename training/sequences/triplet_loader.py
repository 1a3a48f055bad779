"""Batches of triplets: each one a function of the seed and its number, so that resuming needs no state."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from training.errors import TrainingDataError, TrainingSettingsError
from training.sequences.color_jitter import ColorJitter
from training.sequences.errors import BrokenFrameError
from training.sequences.frame_cache import FrameCache
from training.sequences.frame_sequence import FrameSequence
from training.sequences.triplets import NEIGHBOURS, SkippedFile, Triplet, TripletSet

_PERMUTATION, _SAMPLE = 0, 1
"""Which random stream a generator is for: the order of an epoch, or the changes of one sample."""


@dataclass(frozen=True)
class TripletBatch:
    """Pictures (N, 3, H, W), RGB 0..1, channels last in memory.

    Args:
        target: frame t.
        sources: frames t - 1 and t + 1.
        target_jittered, sources_jittered: the same with other colours, which is what networks see.
        intrinsics: (N, 3, 3) of the pictures at this size; the centre of the first pixel is 0.
    """

    target: Tensor
    sources: tuple[Tensor, Tensor]
    target_jittered: Tensor
    sources_jittered: tuple[Tensor, Tensor]
    intrinsics: Tensor


@dataclass(frozen=True)
class LoaderSettings:
    """How batches are made.

    Args:
        width, height: the network's size in pixels.
        batch_size: triplets in a batch, over all processes together.
        seed: of the order and of the changes.
        augment: whether pictures are mirrored and recoloured.
        ahead: batches made before they are asked for.
        rank, world_size: which of how many processes this is; each takes its own part of every batch, and
            the parts together are the batch of one process alone.

    Raises:
        TrainingSettingsError: a size below 1, or a batch that cannot be shared out evenly.
    """

    width: int
    height: int
    batch_size: int = 8
    seed: int = 0
    augment: bool = True
    ahead: int = 2
    rank: int = 0
    world_size: int = 1

    def __post_init__(self) -> None:
        for name in ("width", "height", "batch_size", "ahead", "world_size"):
            if getattr(self, name) < 1:
                raise TrainingSettingsError(f"{name} is {getattr(self, name)}: at least 1 is needed")
        if self.seed < 0:
            raise TrainingSettingsError(f"seed is {self.seed}: at least 0 is needed")
        if not 0 <= self.rank < self.world_size:
            raise TrainingSettingsError(f"rank is {self.rank}: 0 to {self.world_size - 1} is needed")
        if self.batch_size % self.world_size:
            raise TrainingSettingsError(
                f"a batch of {self.batch_size} cannot be shared out evenly to {self.world_size} processes"
            )


class TripletLoader:
    """Batches of a set of triplets.

    Epochs follow each other without a gap: each is a permutation of the set by seed and epoch, and a batch
    may begin in one and end in the next. A triplet whose picture turns out to be broken is replaced by the
    next one of the set, and the file goes to `skipped`.

    Args:
        triplets: what to draw from.
        settings: sizes, seed and share of this process.
        cache_folder: where decoded frames are kept, see `FrameCache`.

    Raises:
        TrainingDataError: no triplets, or a cache that cannot be written.
    """

    def __init__(self, triplets: TripletSet, settings: LoaderSettings, cache_folder: Path) -> None:
        if not triplets.triplets:
            raise TrainingDataError("there are no triplets to train with")
        self._triplets = triplets.triplets
        self._settings = settings
        self._caches: dict[int, FrameCache] = {}
        self._intrinsics: dict[int, NDArray[np.float32]] = {}
        for sequence in {id(each.sequence): each.sequence for each in triplets.triplets}.values():
            self._open(sequence, cache_folder)
        self._skipped: dict[str, SkippedFile] = {each.file: each for each in triplets.skipped}
        self._permutations: dict[int, NDArray[np.int64]] = {}

    @property
    def batches_per_epoch(self) -> int:
        """Batches until every triplet was drawn once, rounded up."""
        return -(-len(self._triplets) // self._settings.batch_size)

    @property
    def skipped(self) -> tuple[SkippedFile, ...]:
        """Files left out so far: those of the set, and those that could not be decoded."""
        return tuple(self._skipped.values())

    def batch(self, number: int) -> TripletBatch:
        """This process's part of the batch of a number, from 0.

        Raises:
            TrainingDataError: not one triplet of the set can be read.
        """
        settings = self._settings
        places = range(settings.rank, settings.batch_size, settings.world_size)
        plain = np.empty((len(places), 3, settings.height, settings.width, 3), np.uint8)
        jittered = np.empty_like(plain)
        intrinsics = np.empty((len(places), 3, 3), np.float32)
        for row, place in enumerate(places):
            position = number * settings.batch_size + place
            triplet = self._load(self._drawn(position), plain[row])
            intrinsics[row] = self._intrinsics[id(triplet.sequence)]
            rng = np.random.default_rng([settings.seed, _SAMPLE, position])
            self._change(rng, plain[row], jittered[row], intrinsics[row])
        previous, target, following = _tensors(plain)
        previous_jittered, target_jittered, following_jittered = _tensors(jittered)
        return TripletBatch(
            target,
            (previous, following),
            target_jittered,
            (previous_jittered, following_jittered),
            torch.from_numpy(intrinsics),
        )

    def stream(self, first: int = 0, stop: int | None = None) -> Generator[TripletBatch, None, None]:
        """Batches from number `first` on, before `stop` if given, made ahead on a thread of its own."""
        # One decoding thread beside the training step: OpenCV's own threads would only fight over its cores.
        cv2.setNumThreads(1)
        numbers = iter(range(first, stop)) if stop is not None else count(first)
        waiting: deque[Future[TripletBatch]] = deque()
        worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="triplets")
        try:
            for number in numbers:
                waiting.append(worker.submit(self.batch, number))
                if len(waiting) > self._settings.ahead:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            worker.shutdown(wait=True, cancel_futures=True)

    def _open(self, sequence: FrameSequence, folder: Path) -> None:
        width, height = self._settings.width, self._settings.height
        self._caches[id(sequence)] = FrameCache(folder, sequence, width, height)
        self._intrinsics[id(sequence)] = sequence.camera.scaled(width, height).matrix.astype(np.float32)

    def _drawn(self, position: int) -> int:
        """Number of the triplet at a place of the endless row of epochs."""
        epoch, place = divmod(position, len(self._triplets))
        if epoch not in self._permutations:
            rng = np.random.default_rng([self._settings.seed, _PERMUTATION, epoch])
            # A batch spans two epochs at most unless the set is smaller than a batch: keep no more.
            self._permutations = {k: v for k, v in self._permutations.items() if abs(k - epoch) <= 1}
            self._permutations[epoch] = rng.permutation(len(self._triplets))
        return int(self._permutations[epoch][place])

    def _load(self, drawn: int, frames: NDArray[np.uint8]) -> Triplet:
        """Fill (3, H, W, 3) with the drawn triplet, or with the next one that can be read."""
        for step in range(len(self._triplets)):
            triplet = self._triplets[(drawn + step) % len(self._triplets)]
            cache = self._caches[id(triplet.sequence)]
            try:
                for row, neighbour in enumerate(NEIGHBOURS):
                    index = triplet.index + neighbour
                    file = str(triplet.sequence.file_of(index))
                    frames[row] = cache.rgb(index)
            except BrokenFrameError as error:
                self._skipped.setdefault(file, SkippedFile(file, str(error)))
            else:
                return triplet
        raise TrainingDataError(
            f"not one of {len(self._triplets)} triplets can be read; {len(self._skipped)} files are broken"
        )

    def _change(
        self,
        rng: np.random.Generator,
        frames: NDArray[np.uint8],
        jittered: NDArray[np.uint8],
        intrinsics: NDArray[np.float32],
    ) -> None:
        """Mirror (3, H, W, 3) frames and their intrinsics in place, and write the recoloured copy."""
        if not self._settings.augment:
            jittered[...] = frames
            return
        if rng.random() < 0.5:
            frames[...] = frames[:, :, ::-1].copy()
            intrinsics[0, 2] = (self._settings.width - 1) - intrinsics[0, 2]
        jittered[...] = ColorJitter.sample(rng).apply(frames)


def _tensors(frames: NDArray[np.uint8]) -> tuple[Tensor, Tensor, Tensor]:
    """(N, 3, H, W) pictures in 0..1 of the three frames of (N, 3 frames, H, W, 3 channels).

    NumPy makes the numbers, on this thread alone; channels come last in memory as they lie in the frames.
    """
    scale = np.float32(1.0 / 255.0)
    previous, target, following = (
        torch.from_numpy(np.multiply(frames[:, place], scale, dtype=np.float32)).permute(0, 3, 1, 2)
        for place in range(3)
    )
    return previous, target, following
