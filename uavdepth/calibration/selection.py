"""Few pictures that differ, out of many that are alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.calibration.board import Board
from uavdepth.calibration.detection import View

_ALIKE = 0.02
"""Two pictures nearer than this (in widths of the picture) add nothing but weight."""

_BLUR_WEIGHT = 0.05
_PERSPECTIVE_WEIGHT = 2.0
"""How much a pixel of edge width counts against a picture, and a share of foreshortening for it."""


def choose_views(
    views: Sequence[View], size: tuple[int, int], board: Board, at_most: int
) -> tuple[View, ...]:
    """Views that differ most in place, size, turn and tilt of the board, in their old order.

    Each next one is the farthest from all chosen ones (Gonzalez 1985), sharp ones first.

    Args:
        views: candidates.
        size: width and height of the pictures, pixels.
        board: the printed one.
        at_most: how many to choose.
    """
    if not views or at_most < 1:
        return ()
    places = np.array([_place(view, size, board) for view in views])
    blur = _BLUR_WEIGHT * np.array([view.edge_width_px for view in views])
    first = int(np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1) + blur))
    chosen = [first]
    distance = np.linalg.norm(places - places[first], axis=1)
    while len(chosen) < at_most:
        score = np.where(distance > _ALIKE, distance - blur, -np.inf)
        best = int(np.argmax(score))
        if not np.isfinite(score[best]):
            break
        chosen.append(best)
        distance = np.minimum(distance, np.linalg.norm(places - places[best], axis=1))
    return tuple(views[number] for number in sorted(chosen))


def _place(view: View, size: tuple[int, int], board: Board) -> NDArray[np.float64]:
    """(10,) the board's middle, half diagonals and turn in widths of the picture, then its foreshortening."""
    columns, rows = board.inner
    flat = board.corners_m[view.ids, :2] / np.float32(board.square_m)
    into_picture: Any = cv2.findHomography(flat, view.pixels, 0)[0]
    if into_picture is None:  # the detector has refused such views; a caller's own may still be
        return np.zeros(10)
    outer = np.array([[[0, 0], [columns - 1, 0], [columns - 1, rows - 1], [0, rows - 1]]], np.float64)
    corners = cv2.perspectiveTransform(outer, into_picture)[0] / size[0]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    shares = np.log(np.maximum(sides[:2], 1e-6) / np.maximum(sides[2:], 1e-6))
    # By the corners' mean and spread: a board of two-fold symmetry may be numbered from either end.
    middle = corners.mean(axis=0)
    diagonals = np.sort(np.linalg.norm(corners - middle, axis=1))
    axis = corners[1] - corners[0] + corners[2] - corners[3]
    double = np.arctan2(axis[1], axis[0]) * 2
    turn = 0.25 * np.array([np.cos(double), np.sin(double)]) * sides.mean()
    return np.concatenate([middle, diagonals, turn, _PERSPECTIVE_WEIGHT * 0.1 * np.abs(shares)])
