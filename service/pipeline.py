"""From one picture to one scan: the same steps live and in replay, without threads or clocks."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import structlog
from numpy.typing import NDArray

from service.errors import ConfigError
from service.frame import Frame
from service.ground_hints import GroundHints, KnownGround, hints_of
from service.scale_from_ground import ScaleFromGround, ScaleSource
from service.scale_status import ScaleStatus
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.errors import ModelCardError, ModelFileError, ProviderFallbackWarning, UavDepthError
from uavdepth.hints import Hints
from uavdepth.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg

if TYPE_CHECKING:
    from uavdepth.depth_model import DepthModel

log = structlog.get_logger()

METRIC_FACTORS = (0.4, 2.5)
"""Ground that asks a network which is metric by itself for a larger correction is not the ground below:
a valley floor or a roof (over a valley factors near 0.25 came out, each with a small sigma)."""


class DepthSource(Protocol):
    """What tells depth from a picture, up to one factor, or in metres where it is given hints."""

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        """Depth at the camera's pixels."""


class Scanner(Protocol):
    """What makes a scan of metric depth."""

    def scan(
        self, depth_m: NDArray[np.float32], attitude: Attitude, height_m: float | None = None
    ) -> ObstacleScan:
        """The scan."""


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
    """The chain of steps. One thread; what it remembers from frame to frame is the scale or the height alone.

    Args:
        settings: the configuration.
        model: tells depth up to a factor.
        scaler: tells the factor; None for a model that takes the ground as a hint and answers in metres.
        scanner: tells obstacles.
        model_max_depth_m: where the network's depth ends; its value there means "there or beyond".
    """

    def __init__(
        self,
        settings: Settings,
        model: DepthSource,
        scaler: ScaleSource | None,
        scanner: Scanner,
        model_max_depth_m: float = float("inf"),
    ) -> None:
        scan, camera = settings.scan, settings.camera.model
        self._camera = camera
        self._scan_settings = scan
        self._max_relative_sigma = settings.model.max_relative_sigma
        self._model = model
        self._scale = None if scaler is None else ScaleFromGround(scaler, scan)
        self._hints = GroundHints(camera, settings.mount.mount, scan.scale_hold_without_height_s)
        self._scanner = scanner
        self._model_max_depth_m = model_max_depth_m
        self._model_failures = 0

    @classmethod
    def load(cls, settings: Settings) -> Perception:
        """The chain with the configured network.

        Raises:
            ConfigError: a network that is missing, has no card, cannot be run, or tells inverse depth up
                to scale and shift only.
        """
        from uavdepth.ground_scale import GroundScaler
        from uavdepth.scanner import ObstacleScanner

        camera, mount, scan = settings.camera.model, settings.mount.mount, settings.scan
        model = _load_model(settings)
        scanner = ObstacleScanner(
            camera,
            mount,
            min_distance_m=scan.min_distance_m,
            max_distance_m=scan.max_distance_m,
            below_m=scan.below_m,
            above_m=scan.above_m,
        )
        scaler = GroundScaler(camera, mount, METRIC_FACTORS if model.card.metric else None)
        max_depth_m = float("inf") if model.card.max_depth_m is None else model.card.max_depth_m
        return cls(settings, model, None if "ground" in model.card.hints else scaler, scanner, max_depth_m)

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
        """`step`, which asks for the vehicle's state at capture again after the network has run.

        Live, the messages from both sides of the capture have arrived by then, so that attitude is
        interpolated instead of carried forward. A network that takes hints is told the state as it is
        known before, and its answer is used only if that proves to have been right.

        Args:
            frame: the picture, of the calibrated size.
            telemetry_at: the vehicle at a capture time.
        """
        unknown = unknown_scan(self._scan_settings.min_distance_m, self._scan_settings.max_distance_m)
        blank = PerceptionResult(frame, Telemetry(frame.captured_ns), None, None, unknown)
        try:
            ground = None
            if self._scale is None:
                ground = self._hints.before(frame.captured_ns, telemetry_at)
                raw = self._model.infer(frame.image_bgr, self._camera, hints_of(ground))
            else:
                raw = self._model.infer(frame.image_bgr, self._camera)
            blank = replace(blank, telemetry=telemetry_at(frame.captured_ns))
            return self._measure(blank, raw, ground)
        except UavDepthError as error:
            self._model_failures += 1
            return replace(blank, trouble=Trouble.MODEL_FAILED, detail=str(error))
        except Exception as error:
            # ONNX Runtime's errors share no base class, and one bad picture must not end the flight's scans.
            self._model_failures += 1
            log.exception("measuring a picture failed", frame=frame.index)
            detail = f"{type(error).__name__}: {error}"
            return replace(blank, trouble=Trouble.MODEL_FAILED, detail=detail)

    def _measure(
        self, blank: PerceptionResult, raw: DepthMap, ground: KnownGround | Trouble | None
    ) -> PerceptionResult:
        if not np.isfinite(raw.depth_m).any():
            return replace(blank, trouble=Trouble.NO_DEPTH)
        telemetry = blank.telemetry
        if telemetry.attitude is None:
            return replace(blank, trouble=Trouble.NO_ATTITUDE)
        seen = self._certain(raw)
        scale: ScaleStatus | Trouble
        if self._scale is not None:
            scale = self._scale.of(seen, telemetry.attitude, telemetry, blank.captured_ns)
        elif isinstance(ground, KnownGround):
            scale = self._hints.after(ground, raw, telemetry.attitude)
        else:
            scale = ground or Trouble.NO_HEIGHT
        if isinstance(scale, Trouble):
            return replace(blank, trouble=scale)
        # A network in metres says by the pixel what it doubts; before a wall without ground in view doubt of
        # the whole picture would be silence, and ArduPilot takes that for a free path.
        if self._scale is not None and scale.relative_sigma > self._scan_settings.max_scale_sigma:
            return replace(blank, scale=scale, trouble=Trouble.BAD_SCALE)
        depth_m = self._in_metres(seen, scale.factor)
        depth = DepthMap(depth_m, raw.relative_sigma)
        scan = self._scanner.scan(depth_m, telemetry.attitude, telemetry.height_m)
        result = replace(blank, depth=depth, scale=scale, scan=scan)
        if np.all(scan.state == SectorState.UNKNOWN):
            # ArduPilot reads "unknown everywhere" as healthy and free (measured): silence is the only no.
            return result.distrusted(Trouble.NO_DEPTH)
        return result

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


def _load_model(settings: Settings) -> DepthModel:
    from uavdepth.depth_model import DepthModel

    wanted = settings.model
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ProviderFallbackWarning)
            model = DepthModel.load(wanted.path, wanted.provider, wanted.threads, wanted.card)
    except (ModelFileError, ModelCardError) as error:
        raise ConfigError(f"[model] path: {error}") from error
    if model.card.output == "affine_inverse_depth":
        raise ConfigError(
            f"[model] path: {model.card.name} tells inverse depth up to an unknown scale and shift "
            "(output 'affine_inverse_depth'), and this version has no estimator for both: take a network "
            "with depth in metres or up to one factor"
        )
    log.info("network", name=model.card.name, provider=model.provider, precision=model.precision)
    if model.fallback_reason is not None:
        log.warning("network runs on a slower provider", provider=model.provider, why=model.fallback_reason)
    return model
