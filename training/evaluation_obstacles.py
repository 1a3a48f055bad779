"""What counts in flight: the nearest obstacle in each direction, from predicted and from true depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

MEASURED_M = (2.0, 20.0)
"""Elements whose true nearest obstacle lies in this span are measured."""

TOO_FAR = 1.5
"""An obstacle that is said to be farther than this many times its distance counts as missed."""

SCAN_RANGE_M = MEASURED_M[1] * TOO_FAR
"""Range of the scans that are compared: a shorter one would call 21 m instead of 19 m "clear"."""

FALSE_ALARM_M = MEASURED_M[1] / 2
"""An obstacle nearer than this where nothing stands within the measured span is a false alarm."""


@dataclass(frozen=True)
class ElementErrors:
    """Elements of 5 degrees of one picture, or of many.

    Args:
        measured: elements whose true nearest obstacle lies in `MEASURED_M`.
        missed_clear: of those, reported clear.
        missed_far: of those, reported more than `TOO_FAR` times as far.
        alone: of both kinds of missed, those beside which neither neighbour reported it in time either.
        unknown: of those, reported unknown; the vehicle then knows that it does not know.
        free: elements that are truly free up to the end of `MEASURED_M`.
        false_alarms: of those, reported with an obstacle nearer than `FALSE_ALARM_M`.
        relative_errors: (n,) float32, |reported - true| / true wherever an obstacle was reported.
    """

    measured: int
    missed_clear: int
    missed_far: int
    alone: int
    unknown: int
    free: int
    false_alarms: int
    relative_errors: NDArray[np.float32]

    @property
    def missed_share(self) -> float | None:
        """Missed over measured; None where nothing was measured."""
        return _share(self.missed_clear + self.missed_far, self.measured)

    @property
    def alone_share(self) -> float | None:
        """Missed by the element and both its neighbours, over measured."""
        return _share(self.alone, self.measured)

    @property
    def unknown_share(self) -> float | None:
        """Unknown over measured."""
        return _share(self.unknown, self.measured)

    @property
    def false_alarm_share(self) -> float | None:
        """False alarms over truly free elements."""
        return _share(self.false_alarms, self.free)

    @property
    def median_error(self) -> float | None:
        """Median relative error of reported distances; None where none was reported."""
        return float(np.median(self.relative_errors)) if self.relative_errors.size else None


def compare_scans(truth: ObstacleScan, reported: ObstacleScan) -> ElementErrors:
    """Element by element; both scans have a range of `SCAN_RANGE_M`.

    Args:
        truth: scan of the true depth.
        reported: scan of the predicted depth, with what the vehicle knows of attitude and height.
    """
    found = reported.state == SectorState.OBSTACLE
    with np.errstate(invalid="ignore"):
        obstacle = truth.state == SectorState.OBSTACLE
        measured = obstacle & (truth.distance_m >= MEASURED_M[0]) & (truth.distance_m <= MEASURED_M[1])
        late = found & (reported.distance_m > TOO_FAR * truth.distance_m)
        free = (truth.state == SectorState.CLEAR) | (obstacle & (truth.distance_m > MEASURED_M[1]))
        alarm = found & (reported.distance_m < FALSE_ALARM_M)
    clear = reported.state == SectorState.CLEAR
    missed = measured & (clear | late)
    errors = (
        np.abs(reported.distance_m - truth.distance_m)[measured & found] / truth.distance_m[measured & found]
    )
    return ElementErrors(
        measured=_count(measured),
        missed_clear=_count(measured & clear),
        missed_far=_count(measured & late),
        alone=_count(missed & ~_warned_beside(truth, reported)),
        unknown=_count(measured & (reported.state == SectorState.UNKNOWN)),
        free=_count(free),
        false_alarms=_count(free & alarm),
        relative_errors=errors.astype(np.float32),
    )


def all_elements(pictures: Sequence[ElementErrors]) -> ElementErrors | None:
    """The elements of many pictures together; None for no pictures."""
    if not pictures:
        return None
    counts = {
        name: sum(getattr(item, name) for item in pictures)
        for name in (
            "measured",
            "missed_clear",
            "missed_far",
            "alone",
            "unknown",
            "free",
            "false_alarms",
        )
    }
    return ElementErrors(
        **counts, relative_errors=np.concatenate([item.relative_errors for item in pictures])
    )


def _warned_beside(truth: ObstacleScan, reported: ObstacleScan) -> NDArray[np.bool_]:
    """Elements next to which an obstacle is reported in time for their own true one."""
    distance = np.where(reported.state == SectorState.OBSTACLE, reported.distance_m, np.inf)
    beside = np.minimum(np.roll(distance, 1), np.roll(distance, -1))
    with np.errstate(invalid="ignore"):
        return np.asarray(beside <= TOO_FAR * truth.distance_m, np.bool_)


def _count(chosen: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(chosen))


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
