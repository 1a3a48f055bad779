"""A network that flies, trained on: it computes what its file does, its normalisations know pictures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import onnx
import pytest
import torch
from small_runs import SMALL, one_size, run_to_end, two_steps

from training.data.batches import Batch, BatchRequest, BatchSource, FramePool
from training.errors import CheckpointError
from training.export import export_checkpoint
from training.exported_weights import take_exported
from training.networks.blocks import ConvNormRelu
from training.networks.depth_network import DepthNetwork, DepthOutput, NetworkShape
from training.networks.hint_levels import hint_levels as training_levels
from training.trainer import Trainer
from uavdepth.model.hint_levels import hint_levels
from uavdepth.model.int8_file import SOURCE_METADATA_KEY
from uavdepth.model.point_pixels import PointPixels


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "network.onnx"
    export_checkpoint(two_steps(tmp_path_factory.mktemp("frames")), path, "narrow", size=(96, 64))
    return path


def batches(pool: FramePool, count: int = 3) -> Iterator[Batch]:
    source = BatchSource(pool, seed=3)
    return (source.make(BatchRequest(number, 4, 96, 64)) for number in range(count))


def said(network: DepthNetwork, batch: Batch) -> DepthOutput:
    with torch.no_grad():
        output: DepthOutput = network(batch.image, batch.ground, batch.points)
    return output


def test_it_computes_what_the_file_does(exported: Path, pool: FramePool) -> None:
    import onnxruntime

    network = DepthNetwork(SMALL)
    taken = take_exported(exported, network, batches(pool))
    trained = sum(value.numel() for value in network.parameters())
    # What is folded has a bias where the network has a gain and an offset.
    gains = sum(block.norm.num_features for block in network.modules() if isinstance(block, ConvNormRelu))
    assert taken == trained - gains
    session = onnxruntime.InferenceSession(str(exported), providers=["CPUExecutionProvider"])
    batch = next(batches(pool, 1))
    with torch.no_grad():
        output = network.eval().at_half_size(batch.image, training_levels(batch.ground, batch.points))
    for index in range(len(batch.image)):
        one = slice(index, index + 1)
        points = PointPixels.of_planes(batch.points[index].numpy())
        depth, sigma = session.run(
            ["log_inverse_depth", "log_sigma"],
            {
                "image": batch.image[one].permute(0, 2, 3, 1).contiguous().numpy(),
                **hint_levels(batch.ground[index, 0].numpy(), points),
            },
        )
        assert torch.allclose(output.log_inverse_depth[one], torch.from_numpy(depth), atol=1e-4)
        assert torch.allclose(output.log_sigma[one], torch.from_numpy(sigma), atol=1e-4)


def test_its_normalisations_have_the_statistics_of_pictures(exported: Path, pool: FramePool) -> None:
    """So the first steps of training compute what flight does: on the pictures of the statistics exactly."""
    network = DepthNetwork(SMALL)
    take_exported(exported, network, batches(pool, 1))
    batch = next(batches(pool, 1))
    flown = said(network.eval(), batch).log_inverse_depth
    assert torch.allclose(said(network.train(), batch).log_inverse_depth, flown, atol=1e-3)


def test_a_run_begins_with_it(exported: Path, pool: FramePool) -> None:
    trainer = Trainer(one_size(), pool, pretrained=False)
    taken = trainer.start_from(exported)
    assert taken > 0
    batch = next(batches(pool, 1))
    flown = DepthNetwork(SMALL)
    take_exported(exported, flown, batches(pool))
    averaged = trainer.checkpoint().averaged_network()
    begun = said(averaged, batch).log_inverse_depth
    assert torch.allclose(begun, said(flown.eval(), batch).log_inverse_depth, atol=1e-4)
    assert len(run_to_end(trainer)) == 2


def test_another_network_s_export_is_refused_by_what_does_not_fit(exported: Path, pool: FramePool) -> None:
    wider = NetworkShape(channels=(8, 8, 8, 8, 8), frozen_stages=6)
    with pytest.raises(
        CheckpointError, match=r"network\.onnx is not an export of this network: .* does not fit"
    ):
        take_exported(exported, DepthNetwork(wider), batches(pool))


def test_an_export_that_lacks_a_layer_is_refused_by_its_name(
    exported: Path, pool: FramePool, tmp_path: Path
) -> None:
    model = onnx.load(str(exported))
    for constant in model.graph.initializer:
        if constant.name.endswith("laterals.2.convolution.bias"):
            constant.name = "another"
    onnx.save(model, str(tmp_path / "lacking.onnx"))
    with pytest.raises(CheckpointError, match=r"lacking\.onnx is not an export of this network.*laterals\.2"):
        take_exported(tmp_path / "lacking.onnx", DepthNetwork(SMALL), batches(pool))


def test_an_8_bit_file_is_refused_by_what_it_is(exported: Path, pool: FramePool, tmp_path: Path) -> None:
    model = onnx.load(str(exported))
    onnx.helper.set_model_props(model, {SOURCE_METADATA_KEY: "the digest of another file"})
    onnx.save(model, str(tmp_path / "small.onnx"))
    with pytest.raises(CheckpointError, match=r"small\.onnx is an 8-bit file: name the network"):
        take_exported(tmp_path / "small.onnx", DepthNetwork(SMALL), batches(pool))


def test_what_is_no_network_is_refused(pool: FramePool, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"no network at .*missing\.onnx"):
        take_exported(tmp_path / "missing.onnx", DepthNetwork(SMALL), batches(pool))
    (tmp_path / "text.onnx").write_text("no protocol buffer")
    with pytest.raises(CheckpointError, match=r"text\.onnx is no ONNX file"):
        take_exported(tmp_path / "text.onnx", DepthNetwork(SMALL), batches(pool))
