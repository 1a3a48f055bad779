"""The depth network: its shapes, its parts as the method describes them, and its learnable weights."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pytest
import torch

from training.errors import PretrainedWeightsError
from training.networks.aggregation import AggregationGrid, AggregationNode, LightAggregationNode
from training.networks.attention import EfficientChannelAttention, eca_kernel_size
from training.networks.blocks import ConvNormRelu, replicate_border, upsample
from training.networks.decoder import DecoderStage
from training.networks.depth_network import DepthNetwork, NetworkShape
from training.networks.encoder import BATCH_NORM_EPSILON, ENCODER_CHANNELS, Conv, EfficientNetLite0


@pytest.mark.parametrize(
    ("channels", "kernel"),
    [
        (1, 1),
        (8, 3),
        (16, 3),
        (24, 3),
        (32, 3),
        (48, 3),
        (64, 3),
        (96, 3),
        (128, 5),
        (256, 5),
        (512, 5),
        (1024, 5),
    ],
)
def test_the_attention_kernel_is_the_nearest_odd_number_of_the_formula(channels: int, kernel: int) -> None:
    assert eca_kernel_size(channels) == kernel


def test_every_decoder_stage_has_the_kernel_of_its_width() -> None:
    network = DepthNetwork()
    for stage, channels in zip(network.decoder.stages, network.shape.channels, strict=False):
        assert cast(DecoderStage, stage).attention.across_channels.kernel_size == (eca_kernel_size(channels),)


def test_attention_has_no_kernel_for_no_channels() -> None:
    with pytest.raises(ValueError, match="channels is 0"):
        eca_kernel_size(0)


def test_attention_weighs_whole_channels_between_nothing_and_all() -> None:
    torch.manual_seed(1)
    features = torch.randn(2, 32, 4, 6)
    factor = EfficientChannelAttention(32)(features) / features
    assert torch.allclose(factor, factor[..., :1, :1].expand_as(factor), atol=1e-5)
    assert bool(((factor > 0) & (factor < 1)).all())


def test_the_encoder_gives_five_maps_from_half_to_a_thirtysecond() -> None:
    encoder = EfficientNetLite0().eval()
    with torch.no_grad():
        maps = encoder(torch.zeros(1, 3, 64, 96))
    assert [tuple(item.shape) for item in maps] == [
        (1, channels, 64 >> level, 96 >> level) for level, channels in enumerate(ENCODER_CHANNELS, start=1)
    ]


def test_the_frozen_part_gives_the_same_picture_by_picture_and_as_a_batch() -> None:
    torch.manual_seed(2)
    encoder = EfficientNetLite0()
    pictures = torch.randn(3, 3, 64, 64)
    with torch.no_grad():
        one_by_one = encoder.train()(pictures)
        together = encoder.eval()(pictures)
    for a, b in zip(one_by_one, together, strict=True):
        assert torch.allclose(a, b, atol=1e-5)


def test_imagenet_weights_are_loaded_with_their_normalisation_folded_in() -> None:
    from training.networks.encoder import _read_state, packaged_imagenet_path

    encoder = EfficientNetLite0().eval()
    encoder.load_imagenet()
    state = _read_state(packaged_imagenet_path())
    picture = torch.randn(1, 3, 32, 32, generator=torch.Generator().manual_seed(3))
    plain = torch.nn.functional.conv2d(picture, state["_conv_stem.weight"], stride=2, padding=1)
    wanted = torch.nn.functional.batch_norm(
        plain,
        state["_bn0.running_mean"],
        state["_bn0.running_var"],
        state["_bn0.weight"],
        state["_bn0.bias"],
        eps=BATCH_NORM_EPSILON,
    )
    with torch.no_grad():
        # Channels that ImageNet training switched off have a variance of nearly nothing.
        assert torch.allclose(encoder.stem(picture), wanted, rtol=1e-3, atol=1e-3)


def test_depthwise_convolutions_stay_in_single_precision_and_the_others_do_not() -> None:
    """In bfloat16 their way back is 3 to 5 times slower on CPUs."""
    picture = torch.rand(1, 8, 6, 6, dtype=torch.bfloat16, requires_grad=True)
    with torch.autocast("cpu", torch.bfloat16):
        depthwise, full = Conv(8, 8, 3, groups=8)(picture), Conv(8, 8, 3)(picture)
    assert (depthwise.dtype, full.dtype) == (torch.float32, torch.bfloat16)
    depthwise.sum().backward()
    assert picture.grad is not None
    assert bool(picture.grad.abs().sum() > 0)


def test_a_missing_weight_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(PretrainedWeightsError, match=r"nothing\.pth"):
        EfficientNetLite0().load_imagenet(tmp_path / "nothing.pth")


def test_a_weight_file_of_another_network_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.pth"
    torch.save({"_conv_stem.weight": torch.zeros(32, 3, 3, 3)}, path)
    with pytest.raises(PretrainedWeightsError, match="_bn0"):
        EfficientNetLite0().load_imagenet(path)


@pytest.mark.parametrize("node", [AggregationNode, LightAggregationNode])
def test_a_node_fuses_a_map_with_the_next_deeper_one(node: type[torch.nn.Module]) -> None:
    torch.manual_seed(4)
    fuse = node(8, 12).eval()
    level, deeper = torch.randn(1, 8, 8, 12), torch.randn(1, 12, 4, 6)
    fused = fuse(level, deeper)
    assert fused.shape == level.shape
    assert not torch.allclose(fused, fuse(level, deeper + 1.0))
    assert not torch.allclose(fused, fuse(level + 1.0, deeper))


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_a_map_is_enlarged_bilinearly_however_many_channels_it_has(channels: int) -> None:
    features = torch.randn(2, channels, 5, 7, requires_grad=True)
    wanted = torch.nn.functional.interpolate(features, scale_factor=2.0, mode="bilinear", align_corners=False)
    with torch.autocast("cpu", torch.bfloat16):
        enlarged = upsample(features)
    torch.testing.assert_close(enlarged, wanted)
    enlarged.sum().backward()
    assert features.grad is not None
    torch.testing.assert_close(features.grad, torch.full_like(features, 4.0))


def test_the_deepest_map_reaches_the_finest_level_through_the_grid() -> None:
    torch.manual_seed(5)
    grid = AggregationGrid((4, 4, 4), (2, 1, 0)).eval()
    pyramid = [torch.randn(1, 4, 16 >> level, 16 >> level) for level in range(3)]
    before = grid(pyramid)[0]
    pyramid[2] = pyramid[2] + 1.0
    assert not torch.allclose(before, grid(pyramid)[0])


def test_a_level_without_nodes_is_passed_on_unchanged() -> None:
    grid = AggregationGrid((4, 4), (0, 0))
    pyramid = [torch.randn(1, 4, 8, 8), torch.randn(1, 4, 4, 4)]
    assert all(a is b for a, b in zip(grid(pyramid), pyramid, strict=True))


@pytest.mark.parametrize(
    ("channels", "columns", "complaint"),
    [
        ((4, 4, 4), (3, 1, 0), "at most 2"),
        ((4, 4), (1, 1), "nothing deeper"),
        ((4, 4), (1,), "column counts"),
    ],
)
def test_a_grid_that_cannot_be_fed_is_refused(
    channels: tuple[int, ...], columns: tuple[int, ...], complaint: str
) -> None:
    with pytest.raises(ValueError, match=complaint):
        AggregationGrid(channels, columns)


def test_the_network_answers_at_the_size_of_the_picture() -> None:
    network = DepthNetwork().eval()
    with torch.no_grad():
        output = network(torch.zeros(2, 3, 64, 96))
    assert output.log_inverse_depth.shape == output.log_sigma.shape == (2, 1, 64, 96)


def test_gradients_reach_every_weight_that_is_not_frozen() -> None:
    torch.manual_seed(6)
    network = DepthNetwork(NetworkShape(frozen_stages=1)).train()
    # What begins as zero passes no gradient to what lies before it.
    for layer in (*network.hints.second, network.hints.context, network.correction.output):
        torch.nn.init.normal_(cast(torch.nn.Conv2d, layer).weight, std=0.1)
    points = torch.zeros(2, 2, 64, 64)
    points[:, :, 20, 30] = 0.5
    output = network(torch.randn(2, 3, 64, 64), torch.full((2, 1, 64, 64), 0.2), points)
    (output.log_inverse_depth.square().mean() + output.log_sigma.square().mean()).backward()
    for name, parameter in network.named_parameters():
        if parameter.requires_grad:
            assert parameter.grad is not None, name
            assert float(parameter.grad.abs().sum()) > 0, name
        else:
            assert parameter.grad is None, name


def test_frozen_are_the_stem_and_the_first_stages_only() -> None:
    frozen = {
        name.split(".")[1] for name, p in DepthNetwork().encoder.named_parameters() if not p.requires_grad
    }
    assert not any(p.requires_grad for p in DepthNetwork().encoder.stem.parameters())
    trained = [
        index
        for index, stage in enumerate(DepthNetwork().encoder.stages)
        if all(p.requires_grad for p in stage.parameters())
    ]
    assert trained == [3, 4, 5, 6]
    assert frozen


def test_a_uniform_map_stays_uniform_at_the_border() -> None:
    torch.manual_seed(7)
    block = ConvNormRelu(4, 4).eval()
    with torch.no_grad():
        result = block(torch.full((1, 4, 6, 8), 0.7))
    assert torch.allclose(result, result[..., 3:4, 4:5].expand_as(result), atol=1e-6)
    assert replicate_border(torch.zeros(1, 1, 2, 3), 2).shape == (1, 1, 6, 7)
