"""What the network is taught by: exact depth, in logarithms.

The output is log inverse depth, so a difference e = output - truth is a relative error of depth, and a wrong
overall scale of a picture is a constant added to e.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from training.data.batches import Batch
from training.networks.depth_network import DepthOutput

_LAPLACE_SIGMA_LOG = 0.5 * math.log(2.0)
"""log of sigma / b: a Laplace distribution of scale b has the standard deviation sqrt(2) b."""


@dataclass(frozen=True)
class LossWeights:
    """Weight of each term; `far` weighs pixels of sky within the terms that use them."""

    absolute: float = 0.5
    shape: float = 1.0
    edges: float = 0.5
    sigma: float = 0.05
    far: float = 0.2


@dataclass(frozen=True)
class LossTerms:
    """The terms of one batch, unweighted, and their weighted sum."""

    absolute: Tensor
    shape: Tensor
    edges: Tensor
    sigma: Tensor
    total: Tensor

    def detached(self) -> LossTerms:
        """The numbers alone: a log that keeps them must not keep what they were computed from."""
        return LossTerms(*(getattr(self, field.name).detach() for field in fields(self)))


def depth_loss(output: DepthOutput, batch: Batch, weights: LossWeights) -> LossTerms:
    """Loss of a batch; each term is a mean over the pixels that it uses."""
    near = ~batch.far
    error = output.log_inverse_depth - batch.log_inverse_depth
    # Sky is at least as far as the largest depth: only a nearer answer is wrong.
    error = torch.where(batch.far, error.clamp_min(0.0), error)
    aligned = error - image_median(error.detach(), near)
    absolute = absolute_term(error, near, weights.far)
    shape = masked_mean(aligned.abs(), near)
    edges = edge_term(error, near)
    sigma = sigma_term(output.log_sigma, aligned.detach(), near)
    total = (
        weights.absolute * absolute + weights.shape * shape + weights.edges * edges + weights.sigma * sigma
    )
    return LossTerms(absolute, shape, edges, sigma, total)


def absolute_term(error: Tensor, near: Tensor, far_weight: float) -> Tensor:
    """Mean |e|, pixels of the sky counted by `far_weight`."""
    weight = torch.where(near, 1.0, far_weight)
    return (error.abs() * weight).sum() / weight.sum()


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


def sigma_term(log_sigma: Tensor, aligned: Tensor, near: Tensor) -> Tensor:
    """Laplace negative log likelihood of the error that is left once the picture's scale is known."""
    log_b = log_sigma - _LAPLACE_SIGMA_LOG
    return masked_mean(aligned.abs() * torch.exp(-log_b) + log_b, near)


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean over the pixels of a mask, 0 if it is empty."""
    return torch.where(mask, values, 0.0).sum() / mask.sum().clamp_min(1)
