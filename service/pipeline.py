"""From one picture to one scan: the same steps live and in replay, without threads or clocks."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import structlog
from numpy.typing import NDArray

from service.errors import ConfigError
from service.frame import Frame
from service.measurement import DepthSource, Measurement, ScaleSource
from service.metres import Metres
from service.mount_watch import MountWatch
from service.network import answers_in_metres, load_network, network_kind
from service.perception_result import PerceptionResult, unknown_scan
from service.planar_track import PlanarTrack
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.errors import ImageMaskError, UavDepthError
from uavdepth.model.card import ModelCard
from uavdepth.scan.memory import ScanMemory
from uavdepth.scan.motion import PlanarPose
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

if TYPE_CHECKING:
    from uavdepth.model.card import ModelCard

__all__ = ["DepthSource", "Perception", "PerceptionResult", "ScaleSource", "Scanner", "unknown_scan"]

log = structlog.get_logger()

ALL_HINTS = ("ground", "points")

SUSPICION_TEXT = "uavdepth: metres doubtful, check focal length"


class Scanner(Protocol):
    """What makes a scan of metric depth."""

    def scan(
        self,
        depth_m: NDArray[np.float32],
        attitude: Attitude,
        height_m: float | None = None,
        relative_sigma: NDArray[np.float32] | None = None,
    ) -> ObstacleScan:
        """The scan."""


class Perception:
    """The chain of steps. One thread; what it remembers from frame to frame is the scale, the height, the
    corners that it follows, and the obstacles of the last half second.

    Args:
        settings: the configuration.
        model: tells depth.
        scale: finds its metres; None for a model that takes hints and answers in metres.
        scanner: tells obstacles.
        model_max_depth_m: where the network's depth ends; its value there means "there or beyond".
        takes: the hints that the model takes.
    """

    def __init__(
        self,
        settings: Settings,
        model: DepthSource,
        scale: ScaleSource | None,
        scanner: Scanner,
        model_max_depth_m: float = float("inf"),
        takes: Collection[str] = ALL_HINTS,
    ) -> None:
        self._scan_settings = settings.scan
        self._model, self._scale = model, scale
        self._model_max_depth_m, self._takes = model_max_depth_m, takes
        self._metres = Metres(settings, model, scale, takes, model_max_depth_m)
        self._scanner = scanner
        self._memory = ScanMemory(settings.scan.memory_s)
        self._track = PlanarTrack()
        self._mount_watch = MountWatch(settings, self._metres.without_hints)
        self._has_told_suspicion = False
        self._model_failures = 0
        self.model_card: ModelCard | None = None
        """The network's card; None for a source of depth that has none."""

    @classmethod
    def load(cls, settings: Settings) -> Perception:
        """The chain with the configured network.

        Raises:
            ConfigError: a network that is missing, has no card or cannot be run, or a mask that does not
                fit the camera.
        """
        from uavdepth.scale.estimator import ScaleEstimator

        model = load_network(settings)
        card = model.card
        scale = None
        if not answers_in_metres(card):
            scale = ScaleEstimator(settings.camera.model, settings.mount.mount, network_kind(card))
        max_depth_m = float("inf") if card.max_depth_m is None else card.max_depth_m
        perception = cls(settings, model, scale, make_scanner(settings), max_depth_m, card.hints)
        perception.model_card = card
        return perception

    def beside(self, settings: Settings) -> Perception:
        """The chain for another camera, with the same network and a memory of its own.

        Args:
            settings: the same but for camera and mount.

        Raises:
            ConfigError: a mask that does not fit the camera.
        """
        from uavdepth.scale.estimator import ScaleEstimator

        scale = self._scale
        if scale is not None:
            scale = ScaleEstimator(settings.camera.model, settings.mount.mount, scale.kind)
        scanner = make_scanner(settings)
        return Perception(settings, self._model, scale, scanner, self._model_max_depth_m, self._takes)

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
        known = replace(telemetry, at_ns=frame.captured_ns)
        return self.step_late(frame, lambda _captured_ns: known)

    def step_late(self, frame: Frame, telemetry_at: Callable[[int], Telemetry]) -> PerceptionResult:
        """`step`, which asks for the vehicle's state itself, before and after the network has run.

        Args:
            frame: the picture, of the calibrated size.
            telemetry_at: the vehicle at a capture time.
        """
        unknown = unknown_scan(self._scan_settings.min_distance_m, self._scan_settings.max_distance_m)
        blank = PerceptionResult(frame, Telemetry(frame.captured_ns), None, None, unknown)
        try:
            measured = self._metres.measure(frame, telemetry_at)
            blank = replace(blank, telemetry=measured.telemetry, scale=measured.scale, points=measured.points)
            result = self._scan(blank, measured)
        except UavDepthError as error:
            self._model_failures += 1
            result = replace(blank, trouble=Trouble.MODEL_FAILED, detail=str(error))
        except Exception as error:
            # ONNX Runtime's errors share no base class, and one bad picture must not end the flight's scans.
            self._model_failures += 1
            log.exception("measuring a picture failed", frame=frame.index)
            detail = f"{type(error).__name__}: {error}"
            result = replace(blank, trouble=Trouble.MODEL_FAILED, detail=detail)
        if not result.trusted:
            self._memory.clear()
        return result

    def look_ahead(self) -> None:
        """What of one picture only the next ones need; to be called when its result has been sent.

        Results are the same without it: the next step begins with what was left undone.
        """
        self._metres.look_ahead()

    def remark(self, result: PerceptionResult) -> str | None:
        """What seems to be configured wrong; to be called when a result has been sent.

        Now and then it runs the network once more to look at the mount, so the next picture may be late.

        Returns:
            A text of at most 50 characters for the pilot, once for each thing.
        """
        suspicion = None if result.scale is None else result.scale.suspicion
        if suspicion is not None and not self._has_told_suspicion:
            self._has_told_suspicion = True
            log.warning(suspicion)
            return SUSPICION_TEXT
        return None if result.depth is None else self._mount_watch.look(result.frame, result.telemetry)

    def _scan(self, blank: PerceptionResult, measured: Measurement) -> PerceptionResult:
        depth, attitude = measured.depth, measured.telemetry.attitude
        if depth is None or attitude is None:
            return replace(blank, trouble=measured.trouble or Trouble.NO_DEPTH)
        scan = self._scanner.scan(depth.depth_m, attitude, measured.height_m, depth.relative_sigma)
        result = replace(blank, depth=depth, scan=scan)
        if np.all(scan.state == SectorState.UNKNOWN):
            # ArduPilot reads "unknown everywhere" as healthy and free (measured): silence is the only no.
            return result.distrusted(Trouble.NO_DEPTH)
        pose = self._track.pose_at(measured.telemetry)
        return replace(result, scan=self._memory.merge(scan, blank.captured_ns, pose))


