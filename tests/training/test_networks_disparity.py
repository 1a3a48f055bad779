"""The self-supervised depth networks: baselines, the paper's network and its ablation."""

from __future__ import annotations

from itertools import pairwise
from typing import cast

import pytest
import torch
from torch import Tensor, nn

from training.errors import TrainingSettingsError
from training.networks.attention import EfficientChannelAttention
from training.networks.catalogue import ENCODER_NAMES, NETWORK_NAMES, PROPOSED, build_network
from training.networks.disparity import DisparityNetwork, disparity_to_depth
from training.networks.hr_depth import FeatureFusion, HRDepth, NestedNode
from training.networks.paper_network import FusionStage, PaperNetwork
from training.networks.pose_network import PoseNetwork
from training.networks.squeeze_excitation import SqueezeExcitation
from uavdepth.errors import ImageSizeError

LITE = "efficientnet-lite0"
ALL = [(name, "resnet18") for name in NETWORK_NAMES] + [("bl", LITE), (PROPOSED, LITE)]


@pytest.mark.parametrize(("name", "encoder"), ALL)
@pytest.mark.parametrize(("width", "height"), [(64, 64), (128, 96), (96, 128), (384, 192), (640, 320)])
def test_four_disparities_each_half_the_size_of_the_one_before(
    name: str, encoder: str, width: int, height: int
) -> None:
    with torch.device("meta"):
        disparities = build_network(name, encoder, pretrained=False)(torch.empty(2, 3, height, width))
    assert [tuple(item.shape) for item in disparities] == [
        (2, 1, height >> scale, width >> scale) for scale in range(4)
    ]


@pytest.mark.parametrize(("name", "encoder"), ALL)
def test_the_loss_of_every_scale_together_reaches_every_parameter(name: str, encoder: str) -> None:
    torch.manual_seed(2)
    network = build_network(name, encoder).train()
    picture = torch.rand(2, 3, 64, 96).contiguous(memory_format=torch.channels_last)
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    disparities = network(picture)
    assert all(bool(((item > 0) & (item < 1)).all()) for item in disparities)
    sum(((item - torch.rand_like(item)) ** 2).mean() for item in disparities).backward()
    _assert_gradients_everywhere(network)


def test_the_loss_of_a_pose_reaches_every_parameter() -> None:
    torch.manual_seed(3)
    network = PoseNetwork().train()
    pose = network(torch.rand(2, 3, 64, 96), torch.rand(2, 3, 64, 96))
    (pose**2).sum().backward()
    _assert_gradients_everywhere(network)


@pytest.mark.parametrize("name", NETWORK_NAMES)
def test_the_decoder_draws_no_stripe_along_the_border(name: str) -> None:
    torch.manual_seed(4)
    network = build_network(name).eval()
    channels = (64, 64, 128, 256, 512)
    pyramid = [
        torch.rand(1, width, 1, 1).expand(1, width, 96 >> level, 128 >> level)
        for level, width in enumerate(channels, start=1)
    ]
    with torch.no_grad():
        maps = network.decode(pyramid)
        disparities = [head(item) for head, item in zip(network.heads, maps, strict=True)]
    for item in disparities:
        assert torch.allclose(item, item[..., :1, :1].expand_as(item), atol=1e-5)


@pytest.mark.parametrize("name", NETWORK_NAMES)
def test_every_scale_sees_the_coarsest_map_and_every_encoder_map_matters(name: str) -> None:
    torch.manual_seed(5)
    network = build_network(name).eval()
    with torch.no_grad():
        pyramid = network.encoder(torch.rand(1, 3, 64, 96))
        before = network.decode(pyramid)
        for level in range(5):
            changed = list(pyramid)
            changed[level] = pyramid[level] + 1.0
            after = network.decode(changed)
            # The map at 1/2 says nothing to the stages at 1/4 and 1/8, the one at 1/4 nothing to 1/8.
            for scale in range(max(level, 1) + 1 if level < 3 else 4):
                assert not torch.allclose(before[scale], after[scale]), (level, scale)


@pytest.mark.parametrize("encoder", ENCODER_NAMES)
def test_all_variants_begin_with_the_same_encoder_after_the_same_seed(encoder: str) -> None:
    states = []
    for name in NETWORK_NAMES if encoder == "resnet18" else ("bl", PROPOSED):
        torch.manual_seed(6)
        states.append(build_network(name, encoder).encoder.state_dict())
    for state in states[1:]:
        assert all(torch.equal(value, states[0][key]) for key, value in state.items())


def test_the_ablation_only_adds() -> None:
    names = [set(build_network(name).state_dict()) for name in NETWORK_NAMES[2:]]
    plain, aggregated, squeezed, efficient = names
    assert {name.split(".")[0] for name in aggregated - plain} == {"aggregation"}
    for attended in (squeezed, efficient):
        assert {name.split(".")[2] for name in attended - aggregated} == {"attention"}
    assert all(smaller < larger for smaller, larger in pairwise((plain, aggregated, squeezed)))


