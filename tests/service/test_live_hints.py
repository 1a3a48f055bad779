"""Points by the vehicle's own motion: a textured wall 8 m away, flown past sideways at 2 m/s."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from program_fakes import LEVEL, make_settings, wall_over_ground
from structlog.testing import capture_logs

from service.frame import Frame
from service.live_hints import LiveHints
from service.pipeline import SUSPICION_TEXT, Perception
from service.settings import MotionSettings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints, PointHints
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.scale.estimator import ScaleEstimator
from uavdepth.scan.scanner import ObstacleScanner

SETTINGS = make_settings("camera.width=320", "camera.height=200")
CAMERA, MOUNT = SETTINGS.camera.model, SETTINGS.mount.mount
WALL_M, SPEED_MPS = 8.0, 2.0
AHEAD = 31

_TEXTURE = cv2.GaussianBlur(
    np.random.default_rng(3).integers(0, 256, (200, 900, 3), dtype=np.uint8).astype(np.float32), (0, 0), 1.5
)
_TEXTURE = np.clip((_TEXTURE - 128) * 3 + 128, 0, 255)


def frame_at(seconds: float) -> Frame:
    """What the camera sees of the wall after so long."""
    shift = -CAMERA.fx * SPEED_MPS * seconds / WALL_M
    matrix = np.array([[1.0, 0.0, shift], [0.0, 1.0, 0.0]])
    picture = cv2.warpAffine(_TEXTURE, matrix, (CAMERA.width, CAMERA.height), flags=cv2.INTER_CUBIC)
    return Frame(np.clip(picture, 0, 255).astype(np.uint8), round(seconds * 1e9), 0)


def flying(at_ns: int, height_m: float | None = None, epoch: int = 0) -> Telemetry:
    """Level flight to the east past a wall in the north."""
    east_m = SPEED_MPS * at_ns * 1e-9
    return Telemetry(at_ns, LEVEL, height_m, (0.0, east_m, -30.0), (0.0, SPEED_MPS, 0.0), epoch=epoch)


def flown(
    hints: LiveHints, times_s: list[float], telemetry_at: Callable[[int], Telemetry] = flying
) -> PointHints | None:
    points = None
    for seconds in times_s:
        points = hints.update(frame_at(seconds), telemetry_at)
    return points


def live() -> LiveHints:
    return LiveHints(CAMERA, MOUNT, MotionSettings())


def every(period_s: float, until_s: float) -> list[float]:
    return [float(seconds) for seconds in np.arange(1.0, 1.0 + until_s, period_s)]


@pytest.mark.parametrize("period_s", [0.1, 0.3])
def test_points_have_the_depth_of_the_wall_whether_pictures_are_fast_or_slow(period_s: float) -> None:
    hints = live()
    points = flown(hints, every(period_s, 1.0))
    assert points is not None
    assert len(points) > 40
    assert float(np.median(points.depth_m)) == pytest.approx(WALL_M, rel=0.05)
    # 0.1 m/s of doubt in 2 m/s.
    assert 0.02 < hints.scale_sigma < 0.15


def test_without_velocity_there_are_no_points() -> None:
    def no_position(at_ns: int) -> Telemetry:
        return replace(flying(at_ns), position_ned_m=None, velocity_ned_mps=None)

    assert flown(live(), every(0.1, 1.0), no_position) is None


def test_points_end_when_the_autopilot_has_started_anew() -> None:
    hints = live()
    assert flown(hints, every(0.1, 1.0)) is not None
    assert hints.update(frame_at(2.0), lambda at_ns: flying(at_ns, epoch=1)) is None


def test_points_end_when_time_steps_back() -> None:
    hints = live()
    assert flown(hints, every(0.1, 1.0)) is not None
    assert hints.update(frame_at(1.2), flying) is None


def test_points_can_be_switched_off() -> None:
    hints = LiveHints(CAMERA, MOUNT, MotionSettings(points=False))
    assert flown(hints, every(0.1, 0.5)) is None


def test_a_picture_that_cannot_be_followed_is_told_once_and_flight_goes_on() -> None:
    hints = live()
    broken = replace(frame_at(1.0), image_bgr=np.zeros((3, 3), np.uint8))
    with capture_logs() as said:
        assert hints.update(broken, flying) is None
        assert hints.update(replace(broken, captured_ns=1_100_000_000), flying) is None
    assert len(said) == 1
    assert flown(hints, every(0.1, 1.0)) is not None


# -- through the whole chain


@dataclass
class TakesPoints:
    """A network that believes the points that it is told, and sees a wall of unit depth."""

    told: list[Hints | None] = field(default_factory=list)

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        self.told.append(hints)
        depth_m = 1.0 if hints is None or hints.points is None else float(np.median(hints.points.depth_m))
        shape = (camera.height, camera.width)
        return DepthMap(np.full(shape, depth_m, np.float32), np.full(shape, 0.05, np.float32))


def test_a_network_with_points_measures_in_metres_without_any_height() -> None:
    model = TakesPoints()
    scanner = ObstacleScanner(CAMERA, MOUNT, sigma_factor=0.0)
    perception = Perception(SETTINGS, model, None, scanner)
    results = [perception.step_late(frame_at(seconds), flying) for seconds in every(0.1, 1.0)]
    assert results[0].trouble is Trouble.NO_HEIGHT
    last = results[-1]
    assert last.trouble is None
    assert last.points > 40
    assert last.scale is not None
    assert last.scale.sources == ("points",)
    assert last.scan.distance_m[AHEAD] == pytest.approx(WALL_M, rel=0.05)
    assert model.told[-1] is not None
    assert model.told[-1].ground is None


def test_ground_and_points_are_told_together() -> None:
    model = TakesPoints()
    perception = Perception(SETTINGS, model, None, ObstacleScanner(CAMERA, MOUNT))
    for seconds in every(0.1, 1.0):
        result = perception.step_late(frame_at(seconds), lambda at_ns: flying(at_ns, height_m=30.0))
    assert model.told[-1] is not None
    assert model.told[-1].ground is not None
    assert model.told[-1].points is not None
    assert result.scale is not None
    assert result.scale.sources == ("ground", "points")


@pytest.mark.parametrize(("height_m", "is_suspected"), [(2.0, False), (3.0, True)])
def test_a_height_that_contradicts_the_motion_for_seconds_is_suspected(
    height_m: float, is_suspected: bool
) -> None:
    class SeesTheGround(TakesPoints):
        def infer(
            self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
        ) -> DepthMap:
            depth_m = wall_over_ground(camera, WALL_M, 2.0)
            return DepthMap(depth_m, np.full_like(depth_m, 0.05))

    perception = Perception(SETTINGS, SeesTheGround(), None, ObstacleScanner(CAMERA, MOUNT))
    for seconds in every(0.2, 6.5):
        result = perception.step_late(frame_at(seconds), lambda at_ns: flying(at_ns, height_m=height_m))
    assert result.scale is not None
    assert (result.scale.suspicion is not None) is is_suspected
    assert (perception.remark(result) == SUSPICION_TEXT) is is_suspected


@pytest.mark.parametrize("hinted", [True, False])
def test_turns_that_contradict_the_focal_length_are_told_to_the_pilot(
    hinted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        MotionPoints, "suspicion", property(lambda _points: "the focal length is 20 % too long")
    )
    scale = None if hinted else ScaleEstimator(CAMERA, MOUNT, "relative")
    perception = Perception(SETTINGS, TakesPoints(), scale, ObstacleScanner(CAMERA, MOUNT))
    for seconds in every(0.1, 1.0):
        result = perception.step_late(frame_at(seconds), flying)
    assert result.scale is not None
    assert result.scale.suspicion == "the focal length is 20 % too long"
    assert perception.remark(result) == SUSPICION_TEXT


def test_a_network_that_takes_the_ground_alone_costs_no_points() -> None:
    model = TakesPoints()
    perception = Perception(SETTINGS, model, None, ObstacleScanner(CAMERA, MOUNT), takes=("ground",))
    for seconds in every(0.1, 1.0):
        result = perception.step_late(frame_at(seconds), flying)
    assert result.points == 0
    assert result.trouble is Trouble.NO_HEIGHT


def test_a_height_is_no_scale_for_a_network_that_takes_points_alone() -> None:
    scanner = ObstacleScanner(CAMERA, MOUNT)
    perception = Perception(SETTINGS, TakesPoints(), None, scanner, takes=("points",))
    first = perception.step_late(frame_at(1.0), lambda at_ns: flying(at_ns, height_m=2.0))
    assert first.trouble is Trouble.NO_POINTS


def test_a_network_that_takes_no_hints_gets_its_scale_from_points() -> None:
    class Unit(TakesPoints):
        def infer(
            self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
        ) -> DepthMap:
            assert hints is None
            return super().infer(image_bgr, camera)

    scanner = ObstacleScanner(CAMERA, MOUNT, sigma_factor=0.0)
    perception = Perception(SETTINGS, Unit(), ScaleEstimator(CAMERA, MOUNT), scanner)
    for seconds in every(0.1, 1.5):
        result = perception.step_late(frame_at(seconds), flying)
    assert result.trouble is None
    assert result.scale is not None
    assert result.scale.sources == ("points",)
    assert result.scale.factor == pytest.approx(WALL_M, rel=0.06)
    assert result.scan.distance_m[AHEAD] == pytest.approx(WALL_M, rel=0.06)
