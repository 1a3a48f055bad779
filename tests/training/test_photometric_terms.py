"""The parts of the photometric loss, each against its definition."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from training.photometric import transform_from_pose
from training.photometric.appearance import over_sources, photometric_error
from training.photometric.explanation import explained_error, unwarped_error
from training.photometric.geometry import pixel_motion
from training.photometric.kernel_choice import kernels_for
from training.photometric.smoothness import smoothness
from training.photometric.ssim import ssim
from training.photometric.upsampling import upsample

ALPHA = 0.85


def noise(*shape: int, seed: int = 0) -> Tensor:
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def ssim_by_definition(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W): means, variances and covariance of each 3 x 3 window, one after the other."""
    padded = [np.pad(picture, 1, mode="edge") for picture in (first, second)]
    result = np.empty_like(first)
    for i, j in np.ndindex(first.shape):
        x, y = (picture[i : i + 3, j : j + 3].ravel() for picture in padded)
        covariance = np.mean((x - x.mean()) * (y - y.mean()))
        result[i, j] = (
            (2 * x.mean() * y.mean() + 0.01**2)
            * (2 * covariance + 0.03**2)
            / ((x.mean() ** 2 + y.mean() ** 2 + 0.01**2) * (x.var() + y.var() + 0.03**2))
        )
    return result


def test_similarity_is_that_of_the_definition() -> None:
    first, second = noise(1, 1, 7, 9, seed=1), noise(1, 1, 7, 9, seed=2)
    expected = ssim_by_definition(first[0, 0].numpy(), second[0, 0].numpy())
    np.testing.assert_allclose(ssim(first, second)[0, 0].numpy(), expected, atol=1e-12)


def test_a_picture_is_entirely_similar_to_itself() -> None:
    picture = noise(2, 3, 8, 8)
    torch.testing.assert_close(ssim(picture, picture), torch.ones_like(picture))
    assert float(photometric_error(picture, picture, ALPHA).abs().max()) < 1e-12


def test_similarity_does_not_mind_the_order_and_is_at_most_one() -> None:
    first, second = noise(1, 3, 8, 8, seed=3), noise(1, 3, 8, 8, seed=4)
    torch.testing.assert_close(ssim(first, second), ssim(second, first))
    assert float(ssim(first, second).abs().max()) < 1.0


def test_the_error_is_85_parts_structure_and_15_parts_difference() -> None:
    """On constant pictures the structure term knows brightness only."""
    dark = torch.full((1, 3, 4, 4), 0.2, dtype=torch.float64)
    bright = torch.full_like(dark, 0.6)
    similarity = (2 * 0.2 * 0.6 + 1e-4) / (0.2**2 + 0.6**2 + 1e-4)
    expected = 0.85 / 2 * (1 - similarity) + 0.15 * 0.4
    error = photometric_error(dark, bright, ALPHA)
    torch.testing.assert_close(error, torch.full_like(error, expected))


@pytest.mark.parametrize("size", [(6, 8), (3, 4), (12, 16), (24, 32)])
def test_up_sampling_is_bilinear_interpolation(size: tuple[int, int]) -> None:
    small = noise(2, 1, *size)
    expected = torch.nn.functional.interpolate(small, (24, 32), mode="bilinear", align_corners=False)
    torch.testing.assert_close(upsample(small, 24, 32), expected)


def test_what_validation_prepared_serves_training_too() -> None:
    with torch.inference_mode():
        upsample(torch.rand(1, 1, 5, 7), 10, 14)
    small = torch.rand(1, 1, 5, 7, requires_grad=True)
    upsample(small, 10, 14).sum().backward()  # type: ignore[no-untyped-call]
    torch.testing.assert_close(small.grad, torch.full_like(small, 4.0))


