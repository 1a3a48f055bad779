"""The flight network with hints: without them it works, with them it knows metres."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from training.data.batches import Batch
from training.losses import LossWeights, depth_loss
from training.networks.depth_network import INITIAL_RELATIVE_SIGMA, DepthNetwork, NetworkShape
from training.normalization import FOCAL_REFERENCE_PX

NARROW = NetworkShape(
    channels=(8, 8, 8, 8, 8),
    head_channels=8,
    frozen_stages=6,
    hint_channels=(4, 4, 4, 4, 4),
    correction_channels=8,
)


def points_of(log_inverse_depth: Tensor, every: int = 9) -> Tensor:
    """(N, 2, H, W) sure points on a lattice."""
    points = torch.zeros(len(log_inverse_depth), 2, *log_inverse_depth.shape[-2:])
    lattice = (slice(None), slice(every // 2, None, every), slice(every // 2, None, every))
    points[:, 0][lattice] = torch.exp(log_inverse_depth[:, 0])[lattice]
    points[:, 1] = (points[:, 0] > 0) * 0.9
    return points


def test_the_flight_network_keeps_to_its_budget() -> None:
    network = DepthNetwork().eval()
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network(torch.zeros(1, 3, 64, 128))
    assert sum(parameter.numel() for parameter in network.parameters()) <= 6e6
    # The counter takes the convolutions, multiplications and additions apart; the rest is about 1 % of them.
    larger = (640 * 320) / (128 * 64)
    assert counter.get_total_flops() * larger <= 0.95 * 8e9


def test_planes_of_zeros_are_no_hint() -> None:
    torch.manual_seed(1)
    network = DepthNetwork(NARROW).eval()
    picture = torch.randn(2, 3, 64, 96)
    with torch.no_grad():
        bare = network(picture)
        empty = network(picture, torch.zeros(2, 1, 64, 96), torch.zeros(2, 2, 64, 96))
    assert torch.equal(bare.log_inverse_depth, empty.log_inverse_depth)
    assert torch.equal(bare.log_sigma, empty.log_sigma)
    assert bare.log_inverse_depth.shape == bare.log_sigma.shape == (2, 1, 64, 96)
    assert bool(torch.isfinite(bare.log_inverse_depth).all())


def test_an_untrained_network_follows_the_points_and_else_its_own_guess() -> None:
    torch.manual_seed(2)
    network = DepthNetwork(NARROW).eval()
    picture, wanted = torch.randn(1, 3, 64, 96), torch.full((1, 1, 64, 96), -3.5)
    with torch.no_grad():
        bare = network(picture)
        hinted = network(picture, None, points_of(wanted))
    assert torch.equal(bare.log_inverse_depth, bare.uncorrected)
    assert float((hinted.log_inverse_depth - wanted).abs().max()) < 0.1
    assert float((bare.log_inverse_depth - wanted).abs().min()) > 1.0
    assert float(bare.log_sigma.mean()) == pytest.approx(math.log(INITIAL_RELATIVE_SIGMA), abs=1e-4)


def test_points_of_another_picture_of_the_batch_change_nothing() -> None:
    torch.manual_seed(3)
    network = DepthNetwork(NARROW).eval()
    picture, points = torch.randn(2, 3, 64, 64), torch.zeros(2, 2, 64, 64)
    points[1, :, 30, 30] = 0.9
    with torch.no_grad():
        bare, hinted = network(picture), network(picture, None, points)
    assert torch.allclose(bare.log_inverse_depth[0], hinted.log_inverse_depth[0], atol=1e-6)
    assert not torch.allclose(bare.log_inverse_depth[1], hinted.log_inverse_depth[1], atol=1e-2)


def test_with_points_and_ground_a_few_steps_teach_more_than_without() -> None:
    """Pictures of noise tell nothing: only hints can say how deep they are."""

    def error_after(hinted: bool) -> float:
        torch.manual_seed(4)
        network = DepthNetwork(NARROW).train()
        trained = [parameter for parameter in network.parameters() if parameter.requires_grad]
        optimizer = torch.optim.Adam(trained, lr=3e-3)
        errors = []
        for _ in range(16):
            levels = -3.0 + torch.randn(2, 1, 1, 1)
            truth = (levels + torch.linspace(-0.5, 0.5, 64)[:, None]).expand(2, 1, 64, 64).contiguous()
            points = points_of(truth + 0.05 * torch.randn_like(truth)) * float(hinted)
            ground = torch.exp(truth) * (torch.arange(64) >= 32)[:, None] * float(hinted)
            focal = torch.full((2,), FOCAL_REFERENCE_PX)
            far = torch.zeros_like(truth, dtype=torch.bool)
            batch = Batch(torch.randn(2, 3, 64, 64), truth, far, ground, points, focal)
            terms = depth_loss(network(batch.image, ground, points), batch, LossWeights())
            optimizer.zero_grad()
            terms.total.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            errors.append(float(terms.absolute.detach()))
        return sum(errors[-5:]) / 5

    with_hints, without = error_after(True), error_after(False)
    assert with_hints < 0.2 * without
