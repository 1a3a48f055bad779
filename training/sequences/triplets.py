"""Three consecutive frames: what self-supervised training learns from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from training.errors import TrainingDataError
from training.sequences.frame_sequence import FrameSequence

NEIGHBOURS = (-1, 0, 1)


@dataclass(frozen=True)
class Triplet:
    """Frames index - 1, index (the target) and index + 1 of one sequence."""

    sequence: FrameSequence
    index: int


class SkippedFile(NamedTuple):
    """A file that is left out, and why."""

    file: str
    reason: str


@dataclass(frozen=True)
class TripletSet:
    """The triplets of some sequences.

    Args:
        triplets: in the order of the sequences and frames.
        skipped: files whose triplets are left out, with the reason.
    """

    triplets: tuple[Triplet, ...]
    skipped: tuple[SkippedFile, ...] = ()

    def __len__(self) -> int:
        return len(self.triplets)

    @classmethod
    def from_sequences(cls, sequences: Sequence[FrameSequence]) -> TripletSet:
        """Every frame with two usable neighbours.

        Raises:
            TrainingDataError: no triplet at all.
        """
        triplets: list[Triplet] = []
        skipped: list[SkippedFile] = []
        for sequence in sequences:
            problems = [sequence.problem(index) for index in range(len(sequence))]
            for index, problem in enumerate(problems):
                if problem is not None:
                    skipped.append(SkippedFile(str(sequence.file_of(index)), problem))
            triplets += [
                Triplet(sequence, index)
                for index in range(1, len(sequence) - 1)
                if all(problems[index + step] is None for step in NEIGHBOURS)
            ]
        if not triplets:
            frames = sum(len(sequence) for sequence in sequences)
            raise TrainingDataError(
                f"{len(sequences)} sequences of {frames} frames hold no three usable frames in a row"
                + (
                    f"; first of {len(skipped)} problems: {skipped[0].file}: {skipped[0].reason}"
                    if skipped
                    else ""
                )
            )
        return cls(tuple(triplets), tuple(skipped))
