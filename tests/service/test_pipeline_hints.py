"""A network that takes the ground as a hint: told what is known early, believed if that proves right."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from program_fakes import FLYING_HEIGHT_M, LEVEL, make_settings, picture, wall_over_ground
from structlog.testing import capture_logs

from service.frame import Frame
from service.pipeline import Perception
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.hints import Hints
from uavdepth.model_card import CARD_METADATA_KEY
from uavdepth.obstacle_scan import ObstacleScan, SectorState
from uavdepth.providers import PROVIDERS, OpenedSession, ProviderUnavailableError
from uavdepth.scanner import ObstacleScanner

SETTINGS = make_settings()
CAMERA, MOUNT = SETTINGS.camera.model, SETTINGS.mount.mount
AHEAD = 31
MS = 1_000_000
SECOND = 1_000_000_000
FLYING = Telemetry(0, LEVEL, FLYING_HEIGHT_M, position_ned_m=(0.0, 0.0, -FLYING_HEIGHT_M))


@dataclass
class HintedDepth:
    """A network that sees a wall and takes metres from the height that it is told."""

    wall_m: float = 8.0
    sigma: float = 0.1
    told: list[Hints | None] = field(default_factory=list)

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        self.told.append(hints)
        guess_m = FLYING_HEIGHT_M / 4 if hints is None or hints.ground is None else hints.ground.height_m
        depth_m = wall_over_ground(camera, self.wall_m) * np.float32(guess_m / FLYING_HEIGHT_M)
        return DepthMap(depth_m, np.full_like(depth_m, self.sigma))


@dataclass
class ScriptedTelemetry:
    """Says one thing while the network has not run and another when it has."""

    model: HintedDepth
    early: Callable[[int], Telemetry]
    late: Callable[[int], Telemetry]
    asked: list[tuple[int, int]] = field(default_factory=list)

    def __call__(self, at_ns: int) -> Telemetry:
        self.asked.append((at_ns, len(self.model.told)))
        return (self.late if self.model.told else self.early)(at_ns)


def perception_of(model: HintedDepth, *overrides: str) -> Perception:
    """The chain with distances as they are."""
    scanner = ObstacleScanner(CAMERA, MOUNT, sigma_factor=0.0)
    return Perception(make_settings("motion.points=false", *overrides), model, None, scanner)


def at(at_ns: int, **changes: object) -> Telemetry:
    return replace(FLYING, at_ns=at_ns, **changes)  # type: ignore[arg-type]


def frame_at(seconds: float) -> Frame:
    return Frame(picture(), round(seconds * SECOND), 0)


def test_metres_come_from_the_network_and_the_height_that_it_is_told() -> None:
    model = HintedDepth()
    result = perception_of(model).step(frame_at(1.0), at(SECOND))
    assert result.trusted
    assert model.told[0] is not None
    assert model.told[0].ground is not None
    assert model.told[0].ground.height_m == FLYING_HEIGHT_M
    assert result.scan.state[AHEAD] == SectorState.OBSTACLE
    assert result.scan.distance_m[AHEAD] == pytest.approx(8.0, rel=0.05)
    assert result.scale is not None
    assert (result.scale.factor, result.scale.age_s, result.scale.sources) == (1.0, 0.0, ("ground",))
    assert result.scale.relative_sigma == pytest.approx(0.05)
    assert result.depth is not None
    assert result.depth.relative_sigma is not None
    assert result.depth.relative_sigma[0, 0] == pytest.approx(math.hypot(0.1, 0.05))


def test_the_state_is_asked_for_before_the_network_runs_and_again_after_it() -> None:
    model = HintedDepth()
    early, late = Attitude(0.01, 0.0, 0.0), Attitude(0.02, 0.0, 0.0)
    telemetry = ScriptedTelemetry(
        model, lambda at_ns: at(at_ns, attitude=early), lambda at_ns: at(at_ns, attitude=late)
    )
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert set(telemetry.asked) == {(3 * SECOND, 0), (3 * SECOND, 1)}
    assert model.told[0] is not None
    assert model.told[0].ground is not None
    assert model.told[0].ground.attitude == early
    assert result.telemetry.attitude == late
    assert result.trusted


def test_an_attitude_that_has_not_arrived_yet_is_carried_on_by_the_turn_so_far() -> None:
    model = HintedDepth()
    arrived_ns = 3 * SECOND - 80 * MS

    def turning(at_ns: int) -> Attitude:
        return Attitude(0.0, (at_ns - 3 * SECOND) / SECOND, 0.0)

    telemetry = ScriptedTelemetry(
        model,
        lambda at_ns: at(at_ns, attitude=turning(at_ns) if at_ns <= arrived_ns else None),
        lambda at_ns: at(at_ns, attitude=turning(at_ns)),
    )
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert result.trusted
    assert len(model.told) == 1
    assert model.told[0] is not None
    assert model.told[0].ground is not None
    # Held instead of carried on it would be 0.1 rad, 5.7 degrees, off.
    assert model.told[0].ground.attitude.pitch_rad == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("late", "asked"),
    [
        (Attitude(0.0, math.radians(2.5), 0.0), 1),
        (Attitude(0.0, math.radians(3.5), 0.0), 2),
        (Attitude(math.radians(-3.5), 0.0, 0.0), 2),
        (Attitude(0.0, 0.0, 2.0), 1),
    ],
)
def test_an_answer_to_an_attitude_that_was_not_so_is_asked_for_again(late: Attitude, asked: int) -> None:
    model = HintedDepth()
    telemetry = ScriptedTelemetry(model, at, lambda at_ns: at(at_ns, attitude=late))
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert result.trusted
    assert len(model.told) == asked
    if asked == 2:
        assert model.told[1] is not None
        assert model.told[1].ground is not None
        assert model.told[1].ground.attitude == late


def test_a_small_error_of_the_told_attitude_is_uncertainty() -> None:
    sigmas = []
    for degrees in (0.0, 2.5):
        model, late = HintedDepth(), Attitude(0.0, math.radians(degrees), 0.0)
        telemetry = ScriptedTelemetry(model, at, partial(at, attitude=late))
        result = perception_of(model).step_late(frame_at(3.0), telemetry)
        assert result.scale is not None
        sigmas.append(result.scale.relative_sigma)
    # 2.5 degrees on ground that is seen 15 degrees below the horizon.
    assert sigmas[1] == pytest.approx(math.hypot(sigmas[0], math.radians(2.5) / math.tan(math.radians(15))))


def test_an_attitude_that_comes_only_while_the_network_runs_is_used() -> None:
    model = HintedDepth()
    telemetry = ScriptedTelemetry(model, lambda at_ns: at(at_ns, attitude=None), at)
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert result.trusted
    assert [hints is not None and hints.ground is not None for hints in model.told] == [False, True]


@pytest.mark.parametrize(
    ("changes", "trouble"),
    [
        ({"attitude": None}, Trouble.NO_ATTITUDE),
        ({"height_m": None}, Trouble.NO_HEIGHT),
        ({"height_m": math.nan}, Trouble.NO_GROUND),
        ({"height_m": 0.1}, Trouble.NO_GROUND),
    ],
)
def test_without_attitude_or_height_the_network_runs_unhinted_and_nothing_is_believed(
    changes: dict[str, object], trouble: Trouble
) -> None:
    model = HintedDepth()
    perception = perception_of(model)
    result = perception.step(frame_at(1.0), at(SECOND, **changes))
    assert result.trouble is trouble
    assert np.all(result.scan.state == SectorState.UNKNOWN)
    assert result.depth is None
    assert model.told == [Hints()]


def test_a_height_is_held_for_a_while_moved_by_the_climb_and_then_given_up() -> None:
    model = HintedDepth()
    perception = perception_of(model, "scale.max_age_s=1.0")
    assert perception.step(frame_at(10.0), at(10 * SECOND)).trusted
    blind_ns = 10 * SECOND + 900 * MS
    climbed = at(blind_ns, height_m=None, position_ned_m=(0.0, 0.0, -FLYING_HEIGHT_M - 0.5))
    held = perception.step(frame_at(10.9), climbed)
    assert held.trusted
    assert model.told[1] is not None
    assert model.told[1].ground is not None
    assert model.told[1].ground.height_m == pytest.approx(FLYING_HEIGHT_M + 0.5)
    assert held.scale is not None
    assert held.scale.age_s == pytest.approx(0.9)
    assert held.scale.relative_sigma > 0.05
    late_ns = 11 * SECOND + 100 * MS
    assert perception.step(frame_at(11.1), at(late_ns, height_m=None)).trouble is Trouble.NO_HEIGHT


def test_without_a_rangefinder_the_ekf_tells_the_height_near_the_start_and_no_further() -> None:
    model = HintedDepth()
    perception = perception_of(model, "scale.height_source=both")
    near = perception.step(frame_at(1.0), at(SECOND, height_m=None, position_ned_m=(3.0, 0.0, -10.0)))
    assert near.trusted
    assert near.scale is not None
    assert near.scale.sources == ("ground",)
    assert model.told[-1] is not None
    assert model.told[-1].ground is not None
    assert model.told[-1].ground.height_m == 10.0
    far = perception.step(frame_at(2.0), at(2 * SECOND, height_m=None, position_ned_m=(80.0, 0.0, -10.0)))
    assert far.trouble is Trouble.NO_HEIGHT
    assert model.told[-1] == Hints()


@pytest.mark.parametrize(("rangefinder_m", "removed_m"), [(4.0, 4.0), (None, None)])
def test_ground_is_taken_out_of_the_scan_by_the_rangefinder_alone(
    rangefinder_m: float | None, removed_m: float | None
) -> None:
    """The EKF knows of no hill: what it calls ground may be the top of a house."""
    heights: list[float | None] = []

    class Listening(ObstacleScanner):
        def scan(self, depth_m, attitude, height_m=None, relative_sigma=None) -> ObstacleScan:  # type: ignore[no-untyped-def]
            heights.append(height_m)
            return super().scan(depth_m, attitude, height_m, relative_sigma)

    settings = make_settings("motion.points=false", "scale.height_source=both")
    perception = Perception(settings, HintedDepth(), None, Listening(CAMERA, MOUNT))
    perception.step(frame_at(1.0), at(SECOND, height_m=rangefinder_m, position_ned_m=(0.0, 0.0, -4.0)))
    assert heights == [removed_m]


def test_what_an_autopilot_said_before_it_started_anew_is_forgotten() -> None:
    perception = perception_of(HintedDepth())
    assert perception.step(frame_at(10.0), at(10 * SECOND)).trusted
    blind = at(10 * SECOND + 500 * MS, height_m=None)
    assert perception.step(frame_at(10.5), blind).trusted
    anew = replace(blind, at_ns=10 * SECOND + 600 * MS, epoch=1)
    assert perception.step(frame_at(10.6), anew).trouble is Trouble.NO_HEIGHT


def test_a_height_of_the_future_is_not_held_when_time_steps_back() -> None:
    perception = perception_of(HintedDepth())
    assert perception.step(frame_at(10.0), at(10 * SECOND)).trusted
    assert perception.step(frame_at(9.0), at(9 * SECOND, height_m=None)).trouble is Trouble.NO_HEIGHT


def test_pixels_decide_for_themselves_what_is_unknown() -> None:
    # Doubt that would silence a scale as a whole leaves the sure pixels standing here.
    assert perception_of(HintedDepth(sigma=0.4)).step(frame_at(1.0), at(SECOND)).trusted
    doubtful = perception_of(HintedDepth(sigma=0.6)).step(frame_at(1.0), at(SECOND))
    assert doubtful.trouble is Trouble.NO_DEPTH
    assert np.all(doubtful.scan.state == SectorState.UNKNOWN)


# -- networks from files, through the configuration


def write_hinted_network(path: Path) -> Path:
    """A network that answers with the ground it is told, and 30 m where there is none."""
    width, height, focal_px = 64, 32, 50.0
    card = {
        "card_version": 2,
        "name": "ground",
        "input_width": width,
        "input_height": height,
        "mean": [0, 0, 0],
        "std": [1, 1, 1],
        "output": "inverse_depth",
        "metric": True,
        "uncertainty": True,
        "focal_px": focal_px,
        "max_depth_m": 100.0,
        "hints": ["ground"],
        "output_name": "inverse",
    }
    constants = [
        numpy_helper.from_array(np.array([0], np.int64), "first"),
        numpy_helper.from_array(np.array(0.0, np.float32), "zero"),
        numpy_helper.from_array(np.array(-2.0, np.float32), "sigma"),
        numpy_helper.from_array(
            np.array(CAMERA.fx * width / CAMERA.width / focal_px / 30, np.float32), "far"
        ),
    ]
    nodes = [
        helper.make_node("Gather", ["image", "first"], ["red"], axis=1),
        helper.make_node("Mul", ["red", "zero"], ["nothing"]),
        helper.make_node("Max", ["ground", "far"], ["nearer"]),
        helper.make_node("Add", ["nearer", "nothing"], ["inverse"]),
        helper.make_node("Add", ["nothing", "sigma"], ["log_sigma"]),
    ]
    inputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, height, width])
        for name, channels in (("image", 3), ("ground", 1))
    ]
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 1, height, width])
        for name in ("inverse", "log_sigma")
    ]
    model = helper.make_model(
        helper.make_graph(nodes, "ground", inputs, outputs, constants),
        opset_imports=[helper.make_opsetid("", 17)],
    )
    model.ir_version = 8
    helper.set_model_props(model, {CARD_METADATA_KEY: json.dumps(card)})
    onnx.save(model, str(path))
    return path


def test_a_configured_network_with_hints_measures_in_metres(tmp_path: Path) -> None:
    path = write_hinted_network(tmp_path / "ground.onnx")
    perception = Perception.load(make_settings(f"model.path={path}", "model.provider=cpu"))
    result = perception.step(frame_at(1.0), at(SECOND))
    assert result.trusted
    assert result.depth is not None
    row = CAMERA.height - 1
    down = CAMERA.normalized_rays[row, 0, 1]
    # The network's rows are three of the camera's high.
    assert result.depth.depth_m[row, 0] == pytest.approx(FLYING_HEIGHT_M / down, rel=0.05)
    assert result.depth.depth_m[0, 0] == pytest.approx(30.0, rel=1e-3)
    assert result.scan.state[AHEAD] == SectorState.CLEAR


def test_the_log_says_what_runs_the_network_and_once_why_not_something_faster(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, threads: int | None) -> OpenedSession:
        raise ProviderUnavailableError("it offers no GPU device on this machine")

    for name in ("tensorrt", "cuda", "openvino"):
        is_there = name == "tensorrt"
        changed = replace(PROVIDERS[name], is_installed=lambda is_there=is_there: is_there, open=refuse)
        monkeypatch.setitem(PROVIDERS, name, changed)
    path = write_hinted_network(tmp_path / "ground.onnx")
    with capture_logs() as entries, warnings.catch_warnings():
        warnings.simplefilter("error")
        Perception.load(make_settings(f"model.path={path}"))
    (said,) = (entry for entry in entries if entry["event"] == "network")
    assert (said["name"], said["provider"], said["precision"]) == ("ground", "cpu", "fp32")
    (warned,) = (entry for entry in entries if entry["log_level"] == "warning")
    assert "TensorRT for RTX cannot be used: it offers no GPU" in warned["why"]