class TestSmoothness:
    def test_a_flat_disparity_is_perfectly_smooth(self) -> None:
        assert float(smoothness(torch.full((2, 1, 8, 8), 0.3), torch.rand(2, 3, 8, 8))) == 0.0

    def test_a_step_costs_less_where_the_picture_has_one_too(self) -> None:
        disparity, picture = torch.full((1, 1, 8, 8), 0.2), torch.zeros(1, 3, 8, 8)
        disparity[..., 4:] = picture[..., 4:] = 0.6
        elsewhere = picture.roll(2, dims=3)
        at_edge, off_edge = float(smoothness(disparity, picture)), float(smoothness(disparity, elsewhere))
        assert at_edge == pytest.approx(off_edge * math.exp(-0.6), rel=1e-5)

    def test_its_value_is_that_of_equation_10(self) -> None:
        disparity, picture = torch.full((1, 1, 4, 6), 0.2), torch.zeros(1, 3, 4, 6)
        disparity[..., 3:] = 0.6
        # One of five steps across, of (0.6 - 0.2) / 0.4, none down.
        assert float(smoothness(disparity, picture)) == pytest.approx(1.0 / 5.0)

    def test_halving_all_disparities_does_not_make_them_smoother(self) -> None:
        disparity, picture = noise(2, 1, 8, 8).float(), torch.rand(2, 3, 8, 8)
        assert float(smoothness(disparity, picture)) == pytest.approx(
            float(smoothness(disparity / 2, picture)), rel=1e-5
        )

    def test_kernels_and_torch_agree(self) -> None:
        picture = noise(2, 3, 9, 11, seed=1)
        values, slopes = [], []
        for dtype in (torch.float32, torch.float64):
            disparity = noise(2, 1, 9, 11).to(dtype).requires_grad_()
            value = smoothness(disparity, picture.to(dtype))
            value.backward()  # type: ignore[no-untyped-call]
            assert disparity.grad is not None
            values.append(value.detach().double())
            slopes.append(disparity.grad.double())
        torch.testing.assert_close(*values, rtol=1e-5, atol=0)
        torch.testing.assert_close(*slopes, rtol=1e-4, atol=1e-7)


def explain(
    dtype: torch.dtype, masked: bool, minimum: bool, sources: int, size: tuple[int, int]
) -> list[Tensor]:
    """Value, mask and gradients by depth and pose of a small made-up batch."""
    height, width = size
    target, neighbours = noise(2, 3, height, width).to(dtype), noise(sources, 2, 3, height, width).to(dtype)
    inverse_depth = (noise(2, 1, height, width, seed=1) + 0.05).to(dtype).requires_grad_()
    pose = (0.6 * noise(sources, 2, 6, seed=2) - 0.3).to(dtype).requires_grad_()
    camera = torch.tensor([[9.0, 0.0, 6.0], [0.0, 8.0, 5.0], [0.0, 0.0, 1.0]], dtype=dtype).expand(2, 3, 3)
    motion = torch.stack([pixel_motion(camera, transform_from_pose(each)) for each in pose])
    limit = unwarped_error(target, neighbours, ALPHA, minimum) if masked else None
    mean, teaches = explained_error(target, neighbours, inverse_depth, motion, limit, ALPHA, minimum)
    mean.backward()  # type: ignore[no-untyped-call]
    assert inverse_depth.grad is not None
    assert pose.grad is not None
    return [mean.detach().double(), teaches.double(), inverse_depth.grad.double(), pose.grad.double()]


@pytest.mark.parametrize(
    ("masked", "minimum", "sources", "size"),
    [*itertools.product((False, True), (False, True), (1, 2, 3), ((11, 14),)), (True, True, 2, (2, 2))],
)
def test_the_kernels_compute_what_autograd_does(
    masked: bool, minimum: bool, sources: int, size: tuple[int, int]
) -> None:
    """Single precision goes through the kernels, double through torch."""
    assert kernels_for(torch.zeros(1)) is not None
    assert kernels_for(torch.zeros(1, dtype=torch.float64)) is None
    by_kernels = explain(torch.float32, masked, minimum, sources, size)
    by_torch = explain(torch.float64, masked, minimum, sources, size)
    for ours, theirs in zip(by_kernels, by_torch, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-4, atol=2e-6)


def test_the_kernels_read_pictures_in_any_memory_order() -> None:
    target, sources = noise(2, 3, 8, 8).float(), noise(2, 2, 3, 8, 8).float()
    expected = unwarped_error(target, sources, ALPHA, True)
    interleaved = target.contiguous(memory_format=torch.channels_last)
    swapped = sources.transpose(3, 4).contiguous().transpose(3, 4)
    assert torch.equal(unwarped_error(interleaved, swapped, ALPHA, True), expected)


@pytest.mark.parametrize("broken", ["depth", "motion"])
def test_a_network_that_answers_nan_gets_a_loss_of_nan(broken: str) -> None:
    """And no pixel is read from outside the picture on the way there."""
    picture = noise(1, 3, 8, 8).float()
    inverse_depth, motion = torch.ones(1, 1, 8, 8), torch.eye(3, 4)[None, None].clone()
    if broken == "depth":
        inverse_depth[0, 0, 3, 3] = math.nan
    else:
        motion[...] = math.nan
    mean, _ = explained_error(picture, picture[None], inverse_depth, motion, None, ALPHA, True)
    assert math.isnan(float(mean))


def test_several_sources_give_their_best_or_their_mean() -> None:
    errors = torch.tensor([[0.1, 0.5], [0.3, 0.2]])
    torch.testing.assert_close(over_sources(errors, minimum=True), torch.tensor([0.1, 0.2]))
    torch.testing.assert_close(over_sources(errors, minimum=False), torch.tensor([0.2, 0.35]))