def test_attention_sits_in_every_stage_with_the_kernel_of_its_width() -> None:
    stages = [cast(FusionStage, stage) for stage in _paper_network(PROPOSED).stages]
    kernels = {
        stage.fuse.norm.num_features: cast(
            EfficientChannelAttention, stage.attention
        ).across_channels.kernel_size[0]
        for stage in stages
    }
    assert kernels == {16: 3, 32: 3, 64: 3, 128: 5, 256: 5}


def test_squeeze_and_excitation_weighs_whole_channels_by_all_channels() -> None:
    torch.manual_seed(7)
    attention = SqueezeExcitation(32)
    features = torch.rand(2, 32, 4, 6) + 0.1
    factor = attention(features) / features
    assert torch.allclose(factor, factor[..., :1, :1].expand_as(factor), atol=1e-5)
    assert bool(((factor > 0) & (factor < 1)).all())
    features[:, 0] += 5.0
    assert bool((attention(features) / features != factor)[:, 31].any())


@pytest.mark.parametrize(("channels", "hidden"), [(16, 4), (64, 4), (128, 8), (512, 32)])
def test_squeezing_leaves_a_sixteenth_but_at_least_four(channels: int, hidden: int) -> None:
    assert SqueezeExcitation(channels).squeeze.out_features == hidden


def test_nodes_give_the_decoder_their_levels_sizes_and_widths() -> None:
    aggregation = _paper_network("bl+fan").aggregation
    assert aggregation is not None
    pyramid = [torch.rand(1, c, 64 >> i, 96 >> i) for i, c in enumerate((64, 64, 128, 256, 512))]
    with torch.no_grad():
        maps = aggregation.eval()(pyramid)
    assert [tuple(item.shape[1:]) for item in maps] == [
        (16, 64, 96),
        (32, 32, 48),
        (64, 16, 24),
        (128, 8, 12),
    ]


def test_hr_depth_has_the_full_triangle_with_fusion_on_its_edge_only() -> None:
    levels = cast(HRDepth, build_network("hr-depth")).levels
    rows = [[cast(NestedNode, node).fuse for node in cast(nn.ModuleList, row)] for row in levels]
    assert [len(row) for row in rows] == [4, 3, 2, 1]
    for row in rows:
        assert isinstance(row[-1], FeatureFusion)
        assert not any(isinstance(fuse, FeatureFusion) for fuse in row[:-1])
        # More than two maps meet from the second column on: these are reduced before the 3x3 convolution.
        assert all(isinstance(fuse, nn.Sequential) for fuse in row[1:-1])


@pytest.mark.parametrize(
    ("disparity", "depth_m"), [(0.0, 100.0), (1.0, 0.1), (0.5, 1.0 / 5.005), (0.0990991, 1.0)]
)
def test_inverse_depth_runs_linearly_between_its_limits(disparity: float, depth_m: float) -> None:
    assert disparity_to_depth(torch.tensor(disparity)).item() == pytest.approx(depth_m, rel=1e-5)


@pytest.mark.parametrize(("low", "high"), [(0.0, 100.0), (-1.0, 1.0), (2.0, 2.0), (5.0, 1.0)])
def test_depths_that_do_not_rise_are_refused(low: float, high: float) -> None:
    with pytest.raises(ValueError, match="0 < min < max"):
        disparity_to_depth(torch.tensor(0.5), low, high)


@pytest.mark.parametrize(
    ("width", "height", "value"), [(100, 64, 100), (128, 90, 90), (32, 64, 32), (64, 0, 0)]
)
def test_a_picture_of_an_impossible_size_is_refused(width: int, height: int, value: int) -> None:
    with torch.device("meta"), pytest.raises(ImageSizeError, match=f"is {value}: a multiple of 32 from 64"):
        build_network("bl")(torch.empty(1, 3, height, width))


@pytest.mark.parametrize(
    ("name", "encoder", "complaint"),
    [
        ("monodepth3", "resnet18", "no network 'monodepth3': one of monodepth2, hr-depth, bl,"),
        ("bl", "vgg", "no encoder 'vgg': one of resnet18, efficientnet-lite0"),
        ("hr-depth", LITE, "hr-depth has the encoder resnet18, not efficientnet-lite0"),
    ],
)
def test_what_there_is_not_cannot_be_built(name: str, encoder: str, complaint: str) -> None:
    with pytest.raises(TrainingSettingsError, match=complaint):
        build_network(name, encoder)


def test_a_pose_starts_small_and_knows_which_frame_came_first() -> None:
    torch.manual_seed(8)
    network = PoseNetwork().eval()
    first, second = torch.rand(3, 3, 96, 128), torch.rand(3, 3, 96, 128)
    with torch.no_grad():
        forth, back = network(first, second), network(second, first)
    assert forth.shape == (3, 6)
    assert forth.abs().max().item() < 0.1
    assert not torch.allclose(forth, back)


def _paper_network(name: str) -> PaperNetwork:
    return cast(PaperNetwork, build_network(name))


def _assert_gradients_everywhere(network: DisparityNetwork | PoseNetwork) -> None:
    gradients: dict[str, Tensor | None] = {
        name: parameter.grad for name, parameter in network.named_parameters() if parameter.requires_grad
    }
    assert gradients
    unreached = [
        name
        for name, gradient in gradients.items()
        if gradient is None or not bool(torch.isfinite(gradient).all()) or not bool(gradient.any())
    ]
    assert unreached == []
