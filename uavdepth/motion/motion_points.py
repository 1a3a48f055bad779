"""Points of known depth from the vehicle's own motion: the live hints of a depth network."""

from __future__ import annotations

import math
from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import ImageSizeError
from uavdepth.model.hints import PointHints
from uavdepth.motion.carried_points import MOST_POINTS, CarriedPoints
from uavdepth.motion.feature_tracks import MOST_FRAMES, FeatureTracks
from uavdepth.motion.motion_point_settings import MotionPointSettings
from uavdepth.motion.near_edges import NearEdges
from uavdepth.motion.resection import resect
from uavdepth.motion.triangulation import triangulate
from uavdepth.motion.turn_check import TurnCheck
from uavdepth.motion.vehicle_motion import CameraMotion, VehicleMotion

_TRACKING_WIDTH = 640
"""Wider pictures are made smaller: the time that more pixels take is not worth what they tell. Half of it
doubles the errors of depth."""

_LONGEST_GAP_NS = 500_000_000
"""After a longer gap between two pictures the tracks begin anew."""

_BASELINE_SIGMAS = 3.0
"""In hover the baseline does not stand out of its own noise, and there is no depth."""

_SLOW_SIGMAS = 6.0
"""A baseline up to so many measures only what is near; the rest is looked for where it was."""

_LEAST_DRIFT_M = 0.02
"""However short the time, so far the camera may have moved otherwise than was said."""

_SEEN_SIGMA_PX = 0.5
"""Where a corner is seen, long after it was found; of a picture at most 640 wide."""

_LEAST_TRACKS_OF_TURN = 30
"""Fewer do not tell how far a picture turned."""

_MEASURED_EVERY_NS = 90_000_000
"""Of pictures that follow each other faster not every one is measured: the same corners from hardly another
place say hardly anything new."""

_MOST_VIEWS = 4
"""Besides the newest; more of them, spread over the same time, add work but hardly any certainty."""


