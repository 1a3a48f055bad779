"""Photographs lie on rendered surfaces in true size; the sky and depth know nothing of them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from training.data.photo_textures import PhotoTextures
from training.errors import TrainingDataError
from uavdepth.camera import CameraModel

CAMERA = CameraModel.from_fov(128, 64, horizontal_fov_deg=90.0)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> PhotoTextures:
    folder = tmp_path_factory.mktemp("photos")
    rng = np.random.default_rng(0)
    for number in range(3):
        coarse = rng.integers(0, 255, (24, 32, 3), np.uint8)
        cv2.imwrite(
            str(folder / f"{number}.png"), cv2.resize(coarse, (640, 480), interpolation=cv2.INTER_CUBIC)
        )
    (folder / "notes.txt").write_text("no photograph")
    return PhotoTextures(folder)


def grey() -> NDArray[np.uint8]:
    return np.full((CAMERA.height, CAMERA.width, 3), 110, np.uint8)


def wall(distance_m: float) -> NDArray[np.float32]:
    depth = np.full((CAMERA.height, CAMERA.width), distance_m, np.float32)
    depth[:20] = np.inf
    return depth


def detail(picture: NDArray[np.uint8]) -> float:
    """Difference between neighbours, against how much the surface varies at all."""
    values = picture[24:].astype(float)
    return float(np.abs(np.diff(values, axis=1)).mean() / values.std())


def test_every_photograph_of_the_folder_is_taken_and_nothing_else(photos: PhotoTextures) -> None:
    assert len(photos) == 3


def test_surfaces_change_and_the_sky_stays(photos: PhotoTextures) -> None:
    picture, depth = grey(), wall(4.0)
    painted = photos.paint(np.random.default_rng(1), picture, depth, CAMERA)
    assert painted.dtype == np.uint8
    assert (painted[:20] == 110).all()
    assert painted[20:].std() > 10
    assert (picture == 110).all()


def test_far_surfaces_show_finer_texture_than_near_ones(photos: PhotoTextures) -> None:
    finer = []
    for seed in range(12):
        near, far = (
            photos.paint(np.random.default_rng(seed), grey(), wall(distance_m), CAMERA)
            for distance_m in (1.5, 15.0)
        )
        if near[24:].std() > 5:  # now and then walls keep their own look
            finer.append(detail(far) / detail(near))
    assert len(finer) >= 6
    assert min(finer) > 1.5


@pytest.mark.parametrize("seed", range(6))
def test_texture_too_fine_to_be_seen_is_its_mean(photos: PhotoTextures, seed: int) -> None:
    painted = photos.paint(np.random.default_rng(seed), grey(), wall(4000.0), CAMERA)
    assert painted[20:].std(axis=(0, 1)).max() < 25


def test_shadow_stays_on_a_painted_surface(photos: PhotoTextures) -> None:
    picture = grey()
    picture[:, :64] = 30
    painted = photos.paint(np.random.default_rng(2), picture, wall(3.0), CAMERA)[24:].astype(float)
    assert painted[:, :56].mean() < 0.6 * painted[:, 72:].mean()


def test_the_same_numbers_make_the_same_picture(photos: PhotoTextures) -> None:
    first, second = (photos.paint(np.random.default_rng(3), grey(), wall(5.0), CAMERA) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_a_folder_without_photographs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no photographs there"):
        PhotoTextures(tmp_path)


def test_what_is_no_photograph_is_named(tmp_path: Path) -> None:
    (tmp_path / "broken.jpg").write_bytes(b"not a picture")
    with pytest.raises(TrainingDataError, match=r"broken\.jpg: this photograph cannot be read"):
        PhotoTextures(tmp_path)


def test_a_tiny_photograph_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "tiny.png"), np.zeros((20, 40, 3), np.uint8))
    with pytest.raises(TrainingDataError, match=r"40x20 pixels; at least 32"):
        PhotoTextures(tmp_path)
