"""Which scene seeds are for learning, for choosing and for the final measurement. They never mix."""

from __future__ import annotations

from enum import Enum

from training.errors import TrainingDataError
from uavdepth.scenes import HELD_OUT_SCENES


class SeedSplit(Enum):
    """The three ranges of scene seeds."""

    TRAIN = range(0, 900)
    VALIDATION = range(900, 1000)
    TEST = range(1000, 1_000_000)

    @classmethod
    def of(cls, seed: int) -> SeedSplit:
        """The range that `seed` belongs to. Raises TrainingDataError for a seed outside all."""
        for split in cls:
            if seed in split.value:
                return split
        raise TrainingDataError(f"scene seed is {seed}: 0 to {cls.TEST.value.stop - 1} is needed")

    def require_world(self, scene: str, seed: int) -> None:
        """Raise TrainingDataError unless this split may see that world: some scenes are never trained on."""
        self.require(seed)
        if self is SeedSplit.TRAIN and scene in HELD_OUT_SCENES:
            raise TrainingDataError(f"scene {scene!r} is held out: no training may see it, whatever its seed")

    def require(self, seed: int) -> None:
        """Raise TrainingDataError unless `seed` belongs to this split."""
        actual = SeedSplit.of(seed)
        if actual is not self:
            raise TrainingDataError(
                f"scene seed {seed} belongs to {actual.name.lower()}; {self.name.lower()} has "
                f"{self.value.start} to {self.value.stop - 1}"
            )
