"""Picture sheet of an evaluation: what was seen, what is true, what the network says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from training.evaluation import MeasuredFrame, Method
from training.evaluation_frames import EvaluationFrame
from uavdepth.depth_colors import colorize_depth

_PANEL_PX = (320, 160)
_CAPTION_PX = 22
_GAP_PX = 6
_NEAR_M, _FAR_M = 1.0, 80.0
_PAPER_BGR, _INK_BGR = (24, 24, 24), (225, 225, 225)


@dataclass(frozen=True)
class SheetRow:
    """One frame of the sheet: (H, W, 3) picture and (H, W) depths in metres, with a caption."""

    caption: str
    image_bgr: NDArray[np.uint8]
    truth_m: NDArray[np.float32]
    predicted_m: NDArray[np.float32]

    @classmethod
    def of(cls, item: EvaluationFrame, measured: MeasuredFrame) -> SheetRow:
        """Row of a measured frame; the prediction is drawn at the truth's median, as the caption says."""
        errors = measured.errors
        factor = errors.median_factor
        network = errors.methods.get(Method.NETWORK)
        caption = f"{item.scene}:{item.seed} #{item.index}"
        if factor is not None and network is not None:
            ground = "-" if errors.ground_factor is None else f"{errors.ground_factor:.2f}"
            caption += (
                f"  Abs Rel {network.scaled.abs_rel:.3f} scaled, {network.unscaled.abs_rel:.3f} as given; "
                f"factor {factor:.2f}, from the ground {ground}"
            )
        shown = measured.predicted_m * np.float32(1.0 if factor is None else factor)
        return cls(caption, item.frame.image_bgr, item.frame.depth_m, shown)


def draw_sheet(rows: Sequence[SheetRow], columns: int = 2) -> NDArray[np.uint8]:
    """Rows of picture, truth and prediction; lighter = nearer, logarithmic from 1 to 80 m.

    Args:
        rows: at least one.
        columns: rows beside each other.

    Returns:
        (h, w, 3) uint8 BGR.
    """
    drawn = [_draw_row(row) for row in rows]
    while len(drawn) % columns:
        drawn.append(np.full_like(drawn[0], _PAPER_BGR))
    lines = [np.hstack(drawn[start : start + columns]) for start in range(0, len(drawn), columns)]
    legend = _caption(
        f"camera | truth | network at the truth's median: lighter = nearer, {_NEAR_M:g} to {_FAR_M:g} m",
        lines[0].shape[1],
    )
    return np.vstack([legend, *lines])


def _draw_row(row: SheetRow) -> NDArray[np.uint8]:
    panels = [
        cv2.resize(row.image_bgr, _PANEL_PX, interpolation=cv2.INTER_AREA),
        _depth_panel(row.truth_m),
        _depth_panel(row.predicted_m),
    ]
    margin = np.full((_PANEL_PX[1], _GAP_PX, 3), _PAPER_BGR, np.uint8)
    picture = np.hstack([part for panel in panels for part in (np.asarray(panel, np.uint8), margin)])
    return np.vstack([_caption(row.caption, picture.shape[1]), picture])


def _depth_panel(depth_m: NDArray[np.float32]) -> NDArray[np.uint8]:
    colors = colorize_depth(depth_m, _NEAR_M, _FAR_M)
    return np.asarray(cv2.resize(colors, _PANEL_PX, interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)


def _caption(text: str, width: int) -> NDArray[np.uint8]:
    bar = np.full((_CAPTION_PX, width, 3), _PAPER_BGR, np.uint8)
    cv2.putText(bar, text, (6, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _INK_BGR, 1, cv2.LINE_AA)
    return bar
