"""The loss: what it must not see, and what it must punish."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from training.data.batches import Batch
from training.losses import (
    FAR_UNCERTAINTY,
    NEAR_TRUTH_M,
    THIN_SPAN_M,
    LossWeights,
    absolute_term,
    depth_loss,
    edge_term,
    hinted_weights,
    image_median,
    masked_mean,
    pixel_weights,
    sigma_term,
    thin_things,
)
from training.networks.depth_network import DepthOutput
from training.normalization import FOCAL_REFERENCE_PX


def batch_of(truth: Tensor, far: Tensor | None = None, focal_px: float = FOCAL_REFERENCE_PX) -> Batch:
    return Batch(
        torch.zeros(len(truth), 3, 1, 1),
        truth,
        torch.zeros_like(truth, dtype=torch.bool) if far is None else far,
        ground=torch.zeros_like(truth),
        points=torch.zeros_like(truth).repeat(1, 2, 1, 1),
        focal_px=torch.full((len(truth),), focal_px),
    )


@pytest.fixture
def truth() -> Tensor:
    return torch.randn(2, 1, 16, 24, generator=torch.Generator().manual_seed(1))


def output_of(log_inverse_depth: Tensor) -> DepthOutput:
    return DepthOutput(log_inverse_depth, torch.zeros_like(log_inverse_depth), log_inverse_depth)


def test_the_truth_itself_costs_nothing_but_the_sigma(truth: Tensor) -> None:
    terms = depth_loss(output_of(truth.clone()), batch_of(truth), LossWeights())
    assert float(terms.absolute) == float(terms.shape) == float(terms.edges) == 0.0


def test_a_wrong_scale_of_the_whole_picture_costs_metres_only(truth: Tensor) -> None:
    scale = torch.tensor([math.log(2.0), math.log(0.5)])[:, None, None, None]
    terms = depth_loss(output_of(truth + scale), batch_of(truth), LossWeights())
    assert float(terms.absolute) == pytest.approx(math.log(2.0), rel=1e-5)
    assert float(terms.shape) == pytest.approx(0.0, abs=1e-6)
    assert float(terms.edges) == pytest.approx(0.0, abs=1e-6)


def test_a_wrong_shape_costs_more_than_its_median_explains(truth: Tensor) -> None:
    error = torch.zeros_like(truth)
    error[..., :8, :] = 0.4
    terms = depth_loss(output_of(truth + error), batch_of(truth), LossWeights())
    assert float(terms.shape) > 0.1
    assert float(terms.edges) > 0.0


def test_sky_may_be_as_far_as_it_likes_but_not_near() -> None:
    truth = torch.zeros(1, 1, 8, 8)
    sky = torch.ones(1, 1, 8, 8, dtype=torch.bool)
    sky[..., 4:, :] = False
    farther, nearer = truth.clone(), truth.clone()
    farther[sky], nearer[sky] = -3.0, 3.0
    assert float(depth_loss(output_of(farther), batch_of(truth, sky), LossWeights()).absolute) == 0.0
    assert float(depth_loss(output_of(nearer), batch_of(truth, sky), LossWeights()).absolute) > 0.1


def test_sky_counts_less_and_what_is_near_more() -> None:
    depth_m = torch.tensor([NEAR_TRUTH_M / 2, NEAR_TRUTH_M * 2, 200.0])
    sky = torch.tensor([False, False, True])[None, None, None]
    # Seen with twice the reference's focal length a pixel's inverse depth is twice as large.
    truth = torch.log(2.0 / depth_m)[None, None, None]
    batch = batch_of(truth, sky, 2.0 * FOCAL_REFERENCE_PX)
    assert pixel_weights(batch, LossWeights(near=1.5, thin=1.0, far=0.2)).flatten().tolist() == pytest.approx(
        [1.5, 1.0, 0.2]
    )


def test_poles_and_wires_are_thin_and_walls_and_ground_are_not() -> None:
    depth_m = torch.full((192, 384), 18.0)
    depth_m[120:] = (144.0 / torch.arange(1.0, 73.0)).clamp_max(18.0)[:, None]  # the ground
    depth_m[:60, 200:] = 200.0  # the sky
    depth_m[:120, 40:43] = 6.0  # a pole
    depth_m[30:32, 200:] = 9.0  # a wire before the sky
    depth_m[20:100, 100:150] = 8.0  # a wall
    thin = thin_things(-torch.log(depth_m)[None, None])[0, 0]
    expected = torch.zeros_like(thin)
    expected[:120, 40:43] = True
    expected[30:32, 200:] = True
    assert torch.equal(thin, expected)


def test_thin_is_a_share_of_the_picture() -> None:
    depth_m = torch.full((64, 640), 18.0)
    depth_m[:, 100:110] = 6.0
    truth = -torch.log(depth_m)[None, None]
    assert int(thin_things(truth).sum()) == 64 * 10
    assert not thin_things(truth[..., :384]).any()


def test_what_is_thin_and_near_counts_most() -> None:
    depth_m = torch.full((64, 128), 19.0)
    depth_m[:, 20] = 5.0
    depth_m[:, 80:] = 290.0
    depth_m[:, 100] = THIN_SPAN_M[0]
    depth_m[:, 110] = math.sqrt(math.prod(THIN_SPAN_M))
    depth_m[:, 125] = 210.0
    truth = torch.log(1.0 / depth_m)[None, None]
    sky = torch.zeros_like(truth, dtype=torch.bool)
    weight = pixel_weights(batch_of(truth, sky), LossWeights(near=1.5, thin=8.0))[0, 0, 0]
    assert weight[[10, 20, 90]].tolist() == pytest.approx([1.5, 12.0, 1.0])
    # It does not end where a scan looks, or what is thin would be told too near: half its power half way.
    assert weight[[100, 110, 125]].tolist() == pytest.approx([8.0, math.sqrt(8.0), 1.0], rel=1e-3)


def test_metres_count_more_where_a_hint_tells_them(truth: Tensor) -> None:
    batch = batch_of(truth)
    batch.points[1, :, 3, 3] = 0.5
    assert hinted_weights(batch, 2.0).flatten().tolist() == [1.0, 2.0]
    batch.ground[0, :, 3, 3] = 0.5
    assert hinted_weights(batch, 2.0).flatten().tolist() == [2.0, 2.0]


def test_a_weighted_mean_is_that_of_the_error_without_its_sign() -> None:
    error, weight = torch.tensor([1.0, -3.0]), torch.tensor([1.0, 0.5])
    assert float(absolute_term(error, weight)) == pytest.approx((1.0 + 0.5 * 3.0) / 1.5)


def test_edges_between_sky_and_the_world_are_left_to_the_other_terms() -> None:
    error = torch.zeros(1, 1, 4, 16)
    error[..., 8:] = 5.0
    near = torch.ones_like(error, dtype=torch.bool)
    assert float(edge_term(error, near)) > 0.1
    near[..., 8:] = False
    assert float(edge_term(error, near)) == 0.0


def test_the_median_ignores_the_sky() -> None:
    error = torch.full((1, 1, 10, 21), 0.25)
    error[..., :5, :] = 9.0
    near = torch.ones_like(error, dtype=torch.bool)
    near[..., :5, :] = False
    assert float(image_median(error, near)) == pytest.approx(0.25)


def test_a_picture_of_sky_alone_has_a_finite_loss_and_gradient() -> None:
    prediction = torch.zeros(1, 1, 8, 8, requires_grad=True)
    sky = torch.ones(1, 1, 8, 8, dtype=torch.bool)
    terms = depth_loss(output_of(prediction), batch_of(torch.full((1, 1, 8, 8), -5.0), sky), LossWeights())
    terms.total.backward()  # type: ignore[no-untyped-call]
    assert math.isfinite(float(terms.total.detach()))
    assert prediction.grad is not None
    assert bool(torch.isfinite(prediction.grad).all())


@pytest.mark.parametrize("kind", ["normal", "laplace", "heavy"])
def test_the_cheapest_sigma_is_the_quantile_of_the_error_whatever_its_distribution(kind: str) -> None:
    random = torch.Generator().manual_seed(2)
    normal = torch.randn(1, 1, 200, 200, generator=random)
    spread = torch.rand(1, 1, 200, 200, generator=random)
    error = {"normal": normal, "laplace": normal * (-torch.log(spread)).sqrt(), "heavy": normal / spread}[
        kind
    ]
    error = 0.1 * error
    none = torch.zeros_like(error, dtype=torch.bool)
    weights = LossWeights(sigma_quantile=0.68)
    wanted = math.log(float(error.abs().flatten().quantile(0.68)))
    costs = {
        shift: float(sigma_term(torch.full_like(error, wanted + shift), error, none, weights))
        for shift in (-0.1, 0.0, 0.1)
    }
    assert costs[0.0] < min(costs[-0.1], costs[0.1])


def test_sky_is_taught_to_be_uncertain_even_where_it_is_right() -> None:
    error, sky = torch.zeros(1, 1, 4, 4), torch.ones(1, 1, 4, 4, dtype=torch.bool)
    costs = {
        sigma: float(sigma_term(torch.full_like(error, math.log(sigma)), error, sky, LossWeights()))
        for sigma in (0.01, FAR_UNCERTAINTY, 3.0)
    }
    assert costs[FAR_UNCERTAINTY] < min(costs[0.01], costs[3.0])


def test_the_uncertainty_does_not_pull_at_the_depth(truth: Tensor) -> None:
    prediction = (truth + 0.1 * torch.randn_like(truth)).requires_grad_()
    sigma = torch.zeros_like(truth, requires_grad=True)
    depth_loss(DepthOutput(prediction, sigma, prediction), batch_of(truth), LossWeights()).sigma.backward()  # type: ignore[no-untyped-call]
    assert prediction.grad is None
    assert sigma.grad is not None


def test_the_mean_over_nothing_is_nothing() -> None:
    assert float(masked_mean(torch.ones(3), torch.zeros(3, dtype=torch.bool))) == 0.0


def test_logged_terms_keep_nothing_alive(truth: Tensor) -> None:
    prediction = truth.clone().requires_grad_()
    terms = depth_loss(output_of(prediction), batch_of(truth), LossWeights())
    assert terms.total.requires_grad
    assert not terms.detached().total.requires_grad