class MotionPoints:
    """Follows corners from picture to picture and measures their depth by the way the vehicle went.

    What takes the most time, to measure and to seek new corners, can wait until a picture's distances have
    been sent: its points are those measured up to the picture before it, carried along with the vehicle to
    where their corners are seen now.

    Nothing comes of a hover but points that were measured before: they last while they are followed and
    most of them are seen where the vehicle's motion puts them. Of flight along the optical axis comes
    nothing near the point it heads for. Objects that move are told by residuals across their epipolar
    lines; one that moves along them (a car ahead on one's own course) is not told from a thing that
    stands at another depth. Near edges that are no corners are measured besides (`NearEdges`); what moves
    by itself is not told from what stands there.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        settings: what a point must be to be believed.
    """

    def __init__(
        self, camera: CameraModel, mount: CameraMount, settings: MotionPointSettings | None = None
    ) -> None:
        self.camera = camera
        self.mount = mount
        self.settings = settings or MotionPointSettings()
        shrink = max(1.0, camera.width / _TRACKING_WIDTH)
        self._size = max(1, round(camera.width / shrink)), max(1, round(camera.height / shrink))
        self._scale = np.array([camera.width / self._size[0], camera.height / self._size[1]])
        self._tracks = FeatureTracks()
        self._times: deque[int] = deque(maxlen=MOST_FRAMES)
        self._carried = CarriedPoints(camera, self.settings.carry_s)
        self._edges = NearEdges(camera, mount)
        self._turns = TurnCheck()
        self._last = _no_points()
        self._last_corners = 0
        self._is_behind = False
        self._unmeasured: VehicleMotion | None = None
        self._measured_ns: int | None = None

    @property
    def suspicion(self) -> str | None:
        """What turns in flight show to be wrong with the focal length, in words, or None."""
        return self._turns.suspicion

    @property
    def corners(self) -> PointHints:
        """The last points but those of edges: what they leave uncertain is the scale of the picture."""
        count, last = self._last_corners, self._last
        return PointHints(last.pixels[:count], last.depth_m[:count], last.relative_sigma[:count])

    def clear(self) -> None:
        """Forget all tracks and points."""
        self._tracks.clear()
        self._times.clear()
        self._carried.clear()
        self._edges.clear()
        self._last, self._last_corners = _no_points(), 0
        self._is_behind, self._unmeasured, self._measured_ns = False, None, None

    def update(self, image_bgr: NDArray[np.uint8], captured_ns: int, motion: VehicleMotion) -> PointHints:
        """Points of one picture.

        Args:
            image_bgr: (H, W, 3) uint8, the camera's size.
            captured_ns: when it was taken, on the clock of `motion`. A step back in time begins anew; the
                same time again gives the same points.
            motion: what the autopilot said of the vehicle's motion, up to about that time.

        Returns:
            Up to 300 points. None at all where the motion at that time is not known.

        Raises:
            ImageSizeError: a picture that is not (H, W, 3) uint8 of the camera.
        """
        shape = (self.camera.height, self.camera.width, 3)
        if image_bgr.shape != shape or image_bgr.dtype != np.uint8:
            raise ImageSizeError(
                f"the picture is {image_bgr.shape} {image_bgr.dtype}, the camera's is {shape} uint8"
            )
        if self._times and captured_ns == self._times[-1]:
            return self._last
        self.measure()
        if self._times:
            gap_ns = captured_ns - self._times[-1]
            if gap_ns < 0:
                self.clear()
            elif gap_ns > _LONGEST_GAP_NS:
                self._tracks.clear()
                self._times.clear()
        self._follow(image_bgr, captured_ns, motion)
        self._is_behind = True
        self._last = self._points(captured_ns, motion)
        return self._last

    def measure(self) -> None:
        """What only later pictures need: the depth of the newest picture's points, and new corners.

        The next `update` begins with it where it was not called. Depth is measured 11 times a second at most.
        """
        if not self._is_behind:
            return
        self._is_behind = False
        motion, self._unmeasured = self._unmeasured, None
        captured_ns = self._times[-1]
        is_due = self._measured_ns is None or captured_ns - self._measured_ns >= _MEASURED_EVERY_NS
        if motion is not None and is_due and len(self._tracks.ids):
            views = self._views(captured_ns, motion)
            # How far the baselines stand out of their noise, together the largest.
            stands_out = max((moved.baseline_m / moved.sigma_m for _, moved in views), default=math.inf)
            if views:
                self._measured_ns = captured_ns
            if views and stands_out > _BASELINE_SIGMAS:
                self._measure(captured_ns, motion, views)
                if self.settings.edges:
                    self._measure_edges(motion)
            if stands_out <= _SLOW_SIGMAS:
                self._confirm(captured_ns, motion)
        self._tracks.renew()

    def _follow(self, image_bgr: NDArray[np.uint8], captured_ns: int, motion: VehicleMotion) -> None:
        small = cv2.resize(image_bgr, self._size, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        expected = None
        if self._times and len(self._tracks.ids):
            turn = motion.between(self._times[-1], captured_ns, self.mount)
            if turn is not None:
                rays = self._rays(self._tracks.positions[-1])
                points = np.concatenate([rays, np.ones((len(rays), 1))], axis=1) @ turn.rotation.T
                expected = self._small(self.camera.projected(points))
        self._tracks.update(grey, expected)
        self._edges.see(grey, captured_ns)
        self._times.append(captured_ns)

    def _points(self, captured_ns: int, motion: VehicleMotion) -> PointHints:
        self._last_corners = 0
        if not motion.knows(captured_ns):
            return _no_points()
        self._unmeasured = motion
        ids, pixels = self._tracks.ids, self._pixels(self._tracks.positions[-1])
        self._carried.move(captured_ns, motion, self.mount)
        self._edges.move(captured_ns, motion)
        largest_sigma = self.settings.largest_carried_sigma
        corners = self._carried.hints(ids, pixels, captured_ns, largest_sigma)
        self._last_corners = len(corners)
        return _together(corners, self._edges.hints(largest_sigma, MOST_POINTS - len(corners)))

    def _views(self, captured_ns: int, motion: VehicleMotion) -> list[tuple[int, CameraMotion]]:
        """Rows of earlier pictures to measure with, each twice as old as the next, and the motion to them."""
        oldest_ns = captured_ns - round(self.settings.longest_window_s * 1e9)
        rows = [row for row, at_ns in enumerate(self._times) if oldest_ns <= at_ns < captured_ns]
        first = len(self._times) - len(self._tracks.positions)
        if not rows or first != 0:
            return []
        wanted = np.unique(np.rint(np.geomspace(1, len(rows), _MOST_VIEWS)).astype(int))
        chosen = []
        for back in wanted:
            row = rows[-back]
            moved = motion.between(captured_ns, self._times[row], self.mount)
            if moved is not None:
                chosen.append((row, moved))
        return chosen

    def _measure(
        self, captured_ns: int, motion: VehicleMotion, views: list[tuple[int, CameraMotion]]
    ) -> None:
        settings, positions = self.settings, self._tracks.positions
        rows = [row for row, _ in views]
        several = np.flatnonzero((~np.isnan(positions[rows][..., 0])).sum(axis=0) >= settings.least_views)
        if not len(several):
            return
        rays = self._rays(positions[-1][several])
        seen = self._rays(positions[rows][:, several].reshape(-1, 2)).reshape(len(rows), -1, 2)
        # One pixel of the small picture, as an angle.
        pixel = float(self._scale[0]) / self.camera.fx
        steps = len(positions) - 1 - np.array(rows)
        sigma = pixel * np.sqrt(settings.pixel_sigma**2 + settings.drift_sigma**2 * steps / 10)
        found = triangulate(
            rays, seen, [moved for _, moved in views], sigma, motion.noise, pixel * settings.pixel_sigma
        )
        if len(several) >= _LEAST_TRACKS_OF_TURN:
            oldest = int(np.argmin(rows))
            self._turns.add(views[oldest][1].rotation, found.rotations[oldest])
        relative = np.hypot(found.relative_sigma, settings.model_sigma)
        good = relative <= settings.largest_sigma
        good &= found.residual <= settings.largest_residual
        good &= found.parallax_rad >= settings.least_parallax_rad
        good &= (found.depth_m >= settings.nearest_m) & (found.depth_m <= settings.farthest_m)
        rays = np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
        points = rays[good] * found.depth_m[good, None]
        self._carried.put(self._tracks.ids[several[good]], points, relative[good], captured_ns)
        # A track that does not fit a still world is not one of its points, whatever it was before.
        self._carried.drop(self._tracks.ids[several[found.residual > settings.largest_residual]])

    def _measure_edges(self, motion: VehicleMotion) -> None:
        _, tracks, points, _ = self._carried.followed(self._tracks.ids)
        positions = self._tracks.positions

        def seen_at(at_ns: int) -> NDArray[np.float64] | None:
            if len(positions) != len(self._times) or at_ns not in self._times:
                return None
            return self._rays(positions[self._times.index(at_ns)][tracks])

        if self._last_corners:
            sigma = float(np.median(self.corners.relative_sigma))
            self._edges.measure(motion, points, sigma, seen_at)

    def _confirm(self, captured_ns: int, motion: VehicleMotion) -> None:
        """See whether points that were measured earlier are where they were."""
        ids, tracks, points, drift_m = self._carried.followed(self._tracks.ids)
        pixel = float(self._scale[0]) / self.camera.fx
        found = resect(
            points,
            self._rays(self._tracks.positions[-1][tracks]),
            _SEEN_SIGMA_PX * pixel,
            math.hypot(drift_m, _LEAST_DRIFT_M),
            motion.noise.attitude_rad,
        )
        if found is not None:
            self._carried.confirm(ids[found.agrees], found, captured_ns)
            self._carried.drop(ids[~found.agrees])

    def _pixels(self, small: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.asarray((small.astype(np.float64) + 0.5) * self._scale - 0.5)

    def _small(self, pixels: NDArray[np.float64]) -> NDArray[np.float32]:
        return np.asarray((pixels + 0.5) / self._scale - 0.5, dtype=np.float32)

    def _rays(self, small: NDArray[np.float32]) -> NDArray[np.float64]:
        return self.camera.straightened(self._pixels(small))


def _together(corners: PointHints, edges: PointHints) -> PointHints:
    return PointHints(
        np.concatenate([corners.pixels, edges.pixels]),
        np.concatenate([corners.depth_m, edges.depth_m]),
        np.concatenate([corners.relative_sigma, edges.relative_sigma]),
    )


def _no_points() -> PointHints:
    nothing = np.empty(0, dtype=np.float32)
    return PointHints(nothing.reshape(0, 2), nothing, nothing)
