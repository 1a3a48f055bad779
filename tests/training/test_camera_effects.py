"""Weather, lens, sensor and link may spoil a picture, but nothing in it may move."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from training.data import camera_effects as effects
from training.data.camera_effects import EFFECTS, Picture, camera_effects, haze
from training.data.lens_effects import LARGEST_DROP, lens_dirt, rain_drops
from training.errors import TrainingDataError

WIDTH, HEIGHT = 160, 80
SEEDS = range(12)

PictureEffect = Callable[[np.random.Generator, Picture], Picture]
LENS_AND_SENSOR: tuple[PictureEffect, ...] = (
    effects.rain_streaks,
    rain_drops,
    lens_dirt,
    effects.sun_glare,
    effects.motion_blur,
    effects.vignette,
    effects.exposure_change,
    effects.color_cast,
    effects.chroma_noise,
    effects.video_blocks,
)


def scenery(width: int = WIDTH, height: int = HEIGHT) -> Picture:
    """Blotches of many sizes, of all brightnesses."""
    rng = np.random.default_rng(11)
    total = np.zeros((height, width, 3), np.float32)
    for cells in (4, 8, 16, 40):
        total += cv2.resize(rng.random((cells, 2 * cells, 3), np.float32), (width, height))
    return np.asarray(10.0 + 235.0 * (total - total.min()) / (total.max() - total.min()), np.uint8)


def ground_and_sky(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.float32]:
    with np.errstate(divide="ignore"):
        rows = np.maximum(np.arange(height) - height / 3, 0.0) / height
        return np.repeat((2.0 / rows)[:, None], width, axis=1).astype(np.float32)


def measured_shift(before: Picture, after: Picture) -> NDArray[np.float64]:
    """How far right and down the content moved, in pixels, whatever became of brightness and contrast."""
    details = []
    for each in (before, after):
        gray = cv2.cvtColor(each, cv2.COLOR_BGR2GRAY).astype(np.float64)
        details.append(cv2.GaussianBlur(gray, (0, 0), 1.5) - cv2.GaussianBlur(gray, (0, 0), 4.0))
    down, right = np.gradient(details[0])
    inner = (slice(8, -8), slice(8, -8))
    columns = [each[inner].ravel() for each in (details[0], right, down)]
    contrast, by_right, by_down = np.linalg.lstsq(np.stack(columns, axis=1), details[1][inner].ravel())[0]
    return np.array([-by_right / contrast, -by_down / contrast])


def test_every_effect_is_among_those_that_are_drawn() -> None:
    assert len(EFFECTS) == len(LENS_AND_SENSOR) + 1


@pytest.mark.parametrize("number", range(len(EFFECTS)))
class TestEveryEffect:
    @pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (385, 187), (65, 37)])
    def test_gives_a_new_picture_of_the_same_size(self, number: int, size: tuple[int, int]) -> None:
        picture, depth_m = scenery(*size), ground_and_sky(*size)
        before = picture.copy()
        changed = 0
        for seed in SEEDS:
            result = EFFECTS[number](np.random.default_rng(seed), picture, depth_m)
            assert result.shape == picture.shape
            assert result.dtype == np.uint8
            changed += not np.array_equal(result, before)
        np.testing.assert_array_equal(picture, before)
        assert changed > 0

    def test_is_decided_by_the_generator_alone(self, number: int) -> None:
        results = [EFFECTS[number](np.random.default_rng(3), scenery(), ground_and_sky()) for _ in range(2)]
        np.testing.assert_array_equal(results[0], results[1])

    def test_moves_nothing(self, number: int) -> None:
        shifts = [
            measured_shift(
                scenery(), EFFECTS[number](np.random.default_rng(seed), scenery(), ground_and_sky())
            )
            for seed in range(24)
        ]
        assert np.hypot(*np.median(shifts, axis=0)) < 0.1


@pytest.mark.parametrize("shift", [(0.5, 0.0), (0.0, -0.3), (0.2, 0.2)])
def test_a_part_of_a_pixel_would_be_noticed(shift: tuple[float, float]) -> None:
    move = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
    moved = np.asarray(cv2.warpAffine(scenery(), move, (WIDTH, HEIGHT)), np.uint8)
    np.testing.assert_allclose(measured_shift(scenery(), moved), shift, atol=0.06)


class TestHaze:
    def test_twice_the_distance_loses_the_square_of_the_contrast(self) -> None:
        """Koschmieder: what is left of a contrast is exp(-beta d)."""
        picture = np.zeros((20, 60, 3), np.uint8)
        picture[::2] = 250
        depth_m = np.repeat(np.array([0.0, 15.0, 30.0], np.float32), 20)[None].repeat(20, axis=0)
        for seed in SEEDS:
            result = haze(np.random.default_rng(seed), picture, depth_m).astype(float)
            contrast = (result[::2] - result[1::2]).mean(axis=(0, 2)).reshape(3, 20).mean(axis=1) / 250.0
            assert contrast[0] == pytest.approx(1.0)
            assert 0.02 < contrast[1] < 0.95
            assert contrast[2] == pytest.approx(contrast[1] ** 2, abs=0.01)

    @pytest.mark.parametrize("nothing_there", [np.inf, np.nan])
    def test_the_sky_is_nothing_but_air(self, nothing_there: float) -> None:
        depth_m = np.full((HEIGHT, WIDTH), nothing_there, np.float32)
        result = haze(np.random.default_rng(1), scenery(), depth_m)
        np.testing.assert_array_equal(result, np.broadcast_to(result[0, 0], result.shape))
        assert result.min() > 100


def test_motion_blur_keeps_every_point_in_the_middle_of_its_smear() -> None:
    picture = np.zeros((61, 321, 3), np.uint8)
    picture[30, 160] = 255
    rows, columns = np.mgrid[:61, :321]
    longest = 0.0
    for seed in range(40):
        smear = effects.motion_blur(np.random.default_rng(seed), picture)[..., 0].astype(float)
        assert (smear * rows).sum() / smear.sum() == pytest.approx(30.0, abs=0.05)
        assert (smear * columns).sum() / smear.sum() == pytest.approx(160.0, abs=0.05)
        longest = max(longest, float(np.hypot(rows - 30, columns - 160)[smear > 0].max()))
    assert 3.0 < longest < 0.03 * 321


def test_drops_are_small_and_leave_the_rest_alone() -> None:
    picture = scenery(320, 160)
    most = round(LARGEST_DROP * 320)
    for seed in SEEDS:
        changed = (rain_drops(np.random.default_rng(seed), picture) != picture).any(axis=2)
        assert 0 < changed.sum() < 11 * most**2
        # A square as wide as the largest drop, slid over a single drop, covers it.
        count, _, statistics, _ = cv2.connectedComponentsWithStats(changed.astype(np.uint8))
        smallest = statistics[1:count, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1).min()
        assert smallest <= most


def test_a_drop_shows_the_scene_the_wrong_way_round() -> None:
    """Where the picture gets brighter to the right and downwards, its image in a drop gets darker."""
    ramp = np.add.outer(np.arange(160.0), 0.5 * np.arange(320.0)) / 320.0 * 255.0
    picture = np.repeat(ramp[..., None], 3, axis=2).astype(np.uint8)
    slopes = []
    for seed in range(30):
        result = rain_drops(np.random.default_rng(seed), picture)
        changed = (result != picture).any(axis=2).astype(np.uint8)
        # Along its middle a drop shows what is there anyway: close that line, then keep off the rim.
        whole = cv2.morphologyEx(changed, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
        core = cv2.erode(whole, np.ones((9, 9), np.uint8)) > 0
        for axis in (0, 1):
            slopes.extend(np.gradient(result[..., 0].astype(float), axis=axis)[core])
    assert len(slopes) > 100
    assert np.median(slopes) < -0.5


def test_a_vignette_leaves_the_middle_and_darkens_all_corners_alike() -> None:
    white = np.full((81, 161, 3), 200, np.uint8)
    for seed in SEEDS:
        result = effects.vignette(np.random.default_rng(seed), white)[..., 0]
        assert result[40, 80] >= 199
        corners = {int(result[i, j]) for i in (0, -1) for j in (0, -1)}
        assert len(corners) == 1
        assert 200 / 4 < corners.pop() < 180
        np.testing.assert_array_equal(result, result[::-1, ::-1])


def test_overexposure_clips_and_never_wraps() -> None:
    levels = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2).repeat(32, axis=0)
    clipped = 0
    for seed in SEEDS:
        result = effects.exposure_change(np.random.default_rng(seed), levels)[..., 0].astype(int)
        assert bool((np.diff(result, axis=1) >= 0).all())
        assert bool((result[:, 0] == 0).all())
        clipped += int((result[:, 200] == 255).any())
    assert 0 < clipped < len(SEEDS)


def test_glare_only_ever_brightens() -> None:
    for seed in SEEDS:
        result = effects.sun_glare(np.random.default_rng(seed), scenery()).astype(int)
        assert (result - scenery()).min() >= -1
        assert (result - scenery()).mean() > 3.0


def test_noise_does_not_change_the_mean_brightness() -> None:
    gray = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    for seed in SEEDS:
        result = effects.chroma_noise(np.random.default_rng(seed), gray).astype(float)
        assert result.mean() == pytest.approx(128.0, abs=1.0)
        # Channels are noisy each by itself.
        assert abs(np.corrcoef(result[..., 0].ravel(), result[..., 1].ravel())[0, 1]) < 0.1


def test_a_third_of_the_pictures_stays_as_it_is_and_few_get_many_effects(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    applied: list[int] = []

    def recorded(number: int) -> effects.Effect:
        def effect(rng: np.random.Generator, picture: Picture, depth_m: NDArray[np.float32]) -> Picture:
            applied.append(number)
            return picture

        return effect

    monkeypatch.setattr(effects, "EFFECTS", tuple(recorded(k) for k in range(len(EFFECTS))))
    picture, depth_m, rng = scenery(16, 16), ground_and_sky(16, 16), np.random.default_rng(0)
    counts, drawn = np.zeros(4), set()
    for _ in range(2000):
        applied.clear()
        camera_effects(rng, picture, depth_m)
        counts[len(applied)] += 1
        drawn.update(applied)
        assert applied == sorted(set(applied)), "from the scene to the link, none twice"
    assert drawn == set(range(len(EFFECTS)))
    assert counts[0] / 2000 == pytest.approx(1 / 3, abs=0.04)
    assert counts[0] > counts[2] > counts[3] > 0


def test_a_depth_of_another_size_is_refused() -> None:
    with pytest.raises(TrainingDataError, match=r"\(40, 80\).*\(80, 160\)"):
        camera_effects(np.random.default_rng(0), scenery(), ground_and_sky(80, 40))
