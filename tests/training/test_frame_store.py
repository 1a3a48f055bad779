"""Stored frames: what comes back is what was rendered, and what is lost or broken is named."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from frames import HEIGHT, WIDTH, ground_frame, make_store
from hypothesis import given
from hypothesis import strategies as st

from training.data.batches import FramePool
from training.data.depth_code import FAR_M, NEAR_M, decode_depth16, encode_depth16
from training.data.frame_store import frames_folder, has_frames, read_frames, write_frames
from training.errors import TrainingDataError


@given(st.floats(NEAR_M, FAR_M))
def test_stored_depth_is_within_a_fiftieth_of_a_percent(depth: float) -> None:
    stored = decode_depth16(encode_depth16(np.array([depth], np.float32)))
    assert stored[0] == pytest.approx(depth, rel=2e-4)


def test_sky_is_stored_as_sky_and_only_sky() -> None:
    depth = np.array([np.inf, FAR_M * 10, NEAR_M / 10], np.float32)
    stored = decode_depth16(encode_depth16(depth))
    assert np.isinf(stored[0])
    assert stored[1:] == pytest.approx([FAR_M, NEAR_M], rel=1e-3)


def test_a_frame_comes_back_from_the_store(tmp_path: Path) -> None:
    frame = ground_frame(3.0)
    write_frames(tmp_path, "city", 7, [frame])
    (record,) = read_frames(tmp_path)
    assert (record.scene, record.seed, record.height_m) == ("city", 7, 3.0)
    assert (record.camera, record.mount, record.attitude) == (frame.camera, frame.mount, frame.attitude)
    depth = record.depth_m()
    near = np.isfinite(frame.depth_m) & (frame.depth_m < FAR_M)
    assert np.array_equal(np.isfinite(depth), np.isfinite(frame.depth_m))
    assert np.allclose(depth[near], frame.depth_m[near], rtol=2e-4)
    assert np.abs(record.image_bgr().astype(int) - frame.image_bgr).mean() < 3


def test_a_world_without_its_list_is_not_there_yet(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 0), ("city", 1)))
    (frames_folder(tmp_path, "city", 1) / "frames.json").unlink()
    assert has_frames(tmp_path, "city", 0)
    assert not has_frames(tmp_path, "city", 1)
    assert {record.seed for record in read_frames(tmp_path)} == {0}


@pytest.mark.parametrize("text", ["{", "{}", json.dumps({"scene": "city", "seed": 0, "frames": [{}]})])
def test_a_broken_list_is_named(tmp_path: Path, text: str) -> None:
    make_store(tmp_path, (("city", 0),))
    (frames_folder(tmp_path, "city", 0) / "frames.json").write_text(text)
    with pytest.raises(TrainingDataError, match=r"frames\.json"):
        read_frames(tmp_path)


def test_a_lost_picture_is_named(tmp_path: Path) -> None:
    record = read_frames(make_store(tmp_path, (("city", 0),)))[0]
    (record.folder / "0000.png").unlink()
    with pytest.raises(TrainingDataError, match=r"0000\.png"):
        record.depth_m()


@pytest.mark.parametrize("exists", [True, False])
def test_a_store_without_frames_is_an_error(tmp_path: Path, exists: bool) -> None:
    with pytest.raises(TrainingDataError, match="no "):
        FramePool(tmp_path if exists else tmp_path / "missing")


@pytest.mark.parametrize("depth", [math.nan, 0.0, -1.0])
def test_a_depth_that_is_none_is_not_stored(tmp_path: Path, depth: float) -> None:
    frame = ground_frame()
    frame.depth_m[3, 4] = depth
    with pytest.raises(TrainingDataError, match="frame 1 of city:7 has 1 pixels"):
        write_frames(tmp_path, "city", 7, [ground_frame(), frame])
    assert not has_frames(tmp_path, "city", 7)


@pytest.mark.parametrize(("suffix", "read"), [(".jpg", "image_bgr"), (".png", "depth_m")])
def test_a_picture_of_another_size_than_its_camera_is_named(tmp_path: Path, suffix: str, read: str) -> None:
    record = read_frames(make_store(tmp_path, (("city", 0),)))[0]
    path = record.folder / (record.name + suffix)
    cv2.imwrite(str(path), np.zeros((50, 60, 3), np.uint8))
    with pytest.raises(TrainingDataError, match=f"{path.name} is 60x50 pixels, its camera is 160x96"):
        getattr(record, read)()


def test_frames_have_the_cameras_size() -> None:
    assert ground_frame().image_bgr.shape == (HEIGHT, WIDTH, 3)
