"""Corners followed through pictures that shift by known amounts."""

from __future__ import annotations

import numpy as np
from moving_camera import wall_picture
from numpy.typing import NDArray

from uavdepth import CameraModel
from uavdepth.motion.feature_tracks import MOST_FRAMES, MOST_TRACKS, FeatureTracks

CAMERA = CameraModel.from_fov(320, 160, 90)


def shifted(pixels: float) -> NDArray[np.uint8]:
    """The painted wall, the world shifted to the left by so many pixels."""
    return np.ascontiguousarray(wall_picture(CAMERA, (0.0, pixels * 10 / CAMERA.fx, 0.0), 10.0)[..., 0])


def follow(
    tracks: FeatureTracks, picture: NDArray[np.uint8], expected: NDArray[np.float32] | None = None
) -> None:
    """Tracks followed into a picture, and new ones begun there."""
    tracks.update(picture, expected)
    tracks.renew()


def test_a_corner_is_followed_to_a_tenth_of_a_pixel() -> None:
    tracks = FeatureTracks()
    for step in range(6):
        follow(tracks, shifted(2.3 * step))
    first, last = tracks.positions[0], tracks.positions[-1]
    old = ~np.isnan(first[:, 0])
    assert old.sum() > 50
    moved = (last - first)[old]
    assert np.median(np.hypot(moved[:, 0] + 2.3 * 5, moved[:, 1])) < 0.1


def test_tracks_keep_their_numbers_and_new_ones_get_new_numbers() -> None:
    tracks = FeatureTracks()
    follow(tracks, shifted(0))
    before = set(tracks.ids.tolist())
    for step in range(1, 12):
        follow(tracks, shifted(6.0 * step))
    after = set(tracks.ids.tolist())
    assert len(tracks.ids) == len(after) <= MOST_TRACKS
    assert before & after
    assert after - before
    assert min(after - before) > max(before)
    tracks.clear()
    follow(tracks, shifted(0))
    assert min(tracks.ids) > max(after)


def test_a_picture_that_has_nothing_to_do_with_the_last_ends_all_tracks() -> None:
    tracks = FeatureTracks()
    follow(tracks, shifted(0))
    before = set(tracks.ids.tolist())
    follow(tracks, np.ascontiguousarray(shifted(500)[::-1]))
    assert len(before & set(tracks.ids.tolist())) < 0.1 * len(before)


def test_a_far_jump_is_followed_when_it_is_expected() -> None:
    tracks = FeatureTracks()
    follow(tracks, shifted(0))
    before = tracks.positions[-1].copy()
    numbers = tracks.ids.copy()
    follow(tracks, shifted(70), before - np.array([70, 0], np.float32))
    stayed = np.isin(numbers, tracks.ids)
    visible = before[:, 0] > 80
    assert np.mean(stayed[visible]) > 0.8


def test_a_change_of_size_begins_anew_and_history_has_an_end() -> None:
    tracks = FeatureTracks()
    for _ in range(MOST_FRAMES + 3):
        follow(tracks, shifted(0))
    assert tracks.positions.shape[0] == MOST_FRAMES
    follow(tracks, np.ascontiguousarray(shifted(0)[:, :300]))
    assert tracks.positions.shape[0] == 1
