"""The loss of self-supervised training (Wei, Ding and Li 2025, equations 8 to 10; Godard et al. 2019)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F  # noqa: N812 (torch's own convention)
from torch import Tensor

from training.errors import PhotometricSettingsError, PhotometricShapeError
from training.photometric.explanation import explained_error, unwarped_error
from training.photometric.geometry import check_pair, pixel_motion
from training.photometric.smoothness import smoothness
from training.photometric.upsampling import upsample

TIE = 1e-4
"""A warped source must beat the unwarped one by this much; rounding makes 3e-5 in flat, bright pictures."""


@dataclass(frozen=True)
class PhotometricSettings:
    """Weights and parts of the loss.

    Args:
        alpha: share of structural similarity in the photometric error, 0 to 1.
        smoothness: lambda of equation 8; 0.04 in the paper, 0.001 in Monodepth2.
        minimum: the best source of each pixel counts, not the mean over sources.
        auto_mask: pixels that the unwarped sources already explain teach nothing.
        min_depth_m, max_depth_m: depth at disparity 1 and 0.
    """

    alpha: float = 0.85
    smoothness: float = 0.04
    minimum: bool = True
    auto_mask: bool = True
    min_depth_m: float = 0.1
    max_depth_m: float = 100.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.alpha <= 1.0:
            raise PhotometricSettingsError(f"alpha is {self.alpha}: 0 to 1 is needed")
        if not self.smoothness >= 0.0:
            raise PhotometricSettingsError(f"smoothness is {self.smoothness}: 0 or above is needed")
        if not 0.0 < self.min_depth_m < self.max_depth_m:
            raise PhotometricSettingsError(
                f"min_depth_m is {self.min_depth_m} and max_depth_m is {self.max_depth_m}: "
                "0 < min_depth_m < max_depth_m is needed"
            )


@dataclass(frozen=True)
class PhotometricTerms:
    """The loss of a batch, each term a scalar and the mean over the scales.

    Args:
        total: reprojection + weight * smoothness.
        reprojection: photometric error of the rebuilt pictures.
        smoothness: already divided by 2^s at scale s, not yet weighted.
        auto_mask: (N, 1, H, W) bool of the finest scale, True where the pixel teaches.
    """

    total: Tensor
    reprojection: Tensor
    smoothness: Tensor
    auto_mask: Tensor


def photometric_loss(
    disparities: Sequence[Tensor],
    target: Tensor,
    sources: Sequence[Tensor],
    intrinsics: Tensor,
    source_from_target: Sequence[Tensor],
    settings: PhotometricSettings,
) -> PhotometricTerms:
    """How badly depth and motion explain the target frame by its neighbours.

    Each scale's disparity is up-sampled to the full resolution first and rebuilds the full picture. The
    smoothness of scale s, computed at its own size, has the weight 1 / 2^s, as in Monodepth2. A masked pixel
    counts with the error of the unwarped source, a constant, so that the loss never falls by masking more.

    Args:
        disparities: sigmoid outputs, finest first, scale s of shape (N, 1, H / 2^s, W / 2^s).
        target: (N, 3, H, W) RGB in 0..1.
        sources: neighbouring frames, each like `target`.
        intrinsics: (N, 3, 3) in pixels of `target`.
        source_from_target: for each source (N, 4, 4), takes points of the target camera into the source's.

    Raises:
        PhotometricShapeError: no disparity, no source, or shapes that do not belong together.
    """
    _check_shapes(disparities, target, sources, intrinsics, source_from_target)
    height, width = target.shape[-2:]
    with torch.autocast(target.device.type, enabled=False):
        target = target.detach().float().contiguous()
        neighbours = torch.stack([source.detach().float() for source in sources]).contiguous()
        motion = torch.stack([pixel_motion(intrinsics, each).float() for each in source_from_target])
        unwarped = None
        if settings.auto_mask:
            unwarped = unwarped_error(target, neighbours, settings.alpha, settings.minimum) - TIE
        nearest, farthest = 1.0 / settings.min_depth_m, 1.0 / settings.max_depth_m
        reprojection, smooth = target.new_zeros(()), target.new_zeros(())
        masks = []
        picture = target
        for scale, output in enumerate(disparities):
            disparity = output.float()
            picture = picture if scale == 0 else F.avg_pool2d(picture, 2)
            smooth = smooth + smoothness(disparity, picture) / 2**scale
            inverse_depth = farthest + (nearest - farthest) * upsample(disparity, height, width)
            error, mask = explained_error(
                target, neighbours, inverse_depth, motion, unwarped, settings.alpha, settings.minimum
            )
            reprojection = reprojection + error
            masks.append(mask)
        reprojection = reprojection / len(disparities)
        smooth = smooth / len(disparities)
        total = reprojection + settings.smoothness * smooth
    return PhotometricTerms(total, reprojection, smooth, masks[0])


def _check_shapes(
    disparities: Sequence[Tensor],
    target: Tensor,
    sources: Sequence[Tensor],
    intrinsics: Tensor,
    source_from_target: Sequence[Tensor],
) -> None:
    if not disparities or not sources or len(sources) != len(source_from_target):
        raise PhotometricShapeError(
            f"{len(disparities)} disparities, {len(sources)} sources, {len(source_from_target)} transforms: "
            "at least one disparity, one source, and a transform for each source are needed"
        )
    for transform in source_from_target:
        check_pair(target, intrinsics, transform)
    for number, source in enumerate(sources):
        if source.shape != target.shape:
            raise PhotometricShapeError(
                f"source {number} has the shape {tuple(source.shape)}, the target {tuple(target.shape)}"
            )
    batch, _, height, width = target.shape
    for scale, disparity in enumerate(disparities):
        expected = (batch, 1, height >> scale, width >> scale)
        if tuple(disparity.shape) != expected:
            raise PhotometricShapeError(
                f"disparity of scale {scale} has the shape {tuple(disparity.shape)}, "
                f"for a target of {tuple(target.shape)} {expected} is needed"
            )
