"""Quantisation: the 8-bit file of a network, and the rule that it may not cost more than 2 %."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
from frames import ground_frame, make_store
from onnx import numpy_helper
from small_runs import two_steps

from training import quantization
from training.errors import EvaluationError, ExportError
from training.evaluation_frames import EvaluationPlan
from training.export import export_checkpoint
from training.half_weights import SMALLEST_HALVED, restore_single, store_in_half
from training.quantization import quantize
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.int8_file import int8_beside


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A narrow network after two steps."""
    checkpoint = two_steps(tmp_path_factory.mktemp("frames"))
    path = tmp_path_factory.mktemp("network") / "net.onnx"
    export_checkpoint(checkpoint, path, "narrow")
    return path


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    worlds = (("city", 900), ("city", 901), ("city", 1000))
    return make_store(tmp_path_factory.mktemp("worlds"), worlds)


def plan(store: Path, seed: int) -> EvaluationPlan:
    return EvaluationPlan(("city",), (seed,), 3, store)


def operators(path: Path) -> list[str]:
    return [node.op_type for node in onnx.load(str(path)).graph.node]


def test_the_8_bit_file_is_found_beside_its_network_and_says_what_it_cost(network: Path, store: Path) -> None:
    cost = quantize(network, int8_beside(network), plan(store, 900), plan(store, 901), kept=(".correction.",))
    assert set(cost.lost) == {"none", "ground", "ground+100 points"}
    assert all(lost <= quantization.MOST_LOST for lost in cost.lost.values())

    model = DepthModel.load(network, "cpu", 1, precision="int8")
    assert model.precision == "int8"
    said = model.card.measured["int8_against_float"]
    assert said == cost.as_json()
    in_float = DepthModel.load(network, "cpu", 1, precision="float")
    frame = ground_frame()
    near, exact = (one.infer(frame.image_bgr, frame.camera).depth_m for one in (model, in_float))
    assert np.allclose(near, exact, rtol=0.1)
    assert not np.array_equal(near, exact)

    assert "QuantizeLinear" in operators(int8_beside(network))


def test_parts_that_are_kept_compute_as_before(network: Path, store: Path, tmp_path: Path) -> None:
    counts = []
    for name, kept in (("more", ("encoder",)), ("less", ("nothing",))):
        path = tmp_path / f"{name}.onnx"
        quantize(network, path, plan(store, 900), plan(store, 901), kept=kept)
        counts.append(operators(path).count("QuantizeLinear"))
    assert 0 < counts[0] < counts[1]
    with pytest.raises(ExportError, match=r"none of the network's .* convolutions can be converted"):
        quantize(network, tmp_path / "none.onnx", plan(store, 900), plan(store, 901), kept=("",))


def test_a_loss_beyond_the_limit_is_refused_and_an_old_file_stays(
    network: Path, store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "net-int8.onnx"
    path.write_bytes(b"old")
    monkeypatch.setattr(quantization, "MOST_LOST", -1.0)
    with pytest.raises(
        ExportError, match=r"with hints 'none' Abs Rel grows from .* at most -100% is allowed"
    ):
        quantize(network, path, plan(store, 900), plan(store, 901))
    assert path.read_bytes() == b"old"
    assert sorted(item.name for item in tmp_path.iterdir()) == ["net-int8.onnx"]


def test_worlds_of_tests_and_worlds_that_judge_themselves_are_refused(network: Path, store: Path) -> None:
    for ranges, judges in ((1000, 900), (900, 1000)):
        with pytest.raises(EvaluationError, match="seed 1000 is for tests"):
            quantize(network, int8_beside(network), plan(store, ranges), plan(store, judges))
    with pytest.raises(EvaluationError, match="seed 900 gives ranges and judges them"):
        quantize(network, int8_beside(network), plan(store, 900), plan(store, 900))


def test_single_precision_comes_back_from_half() -> None:
    values = np.linspace(-1.0, 1.0, SMALLEST_HALVED, dtype=np.float32).astype(np.float16).astype(np.float32)
    weight = numpy_helper.from_array(values, "weight")
    result = onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, [values.size])
    node = onnx.helper.make_node("Relu", ["weight"], ["y"])
    model = onnx.helper.make_model(onnx.helper.make_graph([node], "relu", [], [result], [weight]))
    store_in_half(model)
    assert model.graph.initializer[0].data_type == onnx.TensorProto.FLOAT16
    restore_single(model)
    assert [item.op_type for item in model.graph.node] == ["Relu"]
    assert model.graph.initializer[0].name == "weight"
    assert np.array_equal(numpy_helper.to_array(model.graph.initializer[0]), values)
