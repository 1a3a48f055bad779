"""Split files of the KITTI literature (Eigen et al. 2014, Zhou et al. 2017): which frames are for what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from training.errors import TrainingDataError
from training.sequences.kitti_raw import SIDES, KittiDrive
from training.sequences.triplets import NEIGHBOURS, SkippedFile, Triplet, TripletSet


@dataclass(frozen=True)
class SplitLine:
    """One frame of a split: `DATE/DRIVE NUMBER l` or r; the camera is the left one where none is said."""

    drive: str
    number: int
    side: str

    @property
    def sequence(self) -> str:
        """Name of the drive and camera."""
        return f"{self.drive}/image_{SIDES[self.side]}"


class SplitFrames(NamedTuple):
    """Frames of a split as (drive, index), and the lines whose frame is not there."""

    frames: tuple[tuple[KittiDrive, int], ...]
    skipped: tuple[SkippedFile, ...]


def read_split(path: Path) -> list[SplitLine]:
    """The lines of a split file.

    Raises:
        TrainingDataError: missing, empty, or a line of another form.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TrainingDataError(f"cannot read the split file {path}: {error}") from error
    lines = [
        _read_line(path, number, line.split())
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip()
    ]
    if not lines:
        raise TrainingDataError(f"the split file {path} is empty")
    return lines


def split_frames(drives: Sequence[KittiDrive], lines: Sequence[SplitLine]) -> SplitFrames:
    """The frames of a split, for measuring: neighbours are not needed.

    Raises:
        TrainingDataError: not one of them is there.
    """
    by_name = {drive.name: drive for drive in drives}
    frames: list[tuple[KittiDrive, int]] = []
    skipped: list[SkippedFile] = []
    for line in lines:
        drive = by_name.get(line.sequence)
        index = drive.index_of(line.number) if drive is not None else None
        if drive is None or index is None:
            what = "no such drive" if drive is None else "no such frame"
            skipped.append(SkippedFile(f"{line.sequence}/{line.number:010d}", what))
        elif (problem := drive.problem(index)) is not None:
            skipped.append(SkippedFile(str(drive.file_of(index)), problem))
        else:
            frames.append((drive, index))
    if not frames:
        raise TrainingDataError(
            f"not one of the split's {len(lines)} frames is there; the first is {skipped[0].file}: "
            f"{skipped[0].reason}"
        )
    return SplitFrames(tuple(frames), tuple(skipped))


def split_triplets(drives: Sequence[KittiDrive], lines: Sequence[SplitLine]) -> TripletSet:
    """The frames of a split that have two usable neighbours, for training.

    Raises:
        TrainingDataError: not one of them has.
    """
    chosen = split_frames(drives, lines)
    triplets: list[Triplet] = []
    skipped = list(chosen.skipped)
    for drive, index in chosen.frames:
        if all(_usable(drive, index + step) for step in NEIGHBOURS):
            triplets.append(Triplet(drive, index))
        else:
            skipped.append(SkippedFile(str(drive.file_of(index)), "without two usable neighbours"))
    if not triplets:
        raise TrainingDataError(f"not one of the split's {len(lines)} frames has two usable neighbours")
    return TripletSet(tuple(triplets), tuple(skipped))


def _usable(drive: KittiDrive, index: int) -> bool:
    return 0 <= index < len(drive) and drive.problem(index) is None


def _read_line(path: Path, number: int, words: list[str]) -> SplitLine:
    if len(words) not in (2, 3) or not words[1].isdigit() or words[2:] not in ([], ["l"], ["r"]):
        raise TrainingDataError(
            f"{path}, line {number} is {' '.join(words)!r}: DATE/DRIVE, a frame number and l or r are needed"
        )
    return SplitLine(words[0], int(words[1]), words[2] if len(words) == 3 else "l")
