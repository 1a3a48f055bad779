"""Metres for one picture: told to a network that takes hints, or found for one that does not."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from service.frame import Frame
from service.ground_hints import LARGEST_TURN_RAD, GroundHints, KnownGround
from service.live_hints import LiveHints
from service.measurement import DepthSource, Measurement, ScaleSource
from service.scale_status import ScaleStatus
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from service.vehicle_height import VehicleHeight
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.scale.estimator import ScaleEstimate, ScaleEstimator, apply

_COMPARED_EVERY_NS = 200_000_000

TelemetryAt = Callable[[int], Telemetry]


@dataclass(frozen=True)
class _Uncompared:
    """What a network that takes hints said, and what it was told, of one picture."""

    raw: DepthMap
    ground: GroundHint
    points: PointHints | None
    at_ns: int


class Metres:
    """Metric depth of one camera's pictures.

    Args:
        settings: the configuration.
        model: tells depth.
        scale: finds metres; None for a network that answers in metres when it is told the ground or points.
        takes: the hints that the network takes, "ground" and "points".
        max_depth_m: where the network's depth ends; its value there means "there or beyond".
    """

    def __init__(
        self,
        settings: Settings,
        model: DepthSource,
        scale: ScaleSource | None,
        takes: Collection[str],
        max_depth_m: float,
    ) -> None:
        camera, mount = settings.camera.model, settings.mount.mount
        self._camera = camera
        self._model = model
        self._found = scale
        self._takes = takes
        self._max_depth_m = max_depth_m
        self._reach_m = settings.scan.max_distance_m
        self._max_pixel_sigma = settings.model.max_relative_sigma
        self._max_sigma = settings.scale.max_relative_sigma
        self._max_age_s = settings.scale.max_age_s
        height = VehicleHeight(settings.scale.height_source, settings.scale.max_age_s)
        self._ground = GroundHints(mount, height)
        measures_points = scale is not None or "points" in takes
        self._points = LiveHints(camera, mount, settings.motion) if measures_points else None
        # Nothing is scaled by it: it tells whether ground and points contradict each other.
        self._second_opinion = None if scale is not None else ScaleEstimator(camera, mount, "metric")
        self._compared_ns: int | None = None
        self._uncompared: _Uncompared | None = None
        self._suspicion: str | None = None
        self._epoch: int | None = None
        self._measured_ns = 0

    def measure(self, frame: Frame, telemetry_at: TelemetryAt) -> Measurement:
        """Depth of one picture.

        Live, the messages from both sides of the capture have arrived when the network has run, so that
        attitude is interpolated then instead of carried forward. A network that takes hints is told the
        state as it is known before; where that proves to have been wrong, it is asked once more.

        Args:
            frame: the picture, of the calibrated size.
            telemetry_at: the vehicle at a capture time.
        """
        self.look_ahead()
        if self._found is None:
            return self._told_metres(frame, telemetry_at)
        return self._found_metres(frame, telemetry_at, self._found)

    def look_ahead(self) -> None:
        """What of one picture only the next ones need; `measure` begins with it where nobody called."""
        if self._points is not None:
            self._points.measure()
        self._compare()

    def without_hints(self, frame: Frame) -> DepthMap:
        """What the network says of a picture alone, in units of its own."""
        if self._found is None:
            return self._model.infer(frame.image_bgr, self._camera, Hints())
        return self._model.infer(frame.image_bgr, self._camera)

    # -- a network that takes hints

    def _told_metres(self, frame: Frame, telemetry_at: TelemetryAt) -> Measurement:
        self._mind_epoch(telemetry_at(frame.captured_ns))
        ground = self._ground.before(frame.captured_ns, telemetry_at)
        points = self._measured_points(frame, telemetry_at)
        raw = self._ask(frame, ground, points)
        telemetry = telemetry_at(frame.captured_ns)
        if telemetry.attitude is not None:
            known = self._ground.of(telemetry, telemetry.attitude)
            if _is_off(ground, known):
                ground = known
                raw = self._ask(frame, ground, points)
        measured = Measurement(telemetry, points=0 if points is None else len(points))
        trouble = self._trouble_of(raw, telemetry)
        if trouble is not None or telemetry.attitude is None:
            return replace(measured, trouble=trouble)
        by_ground = math.inf
        if isinstance(ground, KnownGround) and "ground" in self._takes:
            by_ground = ground.sigma(telemetry.attitude)
        by_points = math.inf
        if self._points is not None and points is not None and "points" in self._takes:
            by_points = self._points.scale_sigma
        sources = tuple(
            name for name, sigma in (("ground", by_ground), ("points", by_points)) if sigma <= self._max_sigma
        )
        if math.isinf(min(by_ground, by_points)):
            return replace(measured, trouble=ground if isinstance(ground, Trouble) else Trouble.NO_POINTS)
        age_s = ground.height.age_s if isinstance(ground, KnownGround) and "points" not in sources else 0.0
        if len(sources) > 1 and isinstance(ground, KnownGround):
            self._uncompared = _Uncompared(raw, ground.hint, points, frame.captured_ns)
        scale = ScaleStatus(1.0, min(by_ground, by_points), age_s, sources, self._suspected(self._suspicion))
        trouble = self._gate(scale, ground)
        if trouble is not None:
            return replace(measured, scale=scale, trouble=trouble)
        depth = self._doubted(raw, DepthMap(raw.depth_m, _joint_sigma(raw, scale.relative_sigma)))
        depth = self._without_far_end(depth, raw, scale)
        return replace(measured, depth=depth, scale=scale, height_m=_height_m(ground))

    def _ask(self, frame: Frame, ground: KnownGround | Trouble, points: PointHints | None) -> DepthMap:
        told = None
        if isinstance(ground, KnownGround) and ground.height.relative_sigma <= self._max_sigma:
            told = ground.hint
        return self._model.infer(frame.image_bgr, self._camera, Hints(told, points))

    def _compare(self) -> None:
        """See now and then whether the ground and the points agree on metres."""
        told, self._uncompared = self._uncompared, None
        if told is None or self._second_opinion is None:
            return
        if self._compared_ns is not None and 0 <= told.at_ns - self._compared_ns < _COMPARED_EVERY_NS:
            return
        self._compared_ns = told.at_ns
        estimate = self._second_opinion.update(told.raw, told.ground, told.points, told.at_ns)
        self._suspicion = None if estimate is None else estimate.suspicion

    # -- a network that does not

    def _found_metres(self, frame: Frame, telemetry_at: TelemetryAt, source: ScaleSource) -> Measurement:
        raw = self._model.infer(frame.image_bgr, self._camera)
        telemetry = telemetry_at(frame.captured_ns)
        self._mind_epoch(telemetry)
        points = self._measured_points(frame, telemetry_at)
        measured = Measurement(telemetry, points=0 if points is None else len(points))
        trouble = self._trouble_of(raw, telemetry)
        if trouble is not None:
            return replace(measured, trouble=trouble)
        ground = self._ground.of(telemetry, telemetry.attitude)
        seen = DepthMap(self._certain(raw), raw.relative_sigma, raw.affine_inverse_depth)
        hint = ground.hint if isinstance(ground, KnownGround) else None
        estimate = source.update(seen, hint, points, frame.captured_ns)
        if estimate is None:
            return replace(measured, trouble=ground if isinstance(ground, Trouble) else Trouble.NO_GROUND)
        sigma = estimate.relative_sigma
        if isinstance(ground, KnownGround) and "points" not in estimate.sources:
            sigma = math.hypot(sigma, ground.height.relative_sigma)
        age_s = self._age_s(estimate, ground, frame.captured_ns)
        suspicion = self._suspected(estimate.suspicion)
        scale = ScaleStatus(estimate.factor, sigma, age_s, tuple(estimate.sources), suspicion)
        trouble = self._gate(scale, ground)
        if trouble is not None:
            return replace(measured, scale=scale, trouble=trouble)
        depth = self._doubted(raw, apply(replace(estimate, relative_sigma=sigma), raw))
        return replace(
            measured, depth=self._without_far_end(depth, raw, scale), scale=scale, height_m=_height_m(ground)
        )

    def _age_s(self, estimate: ScaleEstimate, ground: KnownGround | Trouble, captured_ns: int) -> float:
        """Time since something was measured: ground below a height that is held is no new measurement."""
        if not self._measured_ns <= captured_ns:
            self._measured_ns = 0
        if estimate.age_s == 0.0:
            held_s = 0.0
            if isinstance(ground, KnownGround) and "points" not in estimate.sources:
                held_s = ground.height.age_s
            self._measured_ns = max(self._measured_ns, captured_ns - round(held_s * 1e9))
        return (captured_ns - self._measured_ns) * 1e-9

    def _without_far_end(self, metres: DepthMap, raw: DepthMap, scale: ScaleStatus) -> DepthMap:
        """Depth in which the network's far end is unknown if it would read as an obstacle.

        The network stops at its largest depth, so sky has that value; scaled below the scan's reach it
        would stand there as a wall. Beyond the reach it reads clear, which is what the network says.
        """
        if raw.affine_inverse_depth is not None or self._max_depth_m * scale.factor > self._reach_m:
            return metres
        depth_m = np.where(raw.depth_m >= self._max_depth_m, np.float32(np.nan), metres.depth_m)
        return DepthMap(depth_m, metres.relative_sigma)

    # -- both

    def _suspected(self, by_metres: str | None) -> str | None:
        """What seems to be configured wrong; turns name the cause where metres only contradict each other."""
        by_turns = None if self._points is None else self._points.suspicion
        return by_turns or by_metres

    def _measured_points(self, frame: Frame, telemetry_at: TelemetryAt) -> PointHints | None:
        return None if self._points is None else self._points.update(frame, telemetry_at)

    def _mind_epoch(self, telemetry: Telemetry) -> None:
        """Forget what an autopilot said that has started anew since; positions begin elsewhere then."""
        if self._epoch is not None and telemetry.epoch != self._epoch:
            self._ground.clear()
        self._epoch = telemetry.epoch

    def _gate(self, scale: ScaleStatus, ground: KnownGround | Trouble) -> Trouble | None:
        """Why a scale is not good enough, by its cause where one is known; None if it is."""
        # NaN is not certainty: the comparisons are written so that it fails.
        if not scale.age_s <= self._max_age_s:
            return ground if isinstance(ground, Trouble) else Trouble.OLD_SCALE
        if scale.relative_sigma <= self._max_sigma:
            return None
        by_ekf = isinstance(ground, KnownGround) and not ground.height.by_rangefinder
        return Trouble.NO_HEIGHT if by_ekf else Trouble.BAD_SCALE

    def _trouble_of(self, raw: DepthMap, telemetry: Telemetry) -> Trouble | None:
        values = self._certain(raw) if raw.affine_inverse_depth is None else raw.affine_inverse_depth
        if not np.isfinite(values).any():
            return Trouble.NO_DEPTH
        attitude = telemetry.attitude
        if attitude is None or not math.isfinite(attitude.roll_rad + attitude.pitch_rad):
            return Trouble.NO_ATTITUDE
        return None

    def _doubted(self, raw: DepthMap, metres: DepthMap) -> DepthMap:
        """Metres in which what the network itself is not sure of is beyond any doubt that frees a way."""
        if raw.relative_sigma is None or metres.relative_sigma is None:
            return metres
        sure = raw.relative_sigma <= self._max_pixel_sigma
        return replace(metres, relative_sigma=np.where(sure, metres.relative_sigma, np.float32(np.inf)))

    def _certain(self, depth: DepthMap) -> NDArray[np.float32]:
        """Depth with the pixels that the network is not sure of taken out: metres are not found by those, and
        where there is nothing else perception is blind. Among others a near one may be an obstacle.
        """
        if depth.relative_sigma is None:
            return depth.depth_m
        sure = depth.relative_sigma <= self._max_pixel_sigma
        return np.where(sure, depth.depth_m, np.float32(np.nan))


def _is_off(told: KnownGround | Trouble, known: KnownGround | Trouble) -> bool:
    """Whether the network was told something else than what is known now."""
    if not isinstance(known, KnownGround):
        return False
    if not isinstance(told, KnownGround):
        return told is Trouble.NO_ATTITUDE
    return told.turn_rad(known.hint.attitude) > LARGEST_TURN_RAD


def _joint_sigma(raw: DepthMap, scale_sigma: float) -> NDArray[np.float32]:
    """What the network doubts by the pixel and what its hints leave uncertain of the whole picture."""
    if raw.relative_sigma is None:
        return np.full(raw.depth_m.shape, scale_sigma, np.float32)
    # numpy's hypot takes ten times as long, to be right where squares overflow.
    with np.errstate(over="ignore"):
        squared = np.square(raw.relative_sigma)
    squared += np.float32(scale_sigma**2)
    return np.sqrt(squared, out=squared)


def _height_m(ground: KnownGround | Trouble) -> float | None:
    """The height that the scan may remove the ground with: the rangefinder's alone is sure enough."""
    if isinstance(ground, KnownGround) and ground.height.by_rangefinder:
        return ground.height.height_m
    return None
