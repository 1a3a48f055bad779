"""How much of the height band around the flight level the camera really sees, direction by direction."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, SECTOR_WIDTH_DEG, sector_bearings_deg

SLICES = 6
"""Directions probed in each element, its two edges among them: 1 degree apart."""

HEIGHTS = 9
"""Heights probed in each direction, from the band's top to its bottom."""


@dataclass(frozen=True)
class BandProbe:
    """Pixels that look at the band's far end.

    Args:
        pixel: (n,) index of the pixel in the flattened picture.
        cell: (n,) which of the 72 * SLICES * HEIGHTS probes each pixel answers, in that order.
    """

    pixel: NDArray[np.intp]
    cell: NDArray[np.intp]


class BandView:
    """Finds the pixels that look at the far end of the height band, where it is seen smallest.

    A ray from the camera to the band at maximum distance stays inside the band all the way, so a ray
    that is free to there has nothing in the band on it.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        max_distance_m: horizontal distance of the band's far end.
        below_m, above_m: the band, from the vehicle's origin.
    """

    def __init__(
        self,
        camera: CameraModel,
        mount: CameraMount,
        max_distance_m: float,
        below_m: float,
        above_m: float,
    ) -> None:
        self._camera = camera
        self._mount = mount
        half = SECTOR_WIDTH_DEG / 2
        offsets = np.linspace(-half, half, SLICES)
        bearings = np.radians(sector_bearings_deg().astype(np.float64)[:, None] + offsets)
        targets = np.empty((3, SECTOR_COUNT, SLICES, HEIGHTS), dtype=np.float32)
        targets[0] = max_distance_m * np.cos(bearings)[..., None]
        targets[1] = max_distance_m * np.sin(bearings)[..., None]
        targets[2] = np.linspace(-above_m, below_m, HEIGHTS)
        self._targets_level = targets.reshape(3, -1)

    def probe(self, level_from_body: NDArray[np.float64]) -> BandProbe:
        """The pixels for an attitude's `level_from_body`; directions outside the picture have none."""
        camera_from_body = self._mount.body_from_camera.T
        camera_from_level = (camera_from_body @ level_from_body.T).astype(np.float32)
        points = camera_from_level @ self._targets_level
        points -= (camera_from_body @ self._mount.position_body_m).astype(np.float32)[:, None]
        # Less than 3 degrees from the image plane no pinhole camera has a pixel.
        cell = np.flatnonzero(points[2] > 0.05 * np.hypot(points[0], points[1]))
        points = points[:, cell]
        flat = points[:2] / points[2]
        u, v = self._pixels(flat)
        inside = (u >= 0) & (u < self._camera.width) & (v >= 0) & (v < self._camera.height)
        cell, flat, u, v = cell[inside], flat[:, inside], u[inside], v[inside]
        if any(self._camera.distortion):
            # Far outside the picture a distortion polynomial folds back into it: believe a pixel
            # only if its own ray looks there.
            ray = self._camera.normalized_rays[v, u, :2].T
            span = 1.5 * np.array([[1 / self._camera.fx], [1 / self._camera.fy]])
            looks_there = (np.abs(ray - flat) <= span * (1 + np.abs(flat))).all(axis=0)
            cell, u, v = cell[looks_there], u[looks_there], v[looks_there]
        return BandProbe(v * self._camera.width + u, cell)

    def _pixels(self, flat: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Column and row of (2, N) directions with z = 1; outside the picture anything outside it."""
        camera = self._camera
        if any(camera.distortion) and flat.size:
            rays = np.concatenate([flat, np.ones((1, flat.shape[1]))]).T
            zero = np.zeros(3)
            pixels, _ = cv2.projectPoints(
                np.ascontiguousarray(rays), zero, zero, camera.matrix, np.array(camera.distortion)
            )
            u, v = np.nan_to_num(pixels.reshape(-1, 2).T, nan=-1.0)
        else:
            u, v = flat[0] * camera.fx + camera.cx, flat[1] * camera.fy + camera.cy
        u = np.clip(np.floor(u + 0.5), -1, camera.width).astype(np.intp)
        v = np.clip(np.floor(v + 0.5), -1, camera.height).astype(np.intp)
        return u, v


def seen_sectors(free: NDArray[np.bool_], cell: NDArray[np.intp], share: float) -> NDArray[np.bool_]:
    """(72,) bool: elements of which every slice is seen and free over at least `share` of its heights.

    Args:
        free: (n,) whether each probed pixel is known to be free up to the maximum distance.
        cell: (n,) `BandProbe.cell`.
        share: 0 to 1.
    """
    seen = np.zeros(SECTOR_COUNT * SLICES * HEIGHTS, dtype=bool)
    seen[cell] = free
    of_slice = seen.reshape(SECTOR_COUNT, SLICES, HEIGHTS).mean(axis=2)
    return np.asarray((of_slice >= share).all(axis=1))
