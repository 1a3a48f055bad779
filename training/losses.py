"""What the network is taught by: exact depth, in logarithms.

The output is log inverse depth, so a difference e = output - truth is a relative error of depth, and a wrong
overall scale of a picture is a constant added to e.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import torch
from torch import Tensor
from torch.nn import functional

from training.data.batches import Batch
from training.networks.depth_network import DepthOutput
from training.normalization import FOCAL_REFERENCE_PX

NEAR_TRUTH_M = 20.0
"""Depth within which obstacles count most: a vehicle at 10 m/s needs that much to stop."""

THIN_SPAN_M = (40.0, 200.0)
"""Depth up to which a thin thing counts in full, and from which on like anything else. Where the weight
falls, what is not sure of its distance is told too near: that must not be where a scan looks."""

FAR_UNCERTAINTY = 0.35
"""Relative error that sky counts with when sigma is taught: "at least 200 m" is no distance, and this is how
uncertain a network may well be that is sure of the sky."""

THIN_SHARE = 1.0 / 55.0
"""Of the picture's width: what is narrower, or lower, is thin. 7 pixels of 384."""

THIN_RATIO = 1.25
"""What is behind a thin thing is farther by this at the least."""

_SMALLEST_ERROR = 2e-3


@dataclass(frozen=True)
class LossWeights:
    """Weight of each term and of the pixels within them.

    Args:
        absolute, shape, edges, sigma: of the terms.
        uncorrected: of the prediction before the points corrected it.
        far: of a pixel of sky within the terms that use them.
        near: of a pixel nearer than `NEAR_TRUTH_M`; others count 1.
        thin: times the above, of a pixel of a pole, wire, twig or railing: one pixel in a hundred, and most
            of the scan's missed elements. A network that is not sure whether a pixel is of the twig or of
            the wood behind has to choose the twig. It falls to 1 along `THIN_SPAN_M`.
        hinted: of a picture with any hint in the absolute terms; one without counts 1, because its metres
            can only be guessed.
        sigma_quantile: share of errors that are to be below sigma: 0.683 as for a normal distribution, and
            a little, because errors on worlds that were never seen are larger.
    """

    absolute: float = 0.5
    shape: float = 1.0
    edges: float = 0.5
    sigma: float = 0.2
    uncorrected: float = 0.2
    far: float = 0.2
    near: float = 1.5
    thin: float = 8.0
    hinted: float = 2.0
    sigma_quantile: float = 0.70


@dataclass(frozen=True)
class LossTerms:
    """The terms of one batch, unweighted, and their weighted sum."""

    absolute: Tensor
    shape: Tensor
    edges: Tensor
    sigma: Tensor
    uncorrected: Tensor
    total: Tensor

    def detached(self) -> LossTerms:
        """The numbers alone: a log that keeps them must not keep what they were computed from."""
        return LossTerms(*(getattr(self, field.name).detach() for field in fields(self)))


def depth_loss(output: DepthOutput, batch: Batch, weights: LossWeights) -> LossTerms:
    """Loss of a batch; each term is a mean over the pixels that it uses."""
    near = ~batch.far
    pixels = pixel_weights(batch, weights)
    metric = pixels * hinted_weights(batch, weights.hinted)
    error = _error(output.log_inverse_depth, batch)
    aligned = error - image_median(error.detach(), near)
    absolute = absolute_term(error, metric)
    uncorrected = absolute_term(_error(output.uncorrected, batch), metric)
    shape = absolute_term(aligned, torch.where(near, pixels, 0.0))
    edges = edge_term(error, near)
    sigma = sigma_term(output.log_sigma, error.detach(), batch.far, weights)
    total = (
        weights.absolute * absolute
        + weights.uncorrected * uncorrected
        + weights.shape * shape
        + weights.edges * edges
        + weights.sigma * sigma
    )
    return LossTerms(absolute, shape, edges, sigma, uncorrected, total)


def pixel_weights(batch: Batch, weights: LossWeights) -> Tensor:
    """(N, 1, H, W) how much each pixel counts."""
    depth_m = torch.exp(-batch.log_inverse_depth) * (batch.focal_px / FOCAL_REFERENCE_PX)[:, None, None, None]
    near = torch.where(depth_m < NEAR_TRUTH_M, weights.near, 1.0)
    full_m, end_m = THIN_SPAN_M
    nearness = (torch.log(end_m / depth_m) / math.log(end_m / full_m)).clamp(0.0, 1.0)
    thin = torch.where(thin_things(batch.log_inverse_depth), weights.thin**nearness, 1.0)
    return torch.where(batch.far, weights.far, near * thin)


