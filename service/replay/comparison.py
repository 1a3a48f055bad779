"""A replay against its golden scans: what differs, where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from service.replay.golden import Golden, GoldenScan
from uavdepth.scan.obstacle_scan import SectorState, sector_bearings_deg

_SHOWN = 12
_LETTERS = {SectorState.UNKNOWN: "unknown", SectorState.CLEAR: "clear"}


@dataclass(frozen=True)
class Difference:
    """One element that differs.

    Args:
        index, at_ms: the picture.
        element: which of the 72.
        before, now: in words.
    """

    index: int
    at_ms: int
    element: int
    before: str
    now: str

    def __str__(self) -> str:
        bearing = (float(sector_bearings_deg()[self.element]) + 180.0) % 360.0 - 180.0
        where = f"{self.at_ms / 1000:7.2f} s  picture {self.index}  {bearing:+.0f} deg"
        return f"{where}: {self.before} -> {self.now}"


@dataclass(frozen=True)
class Comparison:
    """What came of a comparison.

    Args:
        complaints: what is beyond the tolerances, in words; empty if the replay passes.
        differences: elements that differ by more than distances may.
        troubles: scans that are trusted in one and not in the other, in words.
        elements: elements compared.
        scans: scans compared.
        changed: (scans, 72) bool, which elements differ.
    """

    complaints: tuple[str, ...]
    differences: tuple[Difference, ...]
    troubles: tuple[str, ...]
    elements: int
    scans: int
    changed: NDArray[np.bool_]

    @property
    def passed(self) -> bool:
        """Whether the replay is within the tolerances."""
        return not self.complaints

    def lines(self) -> list[str]:
        """The comparison in words; the largest part of a long list is left out."""
        share = len(self.differences) / max(self.elements, 1)
        verdict = "as golden" if self.passed else "DIFFERS"
        lines = [
            f"{verdict}: {self.scans} scans, {len(self.differences)} of {self.elements} elements differ "
            f"({share:.2%}), {len(self.troubles)} scans in trust"
        ]
        lines += [f"  {complaint}" for complaint in self.complaints]
        told = [*self.troubles, *map(str, self.differences)] if not self.passed else []
        lines += [f"    {text}" for text in told[:_SHOWN]]
        if len(told) > _SHOWN:
            lines.append(f"    and {len(told) - _SHOWN} more")
        return lines


def compare(golden: Golden, now: Sequence[GoldenScan]) -> Comparison:
    """Hold a replay against golden scans, by the golden file's own tolerances."""
    allowed = golden.tolerances
    complaints: list[str] = []
    old_of = {scan.index: scan for scan in golden.scans}
    new_of = {scan.index: scan for scan in now}
    missing, extra = old_of.keys() - new_of.keys(), new_of.keys() - old_of.keys()
    if missing or extra:
        complaints.append(
            f"other pictures: {len(missing)} of {len(old_of)} are missing, {len(extra)} are new"
        )
    both = sorted(old_of.keys() & new_of.keys())
    changed = np.zeros((len(both), len(sector_bearings_deg())), np.bool_)
    differences: list[Difference] = []
    troubles: list[str] = []
    worst, worst_index = 0, 0
    for row, index in enumerate(both):
        old, new = old_of[index], new_of[index]
        if (old.trouble is None) != (new.trouble is None):
            before, after = old.trouble or "trusted", new.trouble or "trusted"
            troubles.append(f"{old.at_ms / 1000:7.2f} s  picture {index}: {before} -> {after}")
            continue
        found = _changed(old, new, allowed.distance_m, allowed.distance_share)
        changed[row] = found
        for element in map(int, np.flatnonzero(found)):
            words = _word(old, element), _word(new, element)
            differences.append(Difference(index, old.at_ms, element, *words))
        if int(found.sum()) > worst:
            worst, worst_index = int(found.sum()), index
    elements = changed.size
    if len(differences) > allowed.changed_elements * elements:
        complaints.append(
            f"{len(differences) / max(elements, 1):.2%} of the elements differ: "
            f"{allowed.changed_elements:.2%} may"
        )
    if worst > allowed.changed_in_scan:
        complaints.append(
            f"picture {worst_index}: {worst} elements differ: {allowed.changed_in_scan} of one scan may"
        )
    if len(troubles) > allowed.changed_troubles * len(both):
        complaints.append(
            f"{len(troubles)} of {len(both)} scans differ in trust: {allowed.changed_troubles:.1%} may"
        )
    return Comparison(tuple(complaints), tuple(differences), tuple(troubles), elements, len(both), changed)


def _changed(old: GoldenScan, new: GoldenScan, metres: float, share: float) -> NDArray[np.bool_]:
    old_m, new_m = old.distance_m, new.distance_m
    both = (old.state == SectorState.OBSTACLE) & (new.state == SectorState.OBSTACLE)
    with np.errstate(invalid="ignore"):
        far = np.abs(old_m - new_m) > np.maximum(metres, share * np.maximum(old_m, new_m))
    return np.asarray((old.state != new.state) | (both & far), np.bool_)


def _word(scan: GoldenScan, element: int) -> str:
    state = SectorState(int(scan.state[element]))
    return _LETTERS.get(state) or f"{scan.distance_m[element]:.2f} m"
