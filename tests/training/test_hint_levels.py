"""Hints in levels: flight makes what training means."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from training.networks.hint_levels import HintLevels
from training.networks.hint_levels import hint_levels as meant
from uavdepth.model.hint_levels import hint_levels, hint_shapes
from uavdepth.model.point_pixels import PointPixels

WIDTH, HEIGHT = 160, 96


def ground(horizon: int) -> NDArray[np.float32]:
    """q of ground from a row on, slanted as with a roll."""
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    below = rows - horizon + 0.1 * (columns - WIDTH / 2)
    return np.where(below > 0, below / HEIGHT + 0.01, 0.0).astype(np.float32)


def points(count: int) -> PointPixels:
    rng = np.random.default_rng(count)
    planes = np.zeros((2, HEIGHT, WIDTH), np.float32)
    pixels = rng.choice(HEIGHT * WIDTH, count, replace=False)
    planes[0].flat[pixels] = rng.uniform(0.005, 3.0, count)
    planes[1].flat[pixels] = rng.uniform(0.01, 1.0, count)
    return PointPixels.of_planes(planes)


@pytest.mark.parametrize("count", [0, 1, 7, 300])
@pytest.mark.parametrize("horizon", [HEIGHT + 20, 61, 40, -30], ids=["unknown", "low", "middle", "all"])
def test_flight_makes_the_levels_that_training_means(count: int, horizon: int) -> None:
    plane, known = ground(horizon), points(count)
    wanted = meant(torch.from_numpy(plane)[None, None], torch.from_numpy(known.planes)[None])
    made = hint_levels(plane, known)
    assert {name: value.shape for name, value in made.items()} == hint_shapes(WIDTH, HEIGHT)
    for (name, value), want in zip(made.items(), wanted.inputs, strict=True):
        np.testing.assert_allclose(value, want.numpy(), rtol=1e-5, atol=1e-5, err_msg=name)


def test_what_is_not_known_is_zero_everywhere() -> None:
    nothing = hint_levels(np.zeros((HEIGHT, WIDTH), np.float32), PointPixels.none(WIDTH, HEIGHT))
    assert not any(value.any() for value in nothing.values())


def test_inputs_are_told_apart_by_their_order() -> None:
    inputs = [
        torch.full(shape, float(number)) for number, shape in enumerate(hint_shapes(WIDTH, HEIGHT).values())
    ]
    levels = HintLevels.of_inputs(inputs)
    assert [float(each.flatten()[0]) for each in levels.inputs] == list(range(len(inputs)))
    assert [level.shape[2] for level in levels.levels] == [HEIGHT >> step for step in range(1, 6)]
