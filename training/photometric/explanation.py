"""How well depth and motion explain a picture by its neighbours.

Processors use the kernels, everything else torch: both compute the same, and a test holds them together.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from training.photometric.appearance import over_sources, photometric_error
from training.photometric.geometry import warp
from training.photometric.kernel_choice import kernels_for, planes


def unwarped_error(target: Tensor, sources: Tensor, alpha: float, minimum: bool) -> Tensor:
    """(N, 1, H, W) error of the sources as they are. Has no gradient.

    Args:
        target: (N, C, H, W).
        sources: (K, N, C, H, W).
        alpha: share of structure.
        minimum: the best source of each pixel, else the mean.
    """
    kernels = kernels_for(target)
    if kernels is None:
        with torch.no_grad():
            return over_sources(torch.stack([photometric_error(s, target, alpha) for s in sources]), minimum)
    error = torch.empty_like(target[:, 0])
    kernels.unwarped(planes(target), planes(sources), alpha, minimum, error.numpy())
    return error[:, None]


def explained_error(
    target: Tensor,
    sources: Tensor,
    inverse_depth: Tensor,
    motion: Tensor,
    unwarped: Tensor | None,
    alpha: float,
    minimum: bool,
) -> tuple[Tensor, Tensor]:
    """Mean error of the target frame rebuilt from its neighbours.

    Args:
        target: (N, C, H, W).
        sources: (K, N, C, H, W).
        inverse_depth: (N, 1, H, W).
        motion: (K, N, 3, 4), `pixel_motion` of each source.
        unwarped: (N, 1, H, W) error from which on a pixel teaches nothing, or None.
        alpha: share of structure.
        minimum: the best source of each pixel, else the mean.

    Returns:
        The mean over the pixels, scalar, and (N, 1, H, W) bool, True where the pixel teaches. A pixel that
        does not counts with its unwarped error. Only depth and motion get a gradient.
    """
    if kernels_for(target) is not None:
        mean, teaches = _Explained.apply(  # type: ignore[no-untyped-call]
            inverse_depth, motion, target, sources, unwarped, alpha, minimum
        )
        return mean, teaches
    rebuilt = [warp(source, inverse_depth, each) for source, each in zip(sources, motion, strict=True)]
    error = over_sources(torch.stack([photometric_error(one, target, alpha) for one in rebuilt]), minimum)
    if unwarped is None:
        return error.mean(), torch.ones_like(error, dtype=torch.bool)
    return torch.minimum(error, unwarped).mean(), error.detach() < unwarped


class _Explained(torch.autograd.Function):
    """The kernels make the gradient with the value, while all that both need is in the cache."""

    @staticmethod
    def forward(
        ctx: Any,
        inverse_depth: Tensor,
        motion: Tensor,
        target: Tensor,
        sources: Tensor,
        unwarped: Tensor | None,
        alpha: float,
        minimum: bool,
    ) -> tuple[Tensor, Tensor]:
        kernels = kernels_for(target)
        if kernels is None:
            raise RuntimeError("the kernels were chosen but did not load")
        inverse_depth = inverse_depth[:, 0].contiguous()
        teaches = torch.empty_like(inverse_depth, dtype=torch.bool)
        by_inverse_depth = torch.empty_like(inverse_depth)
        by_motion = torch.empty_like(motion, dtype=torch.float64, memory_format=torch.contiguous_format)
        finite = bool(torch.isfinite(inverse_depth).all() and torch.isfinite(motion).all())
        mean = kernels.explained(
            planes(target),
            planes(sources),
            inverse_depth.numpy(),
            planes(motion),
            inverse_depth.numpy() if unwarped is None else planes(unwarped[:, 0]),
            unwarped is not None,
            minimum,
            alpha,
            teaches.numpy(),
            by_inverse_depth.numpy(),
            by_motion.numpy(),
        )
        ctx.save_for_backward(by_inverse_depth[:, None], by_motion.to(motion.dtype))
        teaches = teaches[:, None]
        ctx.mark_non_differentiable(teaches)
        # The kernels read some pixel where nothing says which; that must not pass for a result.
        return target.new_tensor(mean if finite else math.nan), teaches

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, by_mean: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        by_inverse_depth, by_motion = ctx.saved_tensors
        return by_inverse_depth * by_mean, by_motion * by_mean, None, None, None, None, None
