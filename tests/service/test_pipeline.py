"""The perception step: depth in the network's units becomes trusted metres, or silence with a reason."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from program_fakes import FLYING_HEIGHT_M, LEVEL, FixedDepth, make_settings, picture, wall_over_ground

from service.errors import ConfigError
from service.frame import Frame
from service.pipeline import SUSPICION_TEXT, Perception, make_scanner, unknown_scan
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.errors import ImageSizeError
from uavdepth.model.hints import Hints
from uavdepth.scale.estimator import NetworkKind, ScaleEstimator
from uavdepth.scan.obstacle_scan import SectorState
from uavdepth.scan.scanner import ObstacleScanner

SETTINGS = make_settings()
CAMERA = SETTINGS.camera.model
MOUNT = SETTINGS.mount.mount
AHEAD = 31
"""Element of OBSTACLE_DISTANCE that looks along the nose: -155 + 31 * 5 = 0."""

FLYING = Telemetry(0, LEVEL, FLYING_HEIGHT_M)


def perception_of(
    model: FixedDepth,
    *overrides: str,
    model_max_depth_m: float = float("inf"),
    kind: NetworkKind = "relative",
    sigma_factor: float = 0.0,
) -> Perception:
    """The chain with distances as they are, unless `sigma_factor` says otherwise."""
    settings = make_settings(*overrides)
    scanner = ObstacleScanner(CAMERA, MOUNT, sigma_factor=sigma_factor)
    return Perception(settings, model, ScaleEstimator(CAMERA, MOUNT, kind), scanner, model_max_depth_m)


def frame_at(seconds: float, index: int = 0) -> Frame:
    return Frame(picture(), round(seconds * 1e9), index)


def shrunk(depth_m: NDArray[np.float32], factor: float = 0.25) -> NDArray[np.float32]:
    """Depth as a network gives it that does not know metres."""
    return depth_m * np.float32(factor)


def test_a_wall_is_reported_in_metres_though_the_network_knows_none() -> None:
    perception = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0))))
    result = perception.step(frame_at(1.0), replace(FLYING, at_ns=1_000_000_000))
    assert result.trouble is None
    assert result.trusted
    assert result.scale is not None
    assert result.scale.factor == pytest.approx(4.0, rel=0.03)
    assert result.scan.state[AHEAD] == SectorState.OBSTACLE
    assert result.scan.distance_m[AHEAD] == pytest.approx(8.0, rel=0.05)
    assert result.depth is not None
    assert result.depth.depth_m[CAMERA.height // 2, CAMERA.width // 2] == pytest.approx(8.0, rel=0.03)


def test_the_vehicles_state_is_asked_for_at_the_time_of_capture_after_the_network_has_run() -> None:
    model = FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)))
    asked: list[tuple[int, int]] = []

    def telemetry_at(captured_ns: int) -> Telemetry:
        asked.append((captured_ns, model.asked))
        return replace(FLYING, at_ns=captured_ns)

    assert perception_of(model, "motion.points=false").step_late(frame_at(3.0), telemetry_at).trusted
    assert asked == [(3_000_000_000, 1)]


@pytest.mark.parametrize(
    ("telemetry", "depth_m", "trouble"),
    [
        (replace(FLYING, attitude=None), wall_over_ground(CAMERA, 8.0), Trouble.NO_ATTITUDE),
        (replace(FLYING, height_m=None), wall_over_ground(CAMERA, 8.0), Trouble.NO_HEIGHT),
        (replace(FLYING, height_m=float("nan")), wall_over_ground(CAMERA, 8.0), Trouble.NO_GROUND),
        (FLYING, np.full((CAMERA.height, CAMERA.width), 0.4, np.float32), Trouble.NO_GROUND),
        (FLYING, np.full((CAMERA.height, CAMERA.width), np.nan, np.float32), Trouble.NO_DEPTH),
        (FLYING, np.full((CAMERA.height, CAMERA.width), np.inf, np.float32), Trouble.NO_DEPTH),
    ],
)
def test_doubt_silences_every_element_and_says_why(
    telemetry: Telemetry, depth_m: NDArray[np.float32], trouble: Trouble
) -> None:
    result = perception_of(FixedDepth(depth_m)).step(frame_at(0.0), telemetry)
    assert result.trouble is trouble
    assert not result.trusted
    assert np.all(result.scan.state == SectorState.UNKNOWN)
    assert np.all(np.isnan(result.scan.distance_m))


def test_a_scale_is_held_for_two_seconds_without_height_then_given_up_and_back_when_it_is_good() -> None:
    perception = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0))))
    assert perception.step(frame_at(10.0), FLYING).trusted
    blind = replace(FLYING, height_m=None)
    held = perception.step(frame_at(11.9), blind)
    assert held.trusted
    assert held.scale is not None
    assert held.scale.age_s == pytest.approx(1.9)
    assert held.scan.distance_m[AHEAD] == pytest.approx(8.0, rel=0.05)
    late = perception.step(frame_at(12.1), blind)
    assert late.trouble is Trouble.NO_HEIGHT
    assert np.all(late.scan.state == SectorState.UNKNOWN)
    assert perception.step(frame_at(12.2), FLYING).trusted


def test_before_a_wall_that_hides_the_ground_the_scale_is_held_as_long_as_configured() -> None:
    model = FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)))
    perception = perception_of(model, "scale.max_age_s=8.0")
    first = perception.step(frame_at(10.0), FLYING)
    model.depth_m = np.full_like(model.depth_m, 1.0)  # a wall at 4 m fills the picture
    held = perception.step(frame_at(17.0), FLYING)
    assert held.trusted
    assert held.scan.distance_m[AHEAD] == pytest.approx(4.0, rel=0.05)
    assert first.scale is not None
    assert held.scale is not None
    assert held.scale.relative_sigma > first.scale.relative_sigma
    late = perception.step(frame_at(18.1), FLYING)
    assert late.trouble is Trouble.OLD_SCALE
    assert np.all(late.scan.state == SectorState.UNKNOWN)


def test_an_uncertain_scale_is_not_used() -> None:
    perception = perception_of(
        FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0))), "scale.max_relative_sigma=0.01"
    )
    result = perception.step(frame_at(0.0), FLYING)
    assert result.trouble is Trouble.BAD_SCALE
    assert result.scale is not None
    assert np.all(result.scan.state == SectorState.UNKNOWN)


def test_distances_are_shortened_by_what_the_scale_leaves_uncertain() -> None:
    model = FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)))
    result = perception_of(model, sigma_factor=2.0).step(frame_at(0.0), FLYING)
    assert result.scale is not None
    shorter = 8.0 * (1 - 2 * result.scale.relative_sigma)
    assert result.scan.distance_m[AHEAD] == pytest.approx(shorter, rel=0.05)


def test_inverse_depth_up_to_scale_and_shift_becomes_metres_too() -> None:
    inverse = (1.0 / wall_over_ground(CAMERA, 8.0) - 0.02) * np.float32(7.0)

    class Affine(FixedDepth):
        def infer(
            self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
        ) -> DepthMap:
            return DepthMap.from_affine(self.depth_m)

    perception = perception_of(Affine(inverse.astype(np.float32)), kind="affine")
    results = [perception.step(frame_at(0.1 * i, i), FLYING) for i in range(10)]
    last = results[-1]
    assert last.trouble is None
    assert last.scan.state[AHEAD] == SectorState.OBSTACLE
    assert last.scan.distance_m[AHEAD] == pytest.approx(8.0, rel=0.15)


def test_what_the_mask_covers_is_unknown_and_not_near(tmp_path: Path) -> None:
    legs = np.full((CAMERA.height, CAMERA.width), 255, np.uint8)
    legs[:, : CAMERA.width // 4] = 0
    cv2.imwrite(str(tmp_path / "legs.png"), legs)
    settings = make_settings(f"camera.mask={tmp_path / 'legs.png'}")
    depth_m = shrunk(wall_over_ground(CAMERA, 8.0))
    depth_m[:, : CAMERA.width // 4] = 0.1
    estimator = ScaleEstimator(CAMERA, MOUNT)
    result = Perception(settings, FixedDepth(depth_m), estimator, make_scanner(settings)).step(
        frame_at(0.0), FLYING
    )
    assert result.trusted
    assert np.nanmin(result.scan.distance_m) > 6.0
    assert result.scan.state[AHEAD - 7] == SectorState.UNKNOWN


def test_a_mask_that_does_not_fit_is_refused_by_its_key(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "small.png"), np.full((10, 10), 255, np.uint8))
    with pytest.raises(ConfigError, match=r"\[camera\] mask: .*10x10"):
        make_scanner(make_settings(f"camera.mask={tmp_path / 'small.png'}"))


def test_an_obstacle_that_leaves_the_picture_is_remembered_for_half_a_second() -> None:
    model = FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)))
    perception = perception_of(model)
    here = replace(FLYING, position_ned_m=(0.0, 0.0, -FLYING_HEIGHT_M), velocity_ned_mps=(0.0, 0.0, 0.0))
    turned = replace(here, attitude=Attitude(0.0, 0.0, 1.2))
    left = AHEAD - round(np.degrees(1.2) / 5)
    assert perception.step(frame_at(0.0), here).scan.state[AHEAD] == SectorState.OBSTACLE
    assert perception.step(frame_at(0.4), turned).scan.state[left] == SectorState.OBSTACLE
    perception.step(frame_at(1.0), here)
    assert perception.step(frame_at(1.6), turned).scan.state[left] == SectorState.UNKNOWN


@pytest.mark.parametrize(
    ("position_m", "velocity_mps", "heading_rad", "left_m"),
    [(5.0, 0.0, 0.0, 8.0), (0.0, 12.0, 0.0, None), (0.0, 0.0, 0.9, 8.0), (0.0, 0.0, -2.5, 8.0)],
    ids=["position", "velocity", "heading", "heading the other way"],
)
def test_an_estimate_that_is_reset_moves_nothing_that_was_seen(
    position_m: float, velocity_mps: float, heading_rad: float, left_m: float | None
) -> None:
    perception = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0))))
    here = replace(FLYING, position_ned_m=(0.0, 0.0, -FLYING_HEIGHT_M), velocity_ned_mps=(0.0, 0.0, 0.0))
    reset = replace(
        here,
        attitude=Attitude(0.0, 0.0, math.remainder(1.2 + heading_rad, math.tau)),
        heading_shift_rad=heading_rad,
        position_ned_m=(position_m, 0.0, -FLYING_HEIGHT_M),
        velocity_ned_mps=(velocity_mps, 0.0, 0.0),
    )
    perception.step(frame_at(0.0), here)
    told = perception.step(frame_at(0.1), reset).scan
    left = AHEAD - round(np.degrees(1.2) / 5)
    if left_m is None:
        assert told.state[left] == SectorState.UNKNOWN, "how far it has moved is not known"
    else:
        assert told.distance_m[left] == pytest.approx(left_m, rel=0.03)


@pytest.mark.parametrize("error", [RuntimeError("provider broke"), ImageSizeError("160x96"), KeyError("x")])
def test_a_network_that_fails_is_counted_and_the_next_picture_goes_on(error: Exception) -> None:
    model = FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)), error=error)
    perception = perception_of(model)
    result = perception.step(frame_at(0.0), FLYING)
    assert result.trouble is Trouble.MODEL_FAILED
    assert result.detail
    assert perception.model_failures == 1
    model.error = None
    assert perception.step(frame_at(0.1), FLYING).trusted
    assert perception.model_failures == 1


@pytest.mark.parametrize(("wall_m", "told"), [(8.0, SectorState.OBSTACLE), (30.0, SectorState.UNKNOWN)])
def test_depth_that_the_network_is_not_sure_of_warns_when_near_and_frees_nothing(
    wall_m: float, told: SectorState
) -> None:
    depth_m = shrunk(wall_over_ground(CAMERA, wall_m))
    sigma = np.zeros_like(depth_m)
    sigma[:, : CAMERA.width // 2] = 3.0
    sigma[:, CAMERA.width // 2 : CAMERA.width // 2 + 4] = np.nan
    result = perception_of(FixedDepth(depth_m, sigma)).step(frame_at(0.0), FLYING)
    assert result.trusted
    assert not np.any(result.scan.state[:AHEAD] == SectorState.CLEAR)
    assert np.all(result.scan.state[AHEAD - 3 : AHEAD] == told)
    assert result.scan.state[AHEAD + 2] == (told or SectorState.CLEAR)
    assert result.depth is not None
    assert np.all(np.isnan(result.depth.believed_m[:, : CAMERA.width // 2 + 4])), "nor is it shown as known"


def test_the_far_end_of_the_network_never_stands_there_as_a_wall() -> None:
    # The network saturates at 3 of its units, which the ground says are 12 m: sky would be a wall there.
    depth_m = np.minimum(shrunk(wall_over_ground(CAMERA, np.inf)), np.float32(3.0))
    result = perception_of(FixedDepth(depth_m), model_max_depth_m=3.0).step(frame_at(0.0), FLYING)
    assert not np.any(result.scan.state == SectorState.OBSTACLE)
    # Without the knowledge of the end the same depth is a wall: this is what the rule prevents.
    believed = perception_of(FixedDepth(depth_m)).step(frame_at(0.0), FLYING)
    assert np.any(believed.scan.state == SectorState.OBSTACLE)


def test_a_far_end_beyond_the_scan_is_clear() -> None:
    depth_m = np.minimum(shrunk(wall_over_ground(CAMERA, np.inf)), np.float32(20.0))
    result = perception_of(FixedDepth(depth_m), model_max_depth_m=20.0).step(frame_at(0.0), FLYING)
    assert result.scan.state[AHEAD] == SectorState.CLEAR


def test_a_result_that_came_too_late_is_taken_back() -> None:
    result = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)))).step(frame_at(0.0), FLYING)
    assert np.any(result.scan.state != SectorState.UNKNOWN)
    late = result.distrusted(Trouble.STALE_FRAME)
    assert not late.trusted
    assert np.all(late.scan.state == SectorState.UNKNOWN)
    assert late.scan.max_distance_m == result.scan.max_distance_m


def test_a_contradiction_of_the_sources_is_told_once() -> None:
    result = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0)))).step(frame_at(0.0), FLYING)
    assert result.scale is not None
    doubtful = replace(result, scale=replace(result.scale, suspicion="metres are 20 % off"))
    perception = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0))))
    assert perception.remark(result) is None
    assert perception.remark(doubtful) == SUSPICION_TEXT
    assert perception.remark(doubtful) is None
    assert len(SUSPICION_TEXT) <= 50


def test_inverse_depth_up_to_scale_and_shift_flies_from_a_file(tmp_path: Path) -> None:
    path = Path(__file__).parents[1] / "data" / "depth_anything_tiny.onnx"
    card = tmp_path / "card.toml"
    card.write_text(
        'card_version = 2\nname = "anything"\ninput_width = 70\ninput_height = 42\nmultiple_of = 14\n'
        'mean = [0, 0, 0]\nstd = [1, 1, 1]\noutput = "affine_inverse_depth"\n'
        'input_name = "pixel_values"\noutput_name = "predicted_depth"\n'
    )
    settings = make_settings(f"model.path={path}", f"model.card={card}", "model.provider=cpu")
    perception = Perception.load(settings)
    result = perception.step(frame_at(0.0), FLYING)
    # Its weights are random, so what it says of a grey picture is nothing; but it is asked, and not refused.
    assert perception.model_failures == 0
    assert not result.trusted or result.scale is not None


def test_live_and_replay_agree() -> None:
    results = []
    for _ in range(2):
        perception = perception_of(FixedDepth(shrunk(wall_over_ground(CAMERA, 8.0))))
        results.append([perception.step(frame_at(0.1 * i, i), FLYING).scan.distance_m for i in range(5)])
    np.testing.assert_array_equal(results[0], results[1])


def test_an_unknown_scan_has_all_elements_and_no_distance() -> None:
    scan = unknown_scan(0.2, 20.0)
    assert scan.state.shape == scan.distance_m.shape == scan.bearing_deg.shape == (72,)
    assert scan.nearest_m is None


@pytest.mark.parametrize("trouble", list(Trouble))
def test_every_trouble_fits_into_one_status_text(trouble: Trouble) -> None:
    assert len(f"uavdepth OFF: {trouble.value}") <= 50
