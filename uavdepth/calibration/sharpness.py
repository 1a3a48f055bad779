"""How wide the board's edges are in a picture."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_HALF_PROFILE = 0.4
"""Of a square's side: how far a profile across an edge reaches into both squares."""

_SAMPLES = 161
_PLACES = (0.3, 0.5, 0.7)
"""Where between two corners the edge is crossed."""


def edge_width_px(
    gray: NDArray[np.uint8],
    inner: tuple[int, int],
    ids: NDArray[np.intp],
    pixels: NDArray[np.float32],
) -> float:
    """Width of the edges between neighbouring corners: contrast over steepest slope.

    For a Gaussian blur of s pixels it is about 2.5 s (square root of 2 pi). Edges along the board's rows and
    along its columns are taken apart and the wider median counts: motion blurs one of the two.

    Args:
        gray: (H, W) uint8.
        inner: columns and rows of inner corners.
        ids: (N,) corners row by row.
        pixels: (N, 2) float32 where they were seen.

    Returns:
        pixels; infinity where no two neighbours were seen.
    """
    at = dict(zip((int(number) for number in ids), pixels.astype(np.float64), strict=True))
    columns = inner[0]
    along_rows = [(i, i + 1) for i in at if i + 1 in at and (i + 1) % columns]
    along_columns = [(i, i + columns) for i in at if i + columns in at]
    blurs = [
        float(np.median(_widths(gray, np.array([(at[a], at[b]) for a, b in pairs]))))
        for pairs in (along_rows, along_columns)
        if pairs
    ]
    return max(blurs, default=float("inf"))


def _widths(gray: NDArray[np.uint8], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M,) widths in pixels of (E, 2, 2) edges, each from corner to corner, crossed at some places."""
    begin, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    length = np.linalg.norm(along, axis=1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    steps = np.linspace(-_HALF_PROFILE, _HALF_PROFILE, _SAMPLES)
    places = begin[:, None] + np.array(_PLACES)[None, :, None] * along[:, None]
    reach = (length[:, None] * steps)[:, None, :, None] * across[:, None, None, :]
    points = (places[:, :, None, :] + reach).reshape(-1, _SAMPLES, 2).astype(np.float32)
    sampled = cv2.remap(
        gray.astype(np.float32),
        points[..., 0],
        points[..., 1],
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    profiles = np.asarray(sampled, np.float32)
    contrast = np.ptp(profiles, axis=1)
    step_px = np.repeat(length, len(_PLACES)) * (steps[1] - steps[0])
    # Slope over one pixel: on finer steps, linear interpolation shows only the pixels' own differences.
    slope = _steepest(profiles, step_px)
    return np.asarray(np.where(slope > 0, contrast / np.maximum(slope, 1e-9), np.inf), np.float64)


def _steepest(profiles: NDArray[np.float32], step_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """(M,) largest change of brightness a pixel of (M, S) profiles."""
    lag = max(1, min(_SAMPLES // 4, round(1.0 / float(np.median(step_px)))))
    change = np.abs(profiles[:, lag:] - profiles[:, :-lag]).max(axis=1)
    return np.asarray(change / (lag * step_px), np.float64)
