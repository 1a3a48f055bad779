"""Weights between those of several runs, where one began with the weights of the other or all with the same.

Such networks lie in one valley of the loss: their mean loses little on what each has learnt (Wortsman et al.
2022, "Model soups" and "Robust fine-tuning of zero-shot models"). So pictures of a new look can be learnt
without losing the old ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from training.checkpoint import Checkpoint
from training.errors import CheckpointError


def blend(checkpoints: Sequence[Checkpoint], shares: Sequence[float]) -> Checkpoint:
    """A checkpoint whose weights are the weighted mean of others' averaged weights.

    Its effort is that of all of them together, the rest is the last one's; to train on, begin with it by
    `--init`.

    Args:
        checkpoints: two or more of one network's shape.
        shares: of each, above 0, together 1.

    Raises:
        CheckpointError: fewer than two, shares that are not as said, or networks of different shapes.
    """
    if len(checkpoints) < 2 or len(shares) != len(checkpoints):
        raise CheckpointError(
            f"{len(checkpoints)} checkpoints with {len(shares)} shares: two or more with one each are needed"
        )
    if not all(share > 0 for share in shares) or not math.isclose(math.fsum(shares), 1.0, abs_tol=1e-6):
        raise CheckpointError(f"the shares are {list(shares)}: above 0 and together 1 is needed")
    last = checkpoints[-1]
    for other in checkpoints[:-1]:
        # Which stages a run had frozen changes no weight's shape.
        if (
            replace(other.settings.shape, frozen_stages=last.settings.shape.frozen_stages)
            != last.settings.shape
        ):
            raise CheckpointError(
                f"networks of different shapes have no mean: {other.settings.shape} and {last.settings.shape}"
            )
    weights = {name: _mean([each.average[name] for each in checkpoints], shares) for name in last.average}
    return replace(
        last,
        step=sum(each.step for each in checkpoints),
        images=sum(each.images for each in checkpoints),
        trained_s=math.fsum(each.trained_s for each in checkpoints),
        network=weights,
        average=weights,
    )


def _mean(tensors: Sequence[Tensor], shares: Sequence[float]) -> Tensor:
    """Counters, which are whole numbers, are the last one's."""
    if not tensors[-1].is_floating_point():
        return tensors[-1].clone()
    parts = [tensor.double() * share for tensor, share in zip(tensors, shares, strict=True)]
    return torch.stack(parts).sum(dim=0).to(tensors[-1].dtype)
