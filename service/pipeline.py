"""From one picture to one scan: the same steps live and in replay, without threads or clocks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import structlog
from numpy.typing import NDArray

from service.errors import ConfigError
from service.frame import Frame
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.errors import ModelCardError, ModelFileError, UavDepthError
from uavdepth.ground_scale import GroundScale
from uavdepth.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg
from uavdepth.scale_tracker import ScaleTracker

log = structlog.get_logger()

METRIC_FACTORS = (0.4, 2.5)
"""Ground that asks a network which is metric by itself for a larger correction is not the ground below:
a valley floor or a roof (over a valley factors near 0.25 came out, each with a small sigma)."""


class DepthSource(Protocol):
    """What tells depth from a picture, up to one factor."""

    def infer(self, image_bgr: NDArray[np.uint8], camera: CameraModel) -> DepthMap:
        """Depth at the camera's pixels."""


class ScaleSource(Protocol):
    """What tells the factor to metres from the ground."""

    def estimate(
        self, depth_m: NDArray[np.float32], attitude: Attitude, height_m: float
    ) -> GroundScale | None:
        """The factor, or None where not enough ground is seen."""


class Scanner(Protocol):
    """What makes a scan of metric depth."""

    def scan(
        self, depth_m: NDArray[np.float32], attitude: Attitude, height_m: float | None = None
    ) -> ObstacleScan:
        """The scan."""


@dataclass(frozen=True)
class ScaleStatus:
    """The metric scale that a picture was measured with.

    Args:
        factor: network units to metres.
        relative_sigma: its relative standard deviation.
        age_s: time since the ground was seen, seconds; 0 if on this picture.
    """

    factor: float
    relative_sigma: float
    age_s: float


@dataclass(frozen=True)
class PerceptionResult:
    """What became of one picture.

    Args:
        frame: the picture.
        telemetry: the vehicle at its capture time.
        depth: metric depth at the camera's pixels; None where it has no scale.
        scale: the metric scale used; None if there was none.
        scan: the obstacles; every element UNKNOWN while `trouble` is set.
        trouble: why the scan is not to be trusted; None if it is.
        detail: more words on the trouble, for the log.
    """

    frame: Frame
    telemetry: Telemetry
    depth: DepthMap | None
    scale: ScaleStatus | None
    scan: ObstacleScan
    trouble: Trouble | None = None
    detail: str = ""

    @property
    def captured_ns(self) -> int:
        """Capture time of the picture on the service's clock."""
        return self.frame.captured_ns

    @property
    def trusted(self) -> bool:
        """Whether the autopilot may be told of it."""
        return self.trouble is None

    def distrusted(self, trouble: Trouble) -> PerceptionResult:
        """The same picture with its scan taken back."""
        unknown = unknown_scan(self.scan.min_distance_m, self.scan.max_distance_m)
        return replace(self, scan=unknown, trouble=trouble)


def unknown_scan(min_distance_m: float, max_distance_m: float) -> ObstacleScan:
    """A scan that knows nothing in any direction."""
    return ObstacleScan(
        np.full(SECTOR_COUNT, np.nan, np.float32),
        np.full(SECTOR_COUNT, SectorState.UNKNOWN, np.uint8),
        sector_bearings_deg(),
        min_distance_m,
        max_distance_m,
    )


