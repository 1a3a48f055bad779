"""Depth pictures of smaller sides, in which nothing near gets lost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from service.publisher.wire import Intrinsics


def shrunk_codes(codes: NDArray[np.uint8], divisor: int) -> NDArray[np.uint8]:
    """The nearest valid depth of each block of `divisor` x `divisor` pixels; invalid where all are.

    Args:
        codes: (H, W) uint8 logarithmic codes; rows and columns beyond a whole block are left out.
        divisor: 1 or more.
    """
    if divisor == 1:
        return codes
    height, width = max(codes.shape[0] // divisor, 1), max(codes.shape[1] // divisor, 1)
    # One less, so that the invalid code 0 wraps to the largest and the minimum is the nearest valid one.
    turned = codes[: height * divisor, : width * divisor] - np.uint8(1)
    rows = turned.reshape(height, -1, turned.shape[1]).min(axis=1)
    nearest = rows.reshape(height, width, -1).min(axis=2)
    return np.asarray(nearest + np.uint8(1), np.uint8)


def shrunk_camera(camera: Intrinsics, divisor: int) -> Intrinsics:
    """The camera whose pixels are the blocks of `shrunk_codes`; pixel centres at whole numbers."""
    if divisor == 1:
        return camera
    return camera.model_copy(
        update={
            "width": max(camera.width // divisor, 1),
            "height": max(camera.height // divisor, 1),
            "fx": camera.fx / divisor,
            "fy": camera.fy / divisor,
            "cx": (camera.cx + 0.5) / divisor - 0.5,
            "cy": (camera.cy + 0.5) / divisor - 0.5,
        }
    )
