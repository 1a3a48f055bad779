"""Folders of pictures, videos and calibration files."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from sequence_files import CAMERA, picture, write_airsim, write_camera, write_picture

from training.errors import TrainingDataError
from training.sequences.calibration import Calibration
from training.sequences.camera_file import read_camera
from training.sequences.errors import BrokenFrameError
from training.sequences.frame_cache import FrameCache
from training.sequences.opening import SEQUENCE_KINDS, open_sequences, open_triplets
from training.sequences.picture_folder import open_folder
from training.sequences.rectifier import Rectifier
from training.sequences.video import open_video
from uavdepth.camera import CameraModel

KNOWN = Calibration(CAMERA)


def test_pictures_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    for number in (10, 2, 1):
        write_picture(tmp_path / f"frame{number}.png", number)
    (folder,) = open_folder(tmp_path, KNOWN)
    assert [folder.file_of(index).stem for index in range(3)] == ["frame1", "frame2", "frame10"]
    np.testing.assert_array_equal(folder.image_bgr(2), picture(10))
    assert folder.truth_m(0) is None


def test_sub_folders_of_pictures_are_sequences_with_calibrations_of_their_own(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_picture(tmp_path / name / "0.png", 0)
    write_camera(tmp_path / "b" / "camera.json")
    first, second = open_folder(tmp_path, Calibration(horizontal_fov_deg=90.0))
    assert (first.name, second.name) == ("a", "b")
    assert first.camera == CameraModel.from_fov(64, 48, 90.0)
    assert second.camera == CAMERA


def test_a_folder_needs_pictures_and_a_calibration_of_their_size(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no pictures"):
        open_folder(tmp_path, KNOWN)
    write_picture(tmp_path / "0.png", 0)
    with pytest.raises(TrainingDataError, match=r"no intrinsics for .*0\.png"):
        open_folder(tmp_path)
    with pytest.raises(TrainingDataError, match=r"64 x 48 pixels.*128 x 96"):
        open_folder(tmp_path, Calibration(CAMERA.scaled(128, 96)))
    with pytest.raises(TrainingDataError, match="field of view is 200"):
        open_folder(tmp_path, Calibration(horizontal_fov_deg=200.0))


def test_a_picture_of_another_size_amid_the_others_is_named_when_it_is_read(tmp_path: Path) -> None:
    write_picture(tmp_path / "0.png", 0)
    write_picture(tmp_path / "1.png", 0, CAMERA.scaled(32, 24))
    with pytest.raises(BrokenFrameError, match=r"1\.png is 32 x 24 pixels"):
        open_folder(tmp_path, KNOWN)[0].image_bgr(1)


def test_a_straight_line_seen_through_a_distorting_lens_comes_out_straight() -> None:
    lens = CameraModel(160, 120, 100.0, 100.0, 80.0, 60.0, (-0.3, 0.1, 0.0, 0.0))
    line_x = 0.45
    seen = lens.normalized_rays[..., 0] > line_x
    rectifier = Rectifier(lens)
    straight = rectifier.apply(np.repeat(np.where(seen, 255, 0).astype(np.uint8)[..., None], 3, axis=2))
    columns = (straight[..., 0] > 127).argmax(axis=1)
    expected = rectifier.camera.cx + line_x * rectifier.camera.fx
    np.testing.assert_allclose(columns, expected, atol=1.5)
    assert rectifier.camera.distortion == ()


def write_video(path: Path, count: int = 8) -> Path:
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (CAMERA.width, CAMERA.height))
    for number in range(count):
        video.write(picture(number))
    video.release()
    return path


def test_a_video_gives_its_frames_in_order(tmp_path: Path) -> None:
    (video,) = open_video(write_video(tmp_path / "flight.avi"), KNOWN)
    assert (video.name, len(video), video.camera) == ("flight", 8, CAMERA)
    for index, frame in enumerate(video.images_bgr()):
        np.testing.assert_array_equal(frame, video.image_bgr(index))
        distance = [np.abs(frame.astype(int) - picture(number)).mean() for number in range(8)]
        assert int(np.argmin(distance)) == index


def test_a_videos_frames_are_kept_in_one_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (video,) = open_video(write_video(tmp_path / "flight.avi"), KNOWN)
    expected = [video.image_bgr(index)[:, :, ::-1] for index in range(8)]
    cache = FrameCache(tmp_path / "cache", video, CAMERA.width, CAMERA.height)
    monkeypatch.setattr(type(video), "image_bgr", None)
    for index in range(8):
        np.testing.assert_array_equal(cache.rgb(index), expected[index])


def test_broken_and_missing_videos_are_named(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match=r"no video at .*lost\.mp4"):
        open_video(tmp_path / "lost.mp4", KNOWN)
    with pytest.raises(TrainingDataError, match="no videos"):
        open_video(tmp_path, KNOWN)
    (tmp_path / "broken.mp4").write_bytes(b"not a video")
    with pytest.raises(TrainingDataError, match=r"cannot decode the video .*broken\.mp4"):
        open_video(tmp_path, KNOWN)
    whole = write_video(tmp_path / "whole.avi")
    with pytest.raises(TrainingDataError, match=r"64 x 48 pixels.*32 x 24"):
        open_video(whole, Calibration(CAMERA.scaled(32, 24)))


def test_a_video_cut_short_gives_the_frames_that_are_there(tmp_path: Path) -> None:
    path = write_video(tmp_path / "flight.avi")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * 2 // 3])
    (video,) = open_video(path, KNOWN)
    assert 0 < len(video) < 8
    assert len(list(video.images_bgr())) == len(video)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("c.json", '{"width": 64, "height": 48, "fx": 32, "fy": 36, "cx": 31, "cy": 24}'),
        ("c.toml", "width = 64\nheight = 48\nfx = 32.0\nfy = 36.0\ncx = 31.0\ncy = 24.0\n"),
        ("c.toml", '[camera]\nsource = "0"\nwidth = 64\nheight = 48\nfx = 32\nfy = 36\ncx = 31\ncy = 24\n'),
    ],
)
def test_a_calibration_is_read_from_json_toml_or_the_programs_configuration(
    tmp_path: Path, name: str, text: str
) -> None:
    (tmp_path / name).write_text(text)
    assert read_camera(tmp_path / name) == CAMERA


def test_a_calibration_may_hold_distortion_or_only_an_angle(tmp_path: Path) -> None:
    values = {"width": 64, "height": 48}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(values | {"horizontal_fov_deg": 80}))
    assert read_camera(path) == CameraModel.from_fov(64, 48, 80.0)
    whole = values | {"fx": 32, "fy": 36, "cx": 31, "cy": 24, "distortion": [-0.1, 0.01, 0, 0]}
    path.write_text(json.dumps(whole))
    assert read_camera(path).distortion == (-0.1, 0.01, 0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "cannot read the calibration"),
        ("{", "cannot read the calibration"),
        ("[]", "not a table"),
        ('{"width": 64, "height": 48}', "without fx, fy, cx, cy"),
        ('{"width": 64, "height": 48, "focal": 3}', "has no focal"),
        ('{"width": 64, "height": 48, "fx": 1, "horizontal_fov_deg": 80}', "both a field of view"),
        ('{"width": 64.5, "height": 48, "horizontal_fov_deg": 80}', "whole numbers"),
        ('{"width": "64", "height": 48, "horizontal_fov_deg": 80}', "width is '64'"),
        ('{"width": 64, "height": 48, "fx": -1, "fy": 1, "cx": 1, "cy": 1}', "fx is -1"),
        (
            '{"width": 64, "height": 48, "fx": 1, "fy": 1, "cx": 1, "cy": 1, "distortion": 5}',
            "distortion is 5",
        ),
        ('{"width": NaN, "height": 48, "horizontal_fov_deg": 80}', "width is nan"),
        ('{"width": 64, "height": 48, "horizontal_fov_deg": 180}', "180"),
    ],
)
def test_a_broken_calibration_is_named(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "lens.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(TrainingDataError, match=said) as raised:
        read_camera(path)
    assert "lens.json" in str(raised.value)


def test_one_door_opens_every_kind(tmp_path: Path) -> None:
    recording = write_airsim(tmp_path / "flight", 5)
    (sequence,) = open_sequences("airsim", recording)
    assert len(sequence) == 5
    assert len(open_triplets("airsim", recording)) == 3
    assert len(open_triplets("folder", recording / "images", KNOWN)) == 3
    for kind in SEQUENCE_KINDS:
        with pytest.raises(TrainingDataError, match="nowhere"):
            open_sequences(kind, tmp_path / "nowhere")


def test_an_unknown_kind_and_a_needless_calibration_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no data is of kind 'nuscenes'"):
        open_sequences("nuscenes", tmp_path)
    with pytest.raises(TrainingDataError, match="kitti-raw brings its own calibration"):
        open_sequences("kitti-raw", tmp_path, KNOWN)
