"""Picture sheet of an evaluation: what was seen, what is true, what the network says and where it errs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import EvaluationError
from training.metrics import DEPTH_CAP_M, measurable
from uavdepth.depth.colors import UNKNOWN_BGR, colorize_depth

_PANEL_WIDTH_PX = 320
_CAPTION_PX = 22
_GAP_PX = 6
_BAR_PX = 12
_NEAR_M, _FAR_M = 1.0, 80.0
_LARGEST_ERROR = 0.5
_SMALLEST_SIGMA, _LARGEST_SIGMA = 0.02, 1.0
_SPARSE_SHARE = 0.25
"""Truth at fewer pixels than this comes from a LiDAR: its points are drawn larger."""
_PAPER_BGR, _INK_BGR = (24, 24, 24), (225, 225, 225)


@dataclass(frozen=True)
class SheetRow:
    """One picture of the sheet.

    Args:
        caption: line above it.
        image_bgr: (H, W, 3) uint8 what the camera saw.
        truth_m: (H, W) float32 z-depth in metres, NaN where not known.
        predicted_m: (H, W) float32 z-depth in metres, NaN where unknown.
        relative_sigma: (H, W) float32 the network's doubt, or None.
    """

    caption: str
    image_bgr: NDArray[np.uint8]
    truth_m: NDArray[np.float32]
    predicted_m: NDArray[np.float32]
    relative_sigma: NDArray[np.float32] | None = None


def write_sheet(path: Path, rows: Sequence[SheetRow], columns: int = 1) -> None:
    """Draw a sheet into a PNG.

    Raises:
        EvaluationError: no rows, or a file that cannot be written.
    """
    picture = draw_sheet(rows, columns)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    except OSError as error:
        raise EvaluationError(f"cannot write the picture sheet {path}: {error.strerror}") from error


def draw_sheet(rows: Sequence[SheetRow], columns: int = 1) -> NDArray[np.uint8]:
    """Rows of picture, truth, prediction, error and, where there is one, doubt.

    Depth: lighter = nearer, logarithmic from 1 to 80 m. Error: blue = said nearer than it is, red = said
    farther than it is, the log of prediction over truth to +-50 %, only where it is scored. Doubt: dark =
    sure, light = unsure, logarithmic from 0.02 to 1. Grey = not known.

    Args:
        rows: at least one; all are drawn as wide, with their own aspect.
        columns: rows beside each other.

    Returns:
        (h, w, 3) uint8 BGR.

    Raises:
        EvaluationError: no rows.
    """
    if not rows:
        raise EvaluationError("no picture was measured: there is no sheet to draw")
    with_sigma = any(row.relative_sigma is not None for row in rows)
    drawn = [_draw_row(row, with_sigma) for row in rows]
    tallest = max(len(picture) for picture in drawn)
    drawn = [_padded(picture, tallest) for picture in drawn]
    while len(drawn) % columns:
        drawn.append(_paper(*drawn[0].shape[:2]))
    lines = [np.hstack(drawn[start : start + columns]) for start in range(0, len(drawn), columns)]
    legend = np.hstack([_legend(with_sigma)] * columns)
    return np.vstack([legend, *lines])


def spread_evenly(count: int, wanted: int) -> list[int]:
    """At most `wanted` different numbers below `count`, in the middles of equal parts."""
    rows = min(wanted, count)
    return [int((row + 0.5) * count / rows) for row in range(rows)]


def _draw_row(row: SheetRow, with_sigma: bool) -> NDArray[np.uint8]:
    height, width = row.image_bgr.shape[:2]
    size = (_PANEL_WIDTH_PX, max(1, round(_PANEL_WIDTH_PX * height / width)))
    sparse = float(np.mean(~np.isnan(row.truth_m))) < _SPARSE_SHARE
    panels = [
        np.asarray(cv2.resize(row.image_bgr, size, interpolation=cv2.INTER_AREA), np.uint8),
        _panel(colorize_depth(row.truth_m, _NEAR_M, _FAR_M), size, sparse),
        _panel(colorize_depth(row.predicted_m, _NEAR_M, _FAR_M), size),
        _panel(_error_colors(row.truth_m, row.predicted_m), size, sparse),
    ]
    if with_sigma:
        sigma = np.full_like(row.truth_m, np.nan) if row.relative_sigma is None else row.relative_sigma
        panels.append(_panel(_sigma_colors(sigma), size))
    return np.vstack([_caption(row.caption, _width(len(panels))), _side_by_side(panels)])


def _panel(colors: NDArray[np.uint8], size: tuple[int, int], sparse: bool = False) -> NDArray[np.uint8]:
    """Colours at the panel's size; those of a sparse map as blots, so that they can be seen."""
    if sparse:
        known = np.any(colors != np.array(UNKNOWN_BGR, np.uint8), axis=-1)
        colors = _blots(colors, known, max(3, 3 * colors.shape[1] // _PANEL_WIDTH_PX))
    return np.asarray(cv2.resize(colors, size, interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)


def _blots(colors: NDArray[np.uint8], known: NDArray[np.bool_], reach_px: int) -> NDArray[np.uint8]:
    """Every pixel within reach of a known one takes the colour of the nearest known one."""
    if not known.any():
        return colors
    distance, label = cv2.distanceTransformWithLabels(
        np.where(known, 0, 255).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    by_label = np.zeros((int(label.max()) + 1, 3), np.uint8)
    by_label[label[known]] = colors[known]
    return np.where((distance <= reach_px)[..., None], by_label[label], colors).astype(np.uint8)


def _error_colors(truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32]) -> NDArray[np.uint8]:
    scored = measurable(truth_m, predicted_m)
    with np.errstate(all="ignore"):
        error = np.log(np.minimum(predicted_m, DEPTH_CAP_M) / truth_m) / math.log1p(_LARGEST_ERROR)
    codes = np.rint(np.clip(np.where(scored, error, 0.0), -1.0, 1.0) * 127.0 + 128.0).astype(np.uint8)
    colors = np.asarray(cv2.applyColorMap(codes, _blue_to_red()), np.uint8)
    colors[~scored] = UNKNOWN_BGR
    return colors


def _sigma_colors(sigma: NDArray[np.float32]) -> NDArray[np.uint8]:
    known = np.isfinite(sigma)
    span = math.log(_LARGEST_SIGMA / _SMALLEST_SIGMA)
    bounded = np.clip(np.where(known, sigma, _LARGEST_SIGMA), _SMALLEST_SIGMA, _LARGEST_SIGMA)
    codes = np.rint(np.log(bounded / _SMALLEST_SIGMA) / span * 255.0).astype(np.uint8)
    colors = np.asarray(cv2.applyColorMap(codes, cv2.COLORMAP_VIRIDIS), np.uint8)
    colors[~known] = UNKNOWN_BGR
    return colors


@lru_cache(maxsize=1)
def _blue_to_red() -> NDArray[np.uint8]:
    """(256, 1, 3) BGR: blue over white to red."""
    side = np.linspace(-1.0, 1.0, 256)
    fading = 255.0 * (1.0 - np.abs(side))
    blue = np.where(side < 0, 255.0, fading)
    red = np.where(side > 0, 255.0, fading)
    return np.stack([blue, fading, red], axis=-1)[:, None].round().astype(np.uint8)


def _legend(with_sigma: bool) -> NDArray[np.uint8]:
    """What the panels are, and their scales."""
    along = np.linspace(0.0, 1.0, _PANEL_WIDTH_PX, dtype=np.float32)[None]
    depth = (_NEAR_M * (_FAR_M / _NEAR_M) ** along).astype(np.float32)
    ratio = (1.0 + _LARGEST_ERROR) ** (2.0 * along - 1.0)
    sigma = (_SMALLEST_SIGMA * (_LARGEST_SIGMA / _SMALLEST_SIGMA) ** along).astype(np.float32)
    depth_colors = colorize_depth(depth, _NEAR_M, _FAR_M)
    ones = np.ones_like(depth)
    parts = [
        ("camera; grey elsewhere: not known", None),
        (f"truth: {_NEAR_M:g} m (light) to {_FAR_M:g} m", depth_colors),
        (f"prediction: {_NEAR_M:g} m (light) to {_FAR_M:g} m", depth_colors),
        ("error: said too near (blue), too far (red)", _error_colors(ones, ratio.astype(np.float32))),
    ]
    if with_sigma:
        parts.append(
            (f"relative sigma: {_SMALLEST_SIGMA:g} (dark) to {_LARGEST_SIGMA:g}", _sigma_colors(sigma))
        )
    panels = []
    for text, colors in parts:
        bar = _paper(_BAR_PX, _PANEL_WIDTH_PX) if colors is None else np.repeat(colors, _BAR_PX, axis=0)
        panels.append(np.vstack([_caption(text, _PANEL_WIDTH_PX), bar]))
    return _side_by_side(panels)


def _side_by_side(panels: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    margin = _paper(len(panels[0]), _GAP_PX)
    return np.hstack([part for panel in panels for part in (panel, margin)])


def _width(panels: int) -> int:
    return panels * (_PANEL_WIDTH_PX + _GAP_PX)


def _padded(picture: NDArray[np.uint8], height: int) -> NDArray[np.uint8]:
    return np.vstack([picture, _paper(height - len(picture), picture.shape[1])])


def _paper(height: int, width: int) -> NDArray[np.uint8]:
    return np.full((height, width, 3), _PAPER_BGR, np.uint8)


def _caption(text: str, width: int) -> NDArray[np.uint8]:
    bar = _paper(_CAPTION_PX, width)
    cv2.putText(bar, text, (6, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _INK_BGR, 1, cv2.LINE_AA)
    return bar
