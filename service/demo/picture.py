"""The demo's picture: what the camera saw, what the network made of it, and the scan, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from service.demo.radar import BACKGROUND_BGR, TEXT_BGR, draw_radar
from uavdepth.depth.colors import colorize_depth
from uavdepth.scan.obstacle_scan import ObstacleScan

PANEL_WIDTH_PX, PANEL_HEIGHT_PX = 576, 360
"""The shape of the demo's camera; pictures that fit a thin link keep it by a pixel or so only."""

_CAPTION_PX = 44
_GAP_PX = 8


def draw_side_by_side(
    image_bgr: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    scan: ObstacleScan | None,
    near_m: float,
    far_m: float,
    caption: str = "camera",
) -> NDArray[np.uint8]:
    """Camera, depth and sector radar in one row, each under its caption.

    Args:
        image_bgr: (H, W, 3) uint8 camera picture.
        depth_m: (H, W) float32 z-depth in metres, NaN where unknown.
        scan: the scan made of it, or None.
        near_m, far_m: ends of the depth colours in metres; lighter = nearer.
        caption: over the camera picture.

    Returns:
        (h, w, 3) uint8 BGR.
    """
    panels = [
        _panel(image_bgr, caption),
        _panel(
            colorize_depth(depth_m, near_m, far_m), f"depth, lighter = nearer ({near_m:g} to {far_m:g} m)"
        ),
        _panel(draw_radar(scan, PANEL_HEIGHT_PX), "scan, nose up", PANEL_HEIGHT_PX),
    ]
    return _join(panels)


def _panel(picture: NDArray[np.uint8], caption: str, width_px: int = PANEL_WIDTH_PX) -> NDArray[np.uint8]:
    shown = cv2.resize(picture, (width_px, PANEL_HEIGHT_PX), interpolation=cv2.INTER_LINEAR)
    bar = np.full((_CAPTION_PX, width_px, 3), BACKGROUND_BGR, np.uint8)
    cv2.putText(bar, caption, (8, 29), cv2.FONT_HERSHEY_SIMPLEX, 0.6, TEXT_BGR, 1, cv2.LINE_AA)
    return np.vstack([bar, np.asarray(shown, np.uint8)])


def _join(panels: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    gap = np.full((panels[0].shape[0], _GAP_PX, 3), BACKGROUND_BGR, np.uint8)
    row = [panels[0]]
    for panel in panels[1:]:
        row += [gap, panel]
    return np.hstack(row)
