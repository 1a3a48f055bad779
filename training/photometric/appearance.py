"""How much two pictures differ, pixel by pixel (Wei, Ding and Li 2025, equation 9)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from training.photometric.ssim import C1, C2, box_sum


@dataclass(frozen=True)
class Target:
    """The picture to be rebuilt and all of it that its similarity to any other picture needs.

    Args:
        image: (N, C, H, W) in 0..1, as are all below.
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


def photometric_error(rebuilt: Tensor, target: Target, alpha: float) -> Tensor:
    """alpha / 2 (1 - SSIM) + (1 - alpha) |I - J|, mean over the channels: (N, 1, H, W).

    Args:
        rebuilt: (N, C, H, W) in 0..1.
        target: the picture it should be; gets no gradient.
        alpha: share of structure, 0 to 1.
    """
    error: Tensor = _PhotometricError.apply(rebuilt, target, alpha)  # type: ignore[no-untyped-call]
    return error


class _PhotometricError(torch.autograd.Function):
    """The formula and its derivative by hand: a third of the passes over memory that autograd would make.

    With y the rebuilt picture, B the 3 x 3 mean, T = B(x^2 + y^2) + C1 + C2 and U = B(2 x y) + C1 + C2:
    n1 = 2 mu_x mu_y + C1, n2 = U - n1 (twice the covariance + C2), d1 = mu_x^2 + mu_y^2 + C1,
    d2 = T - d1 (the variances + C2), SSIM = n1 n2 / (d1 d2). B is symmetric (borders repeated), therefore
    dSSIM/dy = B(g dSSIM/dmu_y) + 2 y B(g dSSIM/dT) + 2 x B(g dSSIM/dU).
    """

    @staticmethod
    def forward(ctx: Any, rebuilt: Tensor, target: Target, alpha: float) -> Tensor:
        mean = box_sum(rebuilt).mul_(1.0 / 9.0)
        energy = box_sum(torch.addcmul(target.energy, rebuilt, rebuilt)).mul_(1.0 / 9.0)
        product = box_sum((target.doubled * rebuilt).add_(C1 + C2)).mul_(1.0 / 9.0)
        n1 = (target.mean_doubled * mean).add_(C1)
        n2 = product.sub_(n1)
        d1 = torch.addcmul(target.mean_energy, mean, mean)
        d2 = energy.sub_(d1)
        inverse = (d1 * d2).reciprocal_()
        by_product = n1 * inverse
        similarity = by_product * n2
        difference = rebuilt - target.image
        if ctx.needs_input_grad[0]:
            by_energy = similarity / d2  # negative of it
            by_mean = (n2 - n1).mul_(inverse).mul_(target.mean_doubled)
            by_mean.addcmul_(by_energy - similarity / d1, mean, value=2.0)
            ctx.save_for_backward(rebuilt, by_product, by_energy, by_mean, difference.sign())
            ctx.target, ctx.alpha = target, alpha
        error = difference.abs_().mul_(1.0 - alpha).sub_(similarity, alpha=0.5 * alpha)
        return error.mean(dim=1, keepdim=True).add_(0.5 * alpha)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        rebuilt, by_product, by_energy, by_mean, sign = ctx.saved_tensors
        target: Target = ctx.target
        gradient = gradient / rebuilt.shape[1]
        structure = gradient * (-0.5 * ctx.alpha / 9.0)
        total = box_sum(by_mean * structure)
        total.addcmul_(box_sum(by_energy * structure), rebuilt, value=-2.0)
        total.addcmul_(box_sum(by_product * structure), target.doubled)
        total.addcmul_(sign, gradient, value=1.0 - ctx.alpha)
        return total, None, None
