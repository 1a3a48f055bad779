"""The benchmark measures what it names; how fast anything is, no test says."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper
from typer.testing import CliRunner

pytest.importorskip("embreex", reason="the benchmark's pictures need the extra sim")
import typer

from service.benchmark import command
from service.benchmark.machine import machine_name
from service.benchmark.networks import NetworkSpeed, NetworkSpeeds, measure_networks
from service.benchmark.reference import BASELINE, PAPER_NETWORK, ReferenceUnavailableError, write_reference
from service.benchmark.stages import measure_stages
from uavdepth.camera import CameraModel
from uavdepth.model.card import CARD_METADATA_KEY, ModelCard
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.inference import open_session
from uavdepth.model.providers import PROVIDERS


@pytest.fixture(scope="module")
def pictures() -> list[NDArray[np.uint8]]:
    rng = np.random.default_rng(0)
    return [rng.integers(0, 255, (320, 640, 3), dtype=np.uint8) for _ in range(5)]


@pytest.fixture
def only_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("tensorrt", "cuda", "openvino"):
        monkeypatch.setitem(PROVIDERS, name, dataclasses.replace(PROVIDERS[name], is_installed=lambda: False))


def card_of(name: str, width: int, height: int) -> ModelCard:
    return ModelCard(
        card_version=2,
        name=name,
        input_width=width,
        input_height=height,
        mean=(0.0, 0.0, 0.0),
        std=(1.0, 1.0, 1.0),
        output="relative_inverse_depth",
        output_name="y",
    )


def tiny_network(name: str, width: int, height: int, folder: Path) -> tuple[Path, ModelCard]:
    """A network that averages the channels, in place of a reference network."""
    picture = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, height, width])
    depth = helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 1, height, width])
    node = helper.make_node("ReduceMean", ["image"], ["y"], axes=[1], keepdims=1)
    graph = helper.make_graph([node], "mean", [picture], [depth])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    card = card_of(name, width, height)
    helper.set_model_props(model, {CARD_METADATA_KEY: card.to_json()})
    path = folder / f"{name.replace('+', '-')}-{width}.onnx"
    onnx.save(model, str(path))
    return path, card


def test_every_step_is_measured(pictures: list[NDArray[np.uint8]]) -> None:
    times = measure_stages("default", pictures)
    assert all(value > 0 for value in dataclasses.astuple(times))


@pytest.mark.usefixtures("only_cpu")
def test_networks_run_in_turns_each_with_its_own_times(
    pictures: list[NDArray[np.uint8]], tmp_path: Path
) -> None:
    flight = [str(tiny_network(f"flight-{width}", width, 32, tmp_path)[0]) for width in (64, 96)]
    speeds = measure_networks(pictures, 2, names=flight, sizes=((64, 32), (128, 64)), reference=tiny_network)
    assert [(one.name, one.width, one.height) for one in speeds.models] == [
        (flight[0], 64, 32),
        (flight[1], 96, 32),
        (PAPER_NETWORK, 64, 32),
        (PAPER_NETWORK, 128, 64),
    ]
    assert speeds.baseline is not None
    assert [(one.name, one.width, one.provider, one.precision) for one in speeds.baseline] == [
        (BASELINE, 64, "cpu", "fp32"),
        (BASELINE, 128, "cpu", "fp32"),
    ]
    for one in (*speeds.models, *speeds.baseline):
        assert one.fps_median > 0
        assert one.preprocess_ms > 0
        assert one.postprocess_ms > 0
    # Of the two flight models one has a size of the baseline's.
    assert speeds.ratio_to_baseline == {
        "64x32": pytest.approx(speeds.models[0].fps_median / speeds.baseline[0].fps_median, abs=0.01)
    }


def test_a_reference_network_runs_with_the_card_it_comes_with(
    pictures: list[NDArray[np.uint8]], tmp_path: Path
) -> None:
    path, card = write_reference(BASELINE, 96, 64, tmp_path)
    model = DepthModel(open_session(path, "cpu", 1), card, str(path))
    assert np.isfinite(model.infer(pictures[0], CameraModel.from_fov(640, 320, 90)).depth_m).all()


@pytest.mark.usefixtures("only_cpu")
def test_without_torch_there_is_no_baseline_and_the_reason_is_given(
    pictures: list[NDArray[np.uint8]], tmp_path: Path
) -> None:
    def unavailable(name: str, width: int, height: int, folder: Path) -> tuple[Path, ModelCard]:
        raise ReferenceUnavailableError("torch is not installed: pip install 'uavdepth[train]'")

    flight = str(tiny_network("flight", 64, 32, tmp_path)[0])
    speeds = measure_networks(pictures, 1, names=[flight], reference=unavailable)
    assert len(speeds.models) == 1
    assert speeds.baseline is None
    assert speeds.ratio_to_baseline is None
    assert speeds.baseline_reason is not None
    assert "uavdepth[train]" in speeds.baseline_reason


def test_the_command_prints_one_json_object_with_the_fields_it_promises(
    monkeypatch: pytest.MonkeyPatch, pictures: list[NDArray[np.uint8]]
) -> None:
    fast = NetworkSpeed("default", 384, 192, "openvino", "bf16", 150.0, 1.0, 0.5)
    slow = NetworkSpeed(BASELINE, 384, 192, "cpu", "fp32", 10.0, 1.0, 0.5)
    speeds = NetworkSpeeds((fast,), (slow,), None, {"384x192": 15.0})
    monkeypatch.setattr("service.benchmark.pictures.render_pictures", lambda count: pictures)
    monkeypatch.setattr("service.benchmark.networks.measure_networks", lambda *_, **__: speeds)
    app = typer.Typer()
    app.command()(command.benchmark)
    result = json.loads(CliRunner().invoke(app, ["--json", "--networks-only"]).stdout)
    assert result["machine"] == machine_name()
    fields = {
        *("name", "width", "height", "provider", "precision"),
        *("fps_median", "preprocess_ms", "postprocess_ms"),
    }
    assert set(result["models"][0]) == set(result["baseline"][0]) == fields
    assert result["ratio_to_baseline"] == {"384x192": 15.0}
    table = CliRunner().invoke(app, ["--networks-only"]).stdout
    assert "openvino bf16" in table
    assert "fastest shipped network over the baseline, 384x192: 15.0" in table


def test_the_machine_is_named_by_its_processor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("processor : 0\nmodel name\t: Some Processor 9000\n")
    monkeypatch.setattr("service.benchmark.machine.CPU_INFO", info)
    assert machine_name().startswith("Some Processor 9000, ")
    info.unlink()
    assert "cores" in machine_name()
