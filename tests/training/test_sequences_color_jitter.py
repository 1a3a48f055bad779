"""Random colour: what each change keeps and what it changes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from training.sequences.color_jitter import ColorJitter

LUMA = np.array([0.299, 0.587, 0.114])


@pytest.fixture(name="frames")
def make_frames() -> NDArray[np.uint8]:
    """(3, 20, 30, 3) colours far enough from black and white that no change clips them."""
    return np.random.default_rng(0).integers(90, 150, (3, 20, 30, 3)).astype(np.uint8)


def test_changes_stay_within_their_bounds_and_each_happens_every_other_time() -> None:
    rng = np.random.default_rng(1)
    drawn = np.array(
        [
            (j.brightness, j.contrast, j.saturation, j.hue)
            for j in (ColorJitter.sample(rng) for _ in range(4000))
        ]
    ) - [1.0, 1.0, 1.0, 0.0]
    limits = np.array([0.2, 0.2, 0.2, 0.1])
    assert (np.abs(drawn) <= limits).all()
    np.testing.assert_allclose((drawn != 0).mean(axis=0), 0.5, atol=0.04)
    np.testing.assert_allclose(np.abs(drawn).max(axis=0), limits, rtol=0.01)
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=0.01)


def test_no_change_is_a_copy(frames: NDArray[np.uint8]) -> None:
    same = ColorJitter().apply(frames)
    np.testing.assert_array_equal(same, frames)
    assert not np.shares_memory(same, frames)


def test_brightness_scales_every_channel(frames: NDArray[np.uint8]) -> None:
    np.testing.assert_allclose(
        ColorJitter(brightness=1.2).apply(frames), 1.2 * frames.astype(float), atol=0.51
    )


def test_contrast_keeps_the_mean_grey_of_the_three_frames(frames: NDArray[np.uint8]) -> None:
    grey = (frames @ LUMA).mean()
    np.testing.assert_allclose(
        ColorJitter(contrast=0.8).apply(frames), grey + 0.8 * (frames - grey), atol=0.51
    )


def test_saturation_keeps_every_pixels_grey(frames: NDArray[np.uint8]) -> None:
    grey = (frames @ LUMA)[..., None]
    expected = grey + 0.8 * (frames - grey)
    np.testing.assert_allclose(ColorJitter(saturation=0.8).apply(frames), expected, atol=0.7)


def test_hue_keeps_every_pixels_grey_and_turns_its_colour(frames: NDArray[np.uint8]) -> None:
    turned = ColorJitter(hue=0.1).apply(frames)
    np.testing.assert_allclose(turned @ LUMA, frames @ LUMA, atol=1.0)
    grey = np.full((4, 4, 3), 120, np.uint8)
    np.testing.assert_allclose(ColorJitter(hue=0.1).apply(grey), grey, atol=1)
    red = np.full((1, 1, 3), (180, 100, 100), np.uint8)
    r, g, b = (int(value) for value in ColorJitter(hue=0.1).apply(red)[0, 0])
    assert r > max(g, b)
    assert abs(g - b) > 20


def test_colours_beyond_the_range_are_cut_not_wrapped() -> None:
    bright = np.full((2, 2, 3), 240, np.uint8)
    assert (ColorJitter(brightness=1.2).apply(bright) == 255).all()
