"""Attitude as recordings give it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def rotation_from_quaternion(w: float, x: float, y: float, z: float) -> NDArray[np.float64]:
    """(3, 3) rotation of a quaternion of any length above 0."""
    q = np.array([w, x, y, z], np.float64)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