def make_scanner(settings: Settings) -> Scanner:
    """The scanner that the configuration describes.

    Raises:
        ConfigError: a mask that cannot be read or does not fit the camera.
    """
    from uavdepth.scan.image_mask import load_image_mask
    from uavdepth.scan.scanner import ObstacleScanner

    camera, scan, mask = settings.camera.model, settings.scan, None
    if settings.camera.mask is not None:
        try:
            mask = load_image_mask(settings.camera.mask, camera)
        except ImageMaskError as error:
            raise ConfigError(f"[camera] mask: {error}") from error
    return ObstacleScanner(
        camera,
        settings.mount.mount,
        min_distance_m=scan.min_distance_m,
        max_distance_m=scan.max_distance_m,
        below_m=scan.below_m,
        above_m=scan.above_m,
        sigma_factor=scan.sigma_factor,
        mask=mask,
        max_ground_slope_deg=scan.max_ground_slope_deg,
        max_relative_sigma=math.hypot(settings.model.max_relative_sigma, settings.scale.max_relative_sigma),
    )


def pose_of(telemetry: Telemetry) -> PlanarPose | None:
    """Where the vehicle was at capture, seen from above; None where it does not know."""
    attitude, position = telemetry.attitude, telemetry.position_ned_m
    if attitude is None or position is None:
        return None
    if not all(math.isfinite(value) for value in (*position, attitude.yaw_rad)):
        return None
    return PlanarPose(telemetry.at_ns, position[0], position[1], attitude.yaw_rad)
