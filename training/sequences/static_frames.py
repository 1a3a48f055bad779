"""Leaving out frames in which the camera stands still: they teach that nothing is near (Zhou et al. 2017)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.frame_cache import FrameCache
from training.sequences.triplets import SkippedFile, Triplet, TripletSet


def leave_out_static(
    triplets: TripletSet, min_difference: float, cache_folder: Path, width: int, height: int
) -> TripletSet:
    """The triplets whose target differs from both neighbours.

    Args:
        triplets: to choose from.
        min_difference: smallest mean absolute difference of two frames, in levels of 255.
        cache_folder, width, height: as for training, so that the frames decoded here are kept for it.

    Raises:
        TrainingDataError: none is left, or the cache cannot be written.
    """
    caches: dict[int, FrameCache] = {}
    kept: list[Triplet] = []
    skipped = list(triplets.skipped)
    for triplet in triplets.triplets:
        sequence = triplet.sequence
        if id(sequence) not in caches:
            caches[id(sequence)] = FrameCache(cache_folder, sequence, width, height)
        file = str(sequence.file_of(triplet.index))
        try:
            difference = _difference(caches[id(sequence)], triplet.index)
        except BrokenFrameError as error:
            skipped.append(SkippedFile(file, str(error)))
            continue
        if difference >= min_difference:
            kept.append(triplet)
        else:
            skipped.append(SkippedFile(file, f"static: {difference:.2f} of 255 levels from its neighbour"))
    if not kept:
        raise TrainingDataError(
            f"all {len(triplets)} triplets are static: none differs by {min_difference:g} levels of 255"
        )
    return TripletSet(tuple(kept), tuple(skipped))


def _difference(cache: FrameCache, index: int) -> float:
    """Smaller of the mean absolute differences to the two neighbours, levels."""
    target = cache.rgb(index).astype(np.int16)
    return min(float(np.abs(target - cache.rgb(index + step)).mean()) for step in (-1, 1))
