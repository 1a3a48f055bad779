"""Corners followed through the pictures of one camera.

Corners by the smaller eigenvalue of the structure tensor: Shi and Tomasi (1994), "Good Features to Track".
Followed by Lucas and Kanade (1981) on a pyramid: Bouguet (2000), "Pyramidal Implementation of the Lucas
Kanade Feature Tracker". Followed back to where they came from, those that do not return are dropped:
Kalal, Mikolajczyk and Matas (2010), "Forward-Backward Error".
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

MOST_TRACKS = 240
MOST_FRAMES = 32
"""Positions of so many pictures are kept: 2 s at 15 pictures a second."""

_SEARCH_WIDTH = 320
"""New corners are sought in a picture of about this width; the lengths of the search are its pixels."""

_CELL_PX = 10
"""At most one corner in each cell of so many pixels squared, so that they spread over the picture."""

_BORDER_PX = 4
_NEIGHBOUR_PX = 6
"""New corners stay so far from those that are followed already."""

_LEAST_EIGENVALUE = 2e-4
"""Of a picture of 0 to 1; noise of 2 grey values of 255 stays below it."""

_WINDOW_PX = 11
_PYRAMID_LEVELS = 3
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 0.03)
_RETURN_PX = 0.4
_SPARE_TRACKS = 30
"""New corners are sought when so many are missing."""


class FeatureTracks:
    """Up to `MOST_TRACKS` corners and where they were in the last pictures."""

    def __init__(self) -> None:
        self._grey: NDArray[np.uint8] | None = None
        self._shape: tuple[int, ...] = ()
        self._next = 0
        self.ids = np.empty(0, dtype=np.int64)
        """(N,) number of each live track; no number is used twice."""
        self.positions = np.empty((0, 0, 2), dtype=np.float32)
        """(F, N, 2) x, y in the last F pictures, newest last, NaN where a track had not begun."""

    def clear(self) -> None:
        """Forget all tracks (their numbers are not used again)."""
        self._grey = None
        self.ids = np.empty(0, dtype=np.int64)
        self.positions = np.empty((0, 0, 2), dtype=np.float32)

    def update(self, grey: NDArray[np.uint8], expected: NDArray[np.float32] | None = None) -> None:
        """Follow all tracks into the next picture.

        Args:
            grey: (H, W) uint8; a change of size begins anew.
            expected: (N, 2) where the live tracks are expected in it, NaN for "where they were".
        """
        if grey.shape != self._shape:
            self.clear()
            self._shape = grey.shape
        if self._grey is not None and len(self.ids):
            self._follow(self._grey, grey, expected)
        else:
            self.positions = np.empty((self.positions.shape[0], 0, 2), dtype=np.float32)
            self._append(np.empty((0, 2), dtype=np.float32))
        self._grey = grey

    def renew(self) -> None:
        """Begin new tracks in the picture that was followed last, where there are few."""
        if self._grey is not None and len(self.ids) <= MOST_TRACKS - _SPARE_TRACKS:
            self._begin(self._grey)

    def _follow(
        self,
        before: NDArray[np.uint8],
        after: NDArray[np.uint8],
        expected: NDArray[np.float32] | None,
    ) -> None:
        start = np.ascontiguousarray(self.positions[-1])
        guess = start.copy()
        if expected is not None:
            known = np.isfinite(expected).all(axis=1)
            guess[known] = expected[known]
        found, ok = _flow(before, after, start, guess, _PYRAMID_LEVELS)
        # The way back begins where it should end: it has only to stay there, on the finest level.
        back, returned = _flow(after, before, found, start, 0)
        height, width = self._shape
        good = ok & returned
        good &= np.abs(back - start).max(axis=1) < _RETURN_PX
        good &= (found >= _BORDER_PX).all(axis=1)
        good &= (found[:, 0] < width - _BORDER_PX) & (found[:, 1] < height - _BORDER_PX)
        good &= _apart(found, good)
        self.ids = self.ids[good]
        self.positions = self.positions[:, good]
        self._append(found[good])

    def _append(self, newest: NDArray[np.float32]) -> None:
        kept = self.positions[-(MOST_FRAMES - 1) :]
        self.positions = np.concatenate([kept, newest[None]], axis=0)

    def _begin(self, grey: NDArray[np.uint8]) -> None:
        # Where a corner lies to a fraction of a pixel does not matter, only that it is the same later on.
        shrink = max(1, round(grey.shape[1] / _SEARCH_WIDTH))
        size = grey.shape[1] // shrink, grey.shape[0] // shrink
        small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA) if shrink > 1 else grey
        strength = cv2.cornerMinEigenVal(small, 3, ksize=3)
        free = (strength == cv2.dilate(strength, np.ones((3, 3), np.uint8))) & (strength > _LEAST_EIGENVALUE)
        free[:_BORDER_PX], free[-_BORDER_PX:] = False, False
        free[:, :_BORDER_PX], free[:, -_BORDER_PX:] = False, False
        taken = np.zeros(small.shape, np.uint8)
        live = np.rint((self.positions[-1] + 0.5) / shrink - 0.5).astype(np.intp)
        column, row = np.minimum(live, np.array(size) - 1).T
        taken[row, column] = 1
        side = 2 * _NEIGHBOUR_PX + 1
        free &= cv2.dilate(taken, np.ones((side, side), np.uint8)) == 0
        row, column = np.nonzero(free)
        order = np.argsort(-strength[row, column], kind="stable")
        row, column = row[order], column[order]
        cell = (row // _CELL_PX) * (size[0] // _CELL_PX + 1) + column // _CELL_PX
        first = np.sort(np.unique(cell, return_index=True)[1])[: MOST_TRACKS - len(self.ids)]
        new = np.stack([column[first], row[first]], axis=1).astype(np.float32)
        new = (new + np.float32(0.5)) * np.float32(shrink) - np.float32(0.5)
        past = np.full((len(self.positions), len(new), 2), np.nan, dtype=np.float32)
        past[-1] = new
        self.positions = np.concatenate([self.positions, past], axis=1)
        self.ids = np.concatenate([self.ids, np.arange(self._next, self._next + len(new))])
        self._next += len(new)


def _flow(
    before: NDArray[np.uint8],
    after: NDArray[np.uint8],
    start: NDArray[np.float32],
    guess: NDArray[np.float32],
    levels: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(N, 2) where the points of one picture are in the other, and (N,) whether they were found."""
    found, ok, _ = cv2.calcOpticalFlowPyrLK(
        before,
        after,
        start,
        guess.copy(),
        winSize=(_WINDOW_PX, _WINDOW_PX),
        maxLevel=levels,
        criteria=_CRITERIA,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(found, dtype=np.float32), np.asarray(ok).ravel() == 1


def _apart(found: NDArray[np.float32], good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of tracks that ran into one another (within a pixel) the first, which is the oldest, stays."""
    key = np.full(len(found), -1, dtype=np.int64)
    cell = np.rint(found[good]).astype(np.int64)
    key[good] = cell[:, 1] * 65536 + cell[:, 0]
    apart = np.zeros(len(found), dtype=bool)
    apart[np.unique(key, return_index=True)[1]] = True
    return apart
