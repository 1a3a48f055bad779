"""Cameras: real files, dead servers."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest
from camera_files import MOUNT, camera_for, settings_for, shade_of, write_folder, write_video
from program_fakes import HEIGHT, WIDTH, FakeLink, free_port

from service.cameras.camera import (
    CameraEndedError,
    CameraTimeoutError,
    PictureSizeError,
    fit_picture,
)
from service.cameras.image_folder import ImageFolderCamera
from service.cameras.pace import Pace
from service.cameras.rendered import RenderedCamera
from service.cameras.rtsp import RtspCamera, without_password
from service.cameras.source import open_camera
from service.cameras.usb import UsbCamera
from service.clock import ManualClock, MonotonicClock
from service.errors import CameraError, ConfigError


@pytest.mark.parametrize(
    ("source", "kind"),
    [
        ("0", UsbCamera),
        ("17", UsbCamera),
        ("/dev/video2", UsbCamera),
        ("rtsp://127.0.0.1/x", RtspCamera),
        ("rtsps://127.0.0.1/x", RtspCamera),
        ("sim:city", RenderedCamera),
        ("sim:forest:12", RenderedCamera),
    ],
)
def test_a_source_names_its_camera(source: str, kind: type) -> None:
    assert type(camera_for(settings_for(source))) is kind


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("nothing.mp4", r"nothing\.mp4: no such file or folder; a camera number"),
        ("http://127.0.0.1/x", "no such file or folder"),
        ("sim:atlantis", "atlantis"),
        ("sim:city:x", "'x'"),
        ("-1", "no such file"),
    ],
)
def test_a_source_that_is_nothing_is_refused_by_name(source: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as refusal:
        camera_for(settings_for(source))
    assert "[camera] source" in str(refusal.value)


def test_a_usb_camera_that_is_not_there_is_a_camera_error() -> None:
    camera = camera_for(settings_for("63"))
    with pytest.raises(CameraError, match="camera 63: no such device"):
        camera.open()
    with pytest.raises(CameraError, match="not open"):
        camera.read(1.0)


def test_a_picture_of_another_size_is_refused_with_both_sizes() -> None:
    settings = settings_for("0")
    with pytest.raises(PictureSizeError, match=r"camera 0 delivers 100x96, the configuration says 160x96"):
        fit_picture(np.zeros((96, 100, 3), np.uint8), settings, "0")
    with pytest.raises(PictureSizeError, match="or resize_pictures = true"):
        fit_picture(np.zeros((2 * HEIGHT, 2 * WIDTH, 3), np.uint8), settings, "0")


def test_a_picture_of_the_same_aspect_is_resized_if_the_user_says_so() -> None:
    settings = settings_for("0", "camera.resize_pictures=true")
    assert fit_picture(np.zeros((2 * HEIGHT, 2 * WIDTH, 3), np.uint8), settings, "0").shape == (
        HEIGHT,
        WIDTH,
        3,
    )
    with pytest.raises(PictureSizeError, match="the aspect differs"):
        fit_picture(np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8), settings, "0")


def test_a_grey_picture_gets_three_channels() -> None:
    assert fit_picture(np.full((HEIGHT, WIDTH), 7, np.uint8), settings_for("0"), "0").shape == (
        HEIGHT,
        WIDTH,
        3,
    )


def test_pace_counts_what_is_due() -> None:
    pace = Pace(10.0, 1_000_000_000)
    assert pace.wait_s(900_000_000) == pytest.approx(0.1)
    assert pace.step() == 1_000_000_000
    assert pace.due_ns == 1_100_000_000
    assert pace.late_pictures(1_099_000_000) == 0
    assert pace.late_pictures(1_320_000_000) == 2


def test_a_video_plays_in_order_and_ends(tmp_path: Path) -> None:
    path = write_video(tmp_path / "flight.avi", [10, 90, 170])
    camera = camera_for(settings_for(path, "camera.realtime=false"))
    camera.open()
    frames = [camera.read(1.0) for _ in range(3)]
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert [shade_of(frame.image_bgr) for frame in frames] == pytest.approx([10, 90, 170], abs=3)
    with pytest.raises(CameraEndedError, match="the video is over"):
        camera.read(1.0)


def test_a_video_that_loops_starts_again(tmp_path: Path) -> None:
    path = write_video(tmp_path / "flight.avi", [10, 170])
    camera = camera_for(settings_for(path, "camera.realtime=false", "camera.loop=true"))
    camera.open()
    shades = [shade_of(camera.read(1.0).image_bgr) for _ in range(5)]
    assert shades == pytest.approx([10, 170, 10, 170, 10], abs=3)


def test_a_video_at_its_own_pace_is_stamped_when_each_picture_was_due(tmp_path: Path) -> None:
    path = write_video(tmp_path / "flight.avi", [10, 90, 170], fps=20.0)
    camera = camera_for(settings_for(path))
    camera.open()
    stamps = [camera.read(1.0).captured_ns for _ in range(2)]
    assert stamps[1] - stamps[0] == 50_000_000


def test_a_late_reader_of_a_video_skips_what_has_passed(tmp_path: Path) -> None:
    clock = ManualClock()
    camera = camera_for(settings_for(write_video(tmp_path / "flight.avi", [0, 40, 80, 120, 160])), clock)
    camera.open()
    clock.advance_s(0.11)  # pictures 0 and 1 should have gone
    frame = camera.read(1.0)
    assert shade_of(frame.image_bgr) == pytest.approx(80, abs=3)
    assert frame.captured_ns == 100_000_000


def test_the_constant_latency_is_taken_off_the_stamp(tmp_path: Path) -> None:
    path = write_video(tmp_path / "flight.avi", [10])
    clock = ManualClock(5_000_000_000)
    camera = camera_for(settings_for(path, "camera.latency_ms=40"), clock)
    camera.open()
    assert camera.read(1.0).captured_ns == 4_960_000_000


def test_a_video_of_another_size_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "flight.avi", [10])
    camera = camera_for(settings_for(path, "camera.width=320"))
    camera.open()
    with pytest.raises(PictureSizeError, match="delivers 160x96, the configuration says 320x96"):
        camera.read(1.0)


def test_a_file_that_is_no_video_is_a_wrong_configuration(tmp_path: Path) -> None:
    path = tmp_path / "notes.mp4"
    path.write_text("not a video")
    with pytest.raises(ConfigError, match=r"notes\.mp4: not a video"):
        open_camera(str(path), settings_for(path), MonotonicClock(), FakeLink(MonotonicClock()), MOUNT)


def test_a_folder_plays_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "shots", list(range(0, 240, 20)))  # shot2 comes before shot10
    (folder / "notes.txt").write_text("not a picture")
    camera = camera_for(settings_for(folder, "camera.realtime=false"))
    assert isinstance(camera, ImageFolderCamera)
    camera.open()
    assert [shade_of(camera.read(1.0).image_bgr) for _ in range(12)] == list(range(0, 240, 20))
    with pytest.raises(CameraEndedError):
        camera.read(1.0)


def test_a_folder_at_its_pace_skips_what_has_passed_but_never_the_last(tmp_path: Path) -> None:
    clock = ManualClock()
    folder = write_folder(tmp_path / "shots", [0, 50, 100])
    camera = camera_for(settings_for(folder, "camera.fps=10"), clock)
    camera.open()
    clock.advance_s(60.0)
    assert shade_of(camera.read(1.0).image_bgr) == 100
    with pytest.raises(CameraEndedError):
        camera.read(1.0)


def test_a_folder_without_pictures_and_one_with_a_broken_picture(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(ConfigError, match="no pictures in it"):
        camera_for(settings_for(empty)).open()
    folder = write_folder(tmp_path / "shots", [0])
    (folder / "shot1.png").write_bytes(b"broken")
    camera = camera_for(settings_for(folder, "camera.realtime=false"))
    camera.open()
    camera.read(1.0)
    with pytest.raises(CameraError, match=r"shot1\.png is not a picture"):
        camera.read(1.0)


def test_an_interrupted_camera_does_not_wait_for_its_next_picture(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "shots", [0, 1])
    camera = camera_for(settings_for(folder, "camera.fps=1"), ManualClock())
    camera.open()
    camera.read(1.0)
    camera.interrupt()
    with pytest.raises(CameraTimeoutError, match="interrupted"):
        camera.read(1.0)


def test_a_server_that_accepts_and_never_answers_is_given_up_in_time() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"rtsp://user:secret@127.0.0.1:{server.getsockname()[1]}/stream"
        camera = camera_for(settings_for(url, "camera.open_timeout_s=0.3"))
        with pytest.raises(CameraError, match=r"no stream within 0\.3 s") as refusal:
            camera.open()
        assert "secret" not in str(refusal.value)


def test_a_closed_port_is_a_camera_error() -> None:
    camera = camera_for(settings_for(f"rtsp://127.0.0.1:{free_port()}/stream"))
    with pytest.raises(CameraError, match="or refused"):
        camera.open()


def test_a_password_never_reaches_a_message() -> None:
    assert without_password("rtsp://me:pa:ss@host:554/a@b") == "rtsp://***@host:554/a@b"
    assert without_password("rtsp://host/a") == "rtsp://host/a"
