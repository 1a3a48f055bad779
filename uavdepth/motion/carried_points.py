"""Points that were measured once, moved along with the vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import PointHints
from uavdepth.motion.resection import Resection
from uavdepth.motion.vehicle_motion import VehicleMotion

MOST_POINTS = 300

_GROWTH_PER_S = 0.15
"""Relative sigma that a followed point gains in a second without a measurement."""

_LOST_GROWTH_PER_S = 0.4
"""The same for one that is not followed any more: what is at its pixel now may be another thing."""

_SEEN_GROWTH_PER_S = 0.005
"""What one gains that is seen where it should be, added up: corners creep along edges. After a minute of
hover nothing is sure enough any more."""

_SEEN_SIGMA_PX = 1.0
_SEEN_SIGMA_RAD = 0.01
"""How far off a followed corner is seen though all is well: by tracking, and by attitude and its time."""

_ASTRAY_SIGMAS = 4.0
"""A track that is farther from where its point should be has jumped to something else."""

_PROVEN = 4
"""Measurements after which a point that is lost is carried on. Most of those that are lost sooner were no
points at all but places where one edge passes behind another."""


class CarriedPoints:
    """Points in the camera axes of the newest picture, with when and how well they were measured.

    Args:
        camera: that sees them.
        carry_s: how long a point lasts after it was measured, or seen where it should be, seconds.
    """

    def __init__(self, camera: CameraModel, carry_s: float) -> None:
        self._camera = camera
        self._carry_ns = round(carry_s * 1e9)
        self.clear()

    def clear(self) -> None:
        """Forget all points."""
        self._at_ns = 0
        self._ids = np.empty(0, dtype=np.int64)
        self._points = np.empty((0, 3))
        self._sigma = np.empty(0)
        self._offset_sigma = np.empty(0)
        self._travel_m = np.empty(0)
        self._measured_ns = np.empty(0, dtype=np.int64)
        self._times = np.empty(0, dtype=np.int64)

    def move(self, now_ns: int, motion: VehicleMotion, mount: CameraMount) -> None:
        """Move all points into the camera's axes at `now_ns`; where the motion is not known they are lost."""
        if len(self._ids):
            moved = motion.between(self._at_ns, now_ns, mount)
            if moved is None:
                self.clear()
            else:
                self._points = (self._points + moved.offset_m) @ moved.rotation.T
                # Errors of the velocity last, so those of the steps add up rather than average.
                self._offset_sigma = self._offset_sigma + moved.sigma_m
                self._travel_m = self._travel_m + moved.baseline_m
                self._keep(now_ns - self._measured_ns <= self._carry_ns)
        self._at_ns = now_ns

    def put(
        self,
        ids: NDArray[np.int64],
        points: NDArray[np.float64],
        relative_sigma: NDArray[np.float64],
        now_ns: int,
    ) -> None:
        """Take measurements of the newest picture where they are better than what is carried.

        Args:
            ids: (N,) of their tracks.
            points: (N, 3) in camera axes.
            relative_sigma: (N,) of depth.
            now_ns: time of the picture.
        """
        _, ours, theirs = np.intersect1d(self._ids, ids, assume_unique=True, return_indices=True)
        times = np.ones(len(ids), dtype=np.int64)
        times[theirs] += self._times[ours]
        self._times[ours] += 1
        carried = self._grown(now_ns, np.ones(len(self._ids), dtype=bool))[ours]
        worse = relative_sigma[theirs] > carried
        new = np.ones(len(ids), dtype=bool)
        new[theirs[worse]] = False
        kept = np.ones(len(self._ids), dtype=bool)
        kept[ours[~worse]] = False
        self._keep(kept)
        self._ids = np.concatenate([self._ids, ids[new]])
        self._points = np.concatenate([self._points, points[new]])
        self._sigma = np.concatenate([self._sigma, relative_sigma[new]])
        self._offset_sigma = np.concatenate([self._offset_sigma, np.zeros(np.count_nonzero(new))])
        self._travel_m = np.concatenate([self._travel_m, np.zeros(np.count_nonzero(new))])
        self._measured_ns = np.concatenate([self._measured_ns, np.full(np.count_nonzero(new), now_ns)])
        self._times = np.concatenate([self._times, times[new]])

    def drop(self, ids: NDArray[np.int64]) -> None:
        """Forget the points of these tracks."""
        self._keep(~np.isin(self._ids, ids))

    def followed(
        self, live_ids: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.intp], NDArray[np.float64], float]:
        """The points whose tracks live.

        Returns:
            (N,) their tracks' numbers, (N,) where those stand among `live_ids`, (N, 3) the points in the
            camera's axes, and the median standard deviation in metres of how far the vehicle went since they
            were measured; 0 without points.
        """
        ids, ours, theirs = np.intersect1d(self._ids, live_ids, assume_unique=True, return_indices=True)
        drift_m = float(np.median(self._offset_sigma[ours])) if len(ids) else 0.0
        return ids, theirs, self._points[ours], drift_m

    def confirm(self, ids: NDArray[np.int64], found: Resection, now_ns: int) -> None:
        """Move all points as they are seen to have moved; those of `ids` were seen where they should be."""
        self._points = self._points @ found.rotation.T + found.offset_m
        seen = np.isin(self._ids, ids)
        growth = _SEEN_GROWTH_PER_S * (now_ns - self._measured_ns) * 1e-9
        self._sigma = self._sigma + np.where(seen, growth, 0.0)
        self._offset_sigma = np.where(seen, found.offset_sigma_m, self._offset_sigma)
        self._travel_m = np.where(seen, 0.0, self._travel_m)
        self._measured_ns = np.where(seen, now_ns, self._measured_ns)

    def hints(
        self,
        live_ids: NDArray[np.int64],
        live_pixels: NDArray[np.float64],
        now_ns: int,
        largest_sigma: float,
    ) -> PointHints:
        """The points in the picture: at their track's pixel where it is followed, else where they should be.

        A track that went astray tells nothing: after a gap between pictures it may follow the next dash of a
        lane, and the point that it had is nearer than what is seen there. Its next measurement decides.

        Args:
            live_ids, live_pixels: (N,) and (N, 2) of the live tracks, camera pixels.
            now_ns: time of the picture, to which the points were moved.
            largest_sigma: less certain ones are left out.
        """
        pixels = self._camera.projected(self._points)
        _, ours, theirs = np.intersect1d(self._ids, live_ids, assume_unique=True, return_indices=True)
        followed = np.zeros(len(self._ids), dtype=bool)
        followed[ours] = True
        sigma = self._grown(now_ns, followed)
        off_px = np.linalg.norm(live_pixels[theirs] - pixels[ours], axis=1)
        strayed = np.zeros(len(self._ids), dtype=bool)
        strayed[ours] = ~(off_px <= _ASTRAY_SIGMAS * self._seen_sigma_px(sigma)[ours])
        pixels[ours] = live_pixels[theirs]
        size = np.array([self._camera.width, self._camera.height])
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels >= -0.5) & (pixels < size - 0.5), axis=1)
        inside &= (self._points[:, 2] > 0.3) & (followed | (self._times >= _PROVEN))
        self._keep(inside)
        pixels, sigma, strayed = pixels[inside], sigma[inside], strayed[inside]
        sigma = np.where(strayed, np.inf, sigma)
        order = np.argsort(sigma, kind="stable")[:MOST_POINTS]
        order = order[sigma[order] <= largest_sigma]
        chosen = pixels[order], self._points[order, 2], sigma[order]
        return PointHints(*(values.astype(np.float32) for values in chosen))

    def _grown(self, now_ns: int, followed: NDArray[np.bool_]) -> NDArray[np.float64]:
        age_s = (now_ns - self._measured_ns) * 1e-9
        growth = np.where(followed, _GROWTH_PER_S, _LOST_GROWTH_PER_S) * age_s
        by_offset = self._offset_sigma / np.maximum(self._points[:, 2], 0.3)
        return np.asarray(np.sqrt(self._sigma**2 + growth**2 + by_offset**2))

    def _seen_sigma_px(self, relative_sigma: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviation of where each point's corner is seen, pixels of the camera.

        An error of depth shows by as much as the vehicle went since.
        """
        px_per_m = self._camera.fx / np.maximum(self._points[:, 2], 0.3)
        moved = np.hypot(self._offset_sigma, relative_sigma * self._travel_m) * px_per_m
        still = np.hypot(_SEEN_SIGMA_PX, _SEEN_SIGMA_RAD * self._camera.fx)
        return np.asarray(np.hypot(moved, still))

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        for name in ("_ids", "_points", "_sigma", "_offset_sigma", "_travel_m", "_measured_ns", "_times"):
            setattr(self, name, getattr(self, name)[kept])