class Perception:
    """The chain of steps. One thread; what it remembers from frame to frame is the scale alone.

    Args:
        settings: the configuration.
        model: tells depth up to a factor.
        scaler: tells the factor.
        scanner: tells obstacles.
        model_max_depth_m: where the network's depth ends; its value there means "there or beyond".
    """

    def __init__(
        self,
        settings: Settings,
        model: DepthSource,
        scaler: ScaleSource,
        scanner: Scanner,
        model_max_depth_m: float = float("inf"),
    ) -> None:
        self._camera = settings.camera.model
        self._scan_settings = settings.scan
        self._max_relative_sigma = settings.model.max_relative_sigma
        self._model = model
        self._scaler = scaler
        self._scanner = scanner
        self._model_max_depth_m = model_max_depth_m
        self._tracker = ScaleTracker(settings.scan.scale_hold_s)
        self._ground_seen_ns = 0
        self._model_failures = 0

    @classmethod
    def load(cls, settings: Settings) -> Perception:
        """The chain with the configured network.

        Raises:
            ConfigError: a network that is missing, has no card or cannot be run.
        """
        from uavdepth.depth_model import DepthModel
        from uavdepth.ground_scale import GroundScaler
        from uavdepth.scanner import ObstacleScanner

        camera, mount, scan = settings.camera.model, settings.mount.mount, settings.scan
        try:
            model = DepthModel.load(settings.model.path, settings.model.provider, settings.model.threads)
        except (ModelFileError, ModelCardError) as error:
            raise ConfigError(f"[model] path: {error}") from error
        scanner = ObstacleScanner(
            camera,
            mount,
            min_distance_m=scan.min_distance_m,
            max_distance_m=scan.max_distance_m,
            below_m=scan.below_m,
            above_m=scan.above_m,
        )
        scaler = GroundScaler(camera, mount, METRIC_FACTORS if model.card.metric else None)
        return cls(settings, model, scaler, scanner, model.card.max_depth_m)

    @property
    def model_failures(self) -> int:
        """Pictures that the network failed on since the start."""
        return self._model_failures

    def step(self, frame: Frame, telemetry: Telemetry) -> PerceptionResult:
        """Measure one picture. Never raises for what a picture or the vehicle's state can cause.

        Args:
            frame: the picture, of the calibrated size.
            telemetry: the vehicle at the picture's capture time.
        """
        return self.step_late(frame, lambda _captured_ns: telemetry)

    def step_late(self, frame: Frame, telemetry_at: Callable[[int], Telemetry]) -> PerceptionResult:
        """`step`, which asks for the vehicle's state only after the network has run.

        Live, the messages from both sides of the capture have arrived by then, so that attitude is
        interpolated instead of carried forward.

        Args:
            frame: the picture, of the calibrated size.
            telemetry_at: the vehicle at a capture time.
        """
        unknown = unknown_scan(self._scan_settings.min_distance_m, self._scan_settings.max_distance_m)
        blank = PerceptionResult(frame, Telemetry(frame.captured_ns), None, None, unknown)
        try:
            raw = self._model.infer(frame.image_bgr, self._camera)
            blank = replace(blank, telemetry=telemetry_at(frame.captured_ns))
            return self._measure(blank, raw)
        except UavDepthError as error:
            self._model_failures += 1
            return replace(blank, trouble=Trouble.MODEL_FAILED, detail=str(error))
        except Exception as error:
            # ONNX Runtime's errors share no base class, and one bad picture must not end the flight's scans.
            self._model_failures += 1
            log.exception("measuring a picture failed", frame=frame.index)
            detail = f"{type(error).__name__}: {error}"
            return replace(blank, trouble=Trouble.MODEL_FAILED, detail=detail)

    def _measure(self, blank: PerceptionResult, raw: DepthMap) -> PerceptionResult:
        if not np.isfinite(raw.depth_m).any():
            return replace(blank, trouble=Trouble.NO_DEPTH)
        telemetry = blank.telemetry
        if telemetry.attitude is None:
            return replace(blank, trouble=Trouble.NO_ATTITUDE)
        seen = self._certain(raw)
        estimate = None
        if telemetry.height_m is not None:
            estimate = self._scaler.estimate(seen, telemetry.attitude, telemetry.height_m)
        scale = self._tracked(estimate, blank.captured_ns, has_height=telemetry.height_m is not None)
        if scale is None:
            missing = Trouble.NO_HEIGHT if telemetry.height_m is None else Trouble.NO_GROUND
            return replace(blank, trouble=missing)
        if scale.relative_sigma > self._scan_settings.max_scale_sigma:
            return replace(blank, scale=scale, trouble=Trouble.BAD_SCALE)
        depth_m = self._in_metres(seen, scale.factor)
        depth = DepthMap(depth_m, raw.relative_sigma)
        scan = self._scanner.scan(depth_m, telemetry.attitude, telemetry.height_m)
        result = replace(blank, depth=depth, scale=scale, scan=scan)
        if np.all(scan.state == SectorState.UNKNOWN):
            # ArduPilot reads "unknown everywhere" as healthy and free (measured): silence is the only no.
            return result.distrusted(Trouble.NO_DEPTH)
        return result

    def _tracked(
        self, estimate: GroundScale | None, captured_ns: int, *, has_height: bool
    ) -> ScaleStatus | None:
        """The scale to use for this picture, its ground's or one that is held.

        A vehicle that stopped before a wall sees no ground, and silence would open ArduPilot's path into
        the wall after 1 to 1.75 s (measured): so a scale is held long there, with a sigma that grows.
        """
        if estimate is not None:
            self._ground_seen_ns = captured_ns
        scale = self._tracker.update(estimate, captured_ns)
        if scale is None:
            return None
        age_s = (captured_ns - self._ground_seen_ns) / 1e9
        if not has_height and age_s > self._scan_settings.scale_hold_without_height_s:
            return None
        return ScaleStatus(scale.factor, scale.relative_sigma, age_s)

    def _certain(self, depth: DepthMap) -> NDArray[np.float32]:
        """Depth with the pixels that the network is not sure of taken out."""
        if depth.relative_sigma is None:
            return depth.depth_m
        # NaN uncertainty is not certainty: the comparison is written so that it fails.
        sure = depth.relative_sigma <= self._max_relative_sigma
        return np.where(sure, depth.depth_m, np.float32(np.nan))

    def _in_metres(self, depth: NDArray[np.float32], factor: float) -> NDArray[np.float32]:
        """Scaled depth, in which the network's far end is unknown if it would read as an obstacle.

        The network stops at its largest depth, so sky has that value; scaled below the scan's reach it
        would stand there as a wall. Beyond the reach it reads clear, which is what the network says.
        """
        metres = depth * np.float32(factor)
        if self._model_max_depth_m * factor <= self._scan_settings.max_distance_m:
            metres[depth >= self._model_max_depth_m] = np.nan
        return metres