def thin_things(log_inverse_depth: Tensor) -> Tensor:
    """(N, 1, H, W) bool: pixels of what is narrower or lower than `THIN_SHARE` and before something farther.

    What is left over by a grey opening of log inverse depth (Serra 1982), along rows or along columns.
    """
    size = 2 * max(1, round(0.5 * THIN_SHARE * log_inverse_depth.shape[-1])) + 1
    behind = torch.minimum(_opened(log_inverse_depth, (1, size)), _opened(log_inverse_depth, (size, 1)))
    return log_inverse_depth > behind + math.log(THIN_RATIO)


def _opened(values: Tensor, kernel: tuple[int, int]) -> Tensor:
    """The largest of the least values within a kernel of odd size."""
    edges = (kernel[0] // 2, kernel[1] // 2)
    least = -functional.max_pool2d(-values, kernel, 1, edges)
    return functional.max_pool2d(least, kernel, 1, edges)


def hinted_weights(batch: Batch, hinted: float) -> Tensor:
    """(N, 1, 1, 1) `hinted` for pictures that came with a hint, 1 for others."""
    anything = batch.ground.flatten(1).amax(dim=1) + batch.points.flatten(1).amax(dim=1)
    return torch.where(anything > 0, hinted, 1.0)[:, None, None, None]


def absolute_term(error: Tensor, weight: Tensor) -> Tensor:
    """Weighted mean of |e|, 0 without weight."""
    return (error.abs() * weight).sum() / weight.sum().clamp_min(1e-6)


def image_median(error: Tensor, near: Tensor) -> Tensor:
    """(N, 1, 1, 1) median of e over the near pixels of each picture: its overall scale error, in logarithms.

    A picture without near pixels gives 0.
    """
    hidden = torch.where(near, error, torch.nan).flatten(1)
    # A few thousand pixels fix a median; sorting all of them would cost more than the rest of the loss.
    return torch.nan_to_num(hidden[:, ::7].nanmedian(dim=1).values)[:, None, None, None]


def edge_term(error: Tensor, near: Tensor) -> Tensor:
    """Mean difference of e between pixels 1, 2, 4 and 8 apart: edges where the truth has them, only there.

    Li and Snavely 2018 (MegaDepth), equation 4, with strides instead of resized maps.
    """
    terms = []
    for stride in (1, 2, 4, 8):
        across = (error[..., :, stride:] - error[..., :, :-stride]).abs()
        down = (error[..., stride:, :] - error[..., :-stride, :]).abs()
        terms.append(masked_mean(across, near[..., :, stride:] & near[..., :, :-stride]))
        terms.append(masked_mean(down, near[..., stride:, :] & near[..., :-stride, :]))
    return torch.stack(terms).mean()


def sigma_term(log_sigma: Tensor, error: Tensor, far: Tensor, weights: LossWeights) -> Tensor:
    """Quantile loss of log |e|: least where `sigma_quantile` of the errors are below sigma.

    A likelihood would assume how errors are distributed, and calibration would depend on it; a quantile is
    what calibration means, and it is the same of |e| and of its logarithm, in which near and far errors pull
    alike (Koenker and Bassett 1978, equation 3.1).

    Args:
        log_sigma: (N, 1, H, W) as the network says it.
        error: (N, 1, H, W) of the depth as given, without gradient.
        far: (N, 1, H, W) bool sky, whose errors count as `FAR_UNCERTAINTY` at least.
        weights: of a run.
    """
    size = torch.where(far, error.abs().clamp_min(FAR_UNCERTAINTY), error.abs().clamp_min(_SMALLEST_ERROR))
    excess = torch.log(size) - log_sigma
    loss = torch.maximum(weights.sigma_quantile * excess, (weights.sigma_quantile - 1.0) * excess)
    return absolute_term(loss, torch.where(far, weights.far, 1.0))


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean over the pixels of a mask, 0 if it is empty."""
    return torch.where(mask, values, 0.0).sum() / mask.sum().clamp_min(1)


def _error(log_inverse_depth: Tensor, batch: Batch) -> Tensor:
    """Difference to the truth; sky is at least as far as the largest depth, so only nearer is wrong."""
    error = log_inverse_depth - batch.log_inverse_depth
    return torch.where(batch.far, error.clamp_min(0.0), error)
