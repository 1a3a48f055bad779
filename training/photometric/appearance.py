"""How much rebuilt pictures differ from the real one (Wei, Ding and Li 2025, equation 9)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from training.photometric.ssim import C1, C2, box_sum, ssim

_PART_VALUES = 1 << 16
"""Values of a picture worked on at a time: the dozen arrays of that size that are live fit a cache."""


def photometric_error(rebuilt: Tensor, target: Tensor, alpha: float) -> Tensor:
    """alpha / 2 (1 - SSIM) + (1 - alpha) |I - J|, mean over the channels: (N, 1, H, W).

    Args:
        rebuilt, target: (N, C, H, W) in 0..1.
        alpha: share of structure, 0 to 1.
    """
    structure = 0.5 * alpha * (1.0 - ssim(rebuilt, target))
    return (structure + (1.0 - alpha) * (rebuilt - target).abs()).mean(dim=1, keepdim=True)


@dataclass(frozen=True)
class Target:
    """The picture x to be rebuilt and all of it that its similarity to any other picture needs.

    Args:
        image: x, (N, C, H, W) in 0..1, as all below.
        doubled: 2 x.
        energy: x^2 + C1 + C2.
        mean_doubled: 2 mu_x.
        mean_energy: mu_x^2 + C1.
    """

    image: Tensor
    doubled: Tensor
    energy: Tensor
    mean_doubled: Tensor
    mean_energy: Tensor

    @classmethod
    def of(cls, image: Tensor) -> Target:
        """Statistics of a picture; no gradient goes to it."""
        image = image.detach().contiguous()
        mean = box_sum(image).mul_(1.0 / 9.0)
        return cls(image, 2.0 * image, image * image + (C1 + C2), 2.0 * mean, mean * mean + C1)

    def parts(self) -> Iterator[tuple[slice, Target]]:
        """The batch in pieces of some pictures each."""
        step = max(1, _PART_VALUES // self.image[0].numel())
        for first in range(0, len(self.image), step):
            part = slice(first, first + step)
            yield (
                part,
                Target(
                    self.image[part],
                    self.doubled[part],
                    self.energy[part],
                    self.mean_doubled[part],
                    self.mean_energy[part],
                ),
            )


def unwarped_error(sources: Sequence[Tensor], target: Target, alpha: float, minimum: bool) -> Tensor:
    """(N, 1, H, W) error of the sources as they are: their minimum, or their mean. Has no gradient."""
    error = torch.empty_like(target.image[:, :1])
    with torch.no_grad():
        for part, picture in target.parts():
            errors = [_Comparison(source[part], picture, alpha).error for source in sources]
            stacked = torch.stack(errors)
            error[part] = stacked.amin(dim=0) if minimum else stacked.mean(dim=0)
    return error


def explained_error(
    rebuilt: Sequence[Tensor], target: Target, unwarped: Tensor | None, alpha: float, minimum: bool
) -> tuple[Tensor, Tensor]:
    """Mean error of a picture that was rebuilt from each source.

    Args:
        rebuilt: for each source (N, C, H, W).
        target: what they should be.
        unwarped: (N, 1, H, W) error at and above which a pixel teaches nothing, or None.
        alpha: share of structure, 0 to 1.
        minimum: take the best source of each pixel, else the mean over sources.

    Returns:
        The mean over the pixels, scalar, and (N, 1, H, W) bool, True where the pixel teaches. A pixel that
        does not counts with its unwarped error.
    """
    mean, teaches = _ExplainedError.apply(target, unwarped, alpha, minimum, *rebuilt)  # type: ignore[no-untyped-call]
    return mean, teaches


class _Comparison:
    """One rebuilt picture y against the target x, and the derivatives of their similarity.

    With B the 3 x 3 mean, T = B(x^2 + y^2) + C1 + C2 and U = B(2 x y) + C1 + C2: n1 = 2 mu_x mu_y + C1,
    n2 = U - n1 (twice the covariance, + C2), d1 = mu_x^2 + mu_y^2 + C1, d2 = T - d1 (the variances, + C2),
    SSIM = n1 n2 / (d1 d2). B is symmetric, borders being repeated, therefore for any weights g
    d(sum g SSIM)/dy = B(g dSSIM/dmu_y) + 2 y B(g dSSIM/dT) + 2 x B(g dSSIM/dU).
    """

    def __init__(self, rebuilt: Tensor, target: Target, alpha: float) -> None:
        self._rebuilt, self._target, self._alpha = rebuilt, target, alpha
        self._mean = box_sum(rebuilt).mul_(1.0 / 9.0)
        energy = box_sum(torch.addcmul(target.energy, rebuilt, rebuilt)).mul_(1.0 / 9.0)
        product = box_sum((target.doubled * rebuilt).add_(C1 + C2)).mul_(1.0 / 9.0)
        self._n1 = (target.mean_doubled * self._mean).add_(C1)
        self._n2 = product.sub_(self._n1)
        self._d1 = torch.addcmul(target.mean_energy, self._mean, self._mean)
        self._d2 = energy.sub_(self._d1)
        self._inverse = (self._d1 * self._d2).reciprocal_()
        self._by_product = self._n1 * self._inverse
        self._similarity = self._by_product * self._n2
        self._difference = rebuilt - target.image
        error = self._difference.abs().mul_(1.0 - alpha).sub_(self._similarity, alpha=0.5 * alpha)
        self.error = error.mean(dim=1, keepdim=True).add_(0.5 * alpha)

    def gradient(self, weight: Tensor) -> Tensor:
        """Derivative of sum(weight * error) by the rebuilt picture; called once, it uses up its arrays.

        Args:
            weight: (N, 1, H, W).
        """
        channels = self._rebuilt.shape[1]
        structure = weight * (-0.5 * self._alpha / (9.0 * channels))
        by_energy = self._similarity / self._d2  # the negative of it
        by_mean = self._n2.sub_(self._n1).mul_(self._inverse).mul_(self._target.mean_doubled)
        by_mean.addcmul_(self._similarity.div_(self._d1).neg_().add_(by_energy), self._mean, value=2.0)
        gradient = box_sum(by_mean.mul_(structure))
        gradient.addcmul_(box_sum(by_energy.mul_(structure)), self._rebuilt, value=-2.0)
        gradient.addcmul_(box_sum(self._by_product.mul_(structure)), self._target.doubled)
        gradient.addcmul_(self._difference.sign_(), weight, value=(1.0 - self._alpha) / channels)
        return gradient


class _ExplainedError(torch.autograd.Function):
    """The error with its gradient, computed while all that both need is still in the cache.

    Autograd would make three times the passes, each over memory: this is the most expensive part of the loss.
    """

    @staticmethod
    def forward(
        ctx: Any, target: Target, unwarped: Tensor | None, alpha: float, minimum: bool, *rebuilt: Tensor
    ) -> tuple[Tensor, Tensor]:
        wanted = any(ctx.needs_input_grad[4:])
        gradients = [torch.empty_like(picture) for picture in rebuilt] if wanted else []
        teaches = torch.ones_like(target.image[:, :1])
        total = target.image.new_zeros(())
        share = 1.0 / teaches.numel()
        for part, picture in target.parts():
            comparisons = [_Comparison(source[part], picture, alpha) for source in rebuilt]
            errors = torch.stack([comparison.error for comparison in comparisons])
            error = errors.amin(dim=0) if minimum else errors.mean(dim=0)
            # Masks are kept as 0.0 and 1.0: they multiply, and mixing in bools takes torch off its fast path.
            weight = teaches[part]
            if unwarped is not None:
                torch.lt(error, unwarped[part], out=weight)
            if wanted:
                chosen = errors.eq_(error).mul_(weight) if minimum else weight.expand_as(errors)
                chosen = chosen * (share if minimum else share / len(rebuilt))
                for comparison, gradient, by_error in zip(comparisons, gradients, chosen, strict=True):
                    gradient[part] = comparison.gradient(by_error)
            total += (error if unwarped is None else torch.minimum(error, unwarped[part])).sum()
        teaches = teaches.bool()
        ctx.save_for_backward(*gradients)
        ctx.mark_non_differentiable(teaches)
        return total.mul_(share), teaches

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, by_mean: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        return (None, None, None, None, *(gradient * by_mean for gradient in ctx.saved_tensors))
