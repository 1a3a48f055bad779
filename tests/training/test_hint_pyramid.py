"""Points between the points: what pooling keeps, what filling makes of gaps, and what outliers cannot do."""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from training.networks.hint_correction import point_corrections
from training.networks.hint_pyramid import (
    WeightedLevel,
    fill,
    hint_pyramid,
    pooled,
    robust_weights,
)
from uavdepth.model.hint_levels import LEVELS

SIZE = (64, 96)


def points_at(q: Tensor, every: int = 7, confidence: float = 0.8) -> Tensor:
    """(1, 2, H, W) points on a lattice of a map of q."""
    planes = torch.zeros(1, 2, *q.shape[-2:])
    planes[0, 0, every // 2 :: every, every // 2 :: every] = q[every // 2 :: every, every // 2 :: every]
    planes[0, 1] = (planes[0, 0] > 0) * confidence
    return planes


def no_ground() -> Tensor:
    return torch.zeros(1, 1, *SIZE)


def corrections(prediction: Tensor, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    finest = hint_pyramid(no_ground(), points).points[0]
    return point_corrections(prediction, finest.mean, finest.weight)


def slope() -> Tensor:
    """q that rises tenfold from the top to the bottom, as on ground ahead."""
    return torch.logspace(-2.0, -1.0, SIZE[0])[:, None].expand(SIZE)


def test_weights_and_values_of_all_points_add_up_at_every_level() -> None:
    points = points_at(slope())
    total = float((points[0, 1] * torch.log(points[0, 0].clamp_min(1e-4))).sum())
    pyramid = hint_pyramid(no_ground(), points)
    assert len(pyramid.points) == LEVELS
    for level in pyramid.points:
        assert float(level.weight.sum()) == pytest.approx(float(points[0, 1].sum()), rel=1e-5)
        assert float(level.total.sum()) == pytest.approx(total, rel=1e-5)


def test_the_grounds_share_of_a_cell_is_between_nothing_and_all() -> None:
    ground = no_ground()
    ground[..., SIZE[0] // 2 :, :] = 0.3
    for level in hint_pyramid(ground, torch.zeros(1, 2, *SIZE)).ground:
        assert float(level.weight.min()) == 0.0
        assert float(level.weight.max()) == 1.0
        assert level.mean[level.weight > 0].tolist() == pytest.approx(
            [math.log(0.3)] * int((level.weight > 0).sum()), rel=1e-4
        )


def test_no_points_fill_to_nothing() -> None:
    empty = hint_pyramid(no_ground(), torch.zeros(1, 2, *SIZE)).points
    assert all(float(level.abs().max()) == 0.0 for level in fill(empty))


def test_one_point_tells_the_whole_picture() -> None:
    points = torch.zeros(1, 2, *SIZE)
    points[0, :, 20, 30] = torch.tensor([0.05, 0.9])
    for level in fill(hint_pyramid(no_ground(), points).points):
        assert level.flatten().tolist() == pytest.approx([math.log(0.05)] * level.numel(), rel=1e-2)


def test_between_points_of_a_slope_lies_the_slope() -> None:
    wanted = torch.log(slope()[::2, ::2])
    filled = fill(hint_pyramid(no_ground(), points_at(slope(), every=5)).points)[0][0, 0]
    inner = (filled - wanted)[6:-6]
    assert float(inner.abs().mean()) < 0.1
    assert float(inner.abs().max()) < 0.4


def test_a_point_rules_its_own_cell() -> None:
    points = points_at(torch.full(SIZE, 0.02))
    points[0, :, 32, 48] = torch.tensor([0.5, 1.0])
    filled = fill(hint_pyramid(no_ground(), points).points)[0][0, 0]
    assert float(filled[16, 24]) > math.log(0.02) + 0.7 * math.log(0.5 / 0.02)
    assert float(filled[2, 2]) < math.log(0.03)


def test_an_outlier_weighs_little_and_a_good_point_almost_all() -> None:
    values = torch.full((1, 1, 1, 20), 0.2)
    values[..., :2] = 0.2 + math.log(2.0)
    weights = torch.ones_like(values)
    robust = robust_weights(values, weights, 0.3)[0, 0, 0]
    assert float(robust[:2].max()) < 0.25
    assert float(robust[2:].min()) > 0.95
    assert float(robust_weights(values, torch.zeros_like(values), 0.3).abs().max()) == 0.0


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_one_point_in_ten_wrong_by_two_moves_the_correction_little(factor: float) -> None:
    truth = slope()
    points = points_at(truth, every=6)
    rows, columns = torch.nonzero(points[0, 1], as_tuple=True)
    points[0, 0, rows[::10], columns[::10]] *= factor
    prediction = torch.log(truth[::2, ::2])[None, None] - 0.5
    robust, plain, spread = corrections(prediction, points)
    assert float((robust - 0.5).abs().mean()) < 0.08
    assert float((plain - 0.5).abs().mean()) > 1.3 * float((robust - 0.5).abs().mean())
    assert 0.0 < float(spread) < 0.25


def test_a_prediction_that_the_points_confirm_stays_as_it_is() -> None:
    prediction = torch.log(slope()[::2, ::2] * 1.025)[None, None]
    points = points_at(slope())
    robust, plain, spread = corrections(prediction, points)
    assert float(robust.abs().max()) < 0.1
    assert float(plain.abs().max()) < 0.1
    assert float(spread) < 0.05


def test_without_points_there_is_no_correction() -> None:
    prediction = torch.zeros(1, 1, SIZE[0] // 2, SIZE[1] // 2)
    for item in corrections(prediction, torch.zeros(1, 2, *SIZE)):
        assert float(item.abs().max()) == 0.0


def test_a_mean_pools_to_a_mean_and_a_sum_to_a_sum() -> None:
    level = WeightedLevel(torch.full((1, 1, 4, 4), 2.0), torch.ones(1, 1, 4, 4))
    assert float(pooled(level, 2, share=True)[-1].weight) == 1.0
    assert float(pooled(level, 2, share=False)[-1].weight) == 16.0
