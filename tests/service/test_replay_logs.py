"""Videos and pictures with telemetry logs: ArduPilot's .BIN and .tlog, PX4's .ulg."""

from __future__ import annotations

import math
import struct
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
from link_support import LOGS, SECOND_NS, dataflash_rows
from test_replay import run
from ulog_support import small_ulog

from service.errors import RecordError
from service.replay.dataflash_file import read_dataflash
from service.replay.loose_footage import LooseFootage
from service.replay.replayed_link import ReplayedLink
from service.replay.tlog_file import read_tlog as read_packets
from service.replay.ulog_file import read_ulog
from service.settings.autopilot import AutopilotSettings
from service.settings.camera import CameraSettings

CAMERA = CameraSettings(source="x", width=64, height=64, horizontal_fov_deg=80.0)
LONG_TLOG = LOGS / "px4_118_approach_stop.tlog"


@pytest.fixture(scope="module")
def tlog(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 20 s of a recorded flight: take-off at 3 s, Position mode at 14.4 s."""
    packets = read_packets(LONG_TLOG)
    path = tmp_path_factory.mktemp("logs") / "short.tlog"
    first_ns = packets[0].at_ns
    kept = [packet for packet in packets if packet.at_ns < first_ns + 20 * SECOND_NS]
    path.write_bytes(b"".join(struct.pack(">Q", packet.at_ns // 1000) + packet.data for packet in kept))
    return path


def video(path: Path, pictures: int = 20, fps: float = 10.0) -> Path:
    """Grey pictures that brighten."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), fps, (64, 64))
    for i in range(pictures):
        writer.write(np.full((64, 64, 3), 5 * i, np.uint8))
    writer.release()
    return path


def pictures_in(folder: Path, count: int = 5) -> Path:
    folder.mkdir()
    for i in range(count):
        cv2.imwrite(str(folder / f"picture{i}.png"), np.full((64, 64, 3), 5 * i, np.uint8))
    return folder


def test_a_dataflash_log_tells_the_attitude_that_its_vehicle_had() -> None:
    packets = read_dataflash(LOGS / "D_reboot_and_link_pause_1.BIN")
    link = ReplayedLink(AutopilotSettings(), packets)
    rows = dataflash_rows("D_reboot_and_link_pause_1.BIN", "ATT")["ATT"]
    for at_us, roll_deg, pitch_deg, yaw_deg in rows[450:1000:50]:
        at_ns = round(at_us) * 1000
        link.hear_until(at_ns + SECOND_NS // 5)
        known = link.telemetry_at(at_ns)
        assert known.attitude is not None
        assert math.degrees(known.attitude.roll_rad) == pytest.approx(roll_deg, abs=0.5)
        assert math.degrees(known.attitude.pitch_rad) == pytest.approx(pitch_deg, abs=0.5)
        turned = math.remainder(math.degrees(known.attitude.yaw_rad) - yaw_deg, 360.0)
        assert turned == pytest.approx(0.0, abs=1.5)
        assert known.height_m is not None
    assert known.mode is not None


def test_a_px4_log_tells_attitude_position_height_and_mode(tmp_path: Path) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(small_ulog(3.0, yaw_rate_rps=0.5))
    link = ReplayedLink(AutopilotSettings(), read_ulog(path))
    link.hear_until(7 * SECOND_NS)
    known = link.telemetry_at(round(6.99 * SECOND_NS))
    assert known.attitude is not None
    assert known.attitude.yaw_rad == pytest.approx(0.5 * 1.99, abs=0.01)
    assert known.position_ned_m is not None
    assert known.position_ned_m[0] == pytest.approx(1.99, abs=0.03)
    assert known.height_m == pytest.approx(3.0, abs=0.02)
    assert known.armed is True
    assert known.mode == "POSCTL"


def test_a_tlog_is_read_with_garbage_between_its_packets(tmp_path: Path) -> None:
    data = LONG_TLOG.read_bytes()
    dirty = tmp_path / "dirty.tlog"
    dirty.write_bytes(b"\xfd noise" + data[:200_000] + b"more noise" * 3)
    clean = read_packets(LONG_TLOG)
    found = read_packets(dirty)
    assert [packet.data for packet in found[:1000]] == [packet.data for packet in clean[:1000]]
    assert found[0].at_ns == clean[0].at_ns


def test_the_offset_says_when_the_first_picture_was_taken(tmp_path: Path, tlog: Path) -> None:
    footage = LooseFootage(video(tmp_path / "v.avi"), tlog, CAMERA, offset_s=16.0)
    pictures = list(footage.pictures())
    first_ns = read_packets(tlog)[0].at_ns
    assert len(pictures) == 20
    assert pictures[0].note.captured_ns == first_ns + 16 * SECOND_NS
    assert pictures[10].note.captured_ns == first_ns + 17 * SECOND_NS
    link = ReplayedLink(AutopilotSettings(), footage.packets)
    link.hear_until(pictures[10].note.done_ns)
    known = link.telemetry_at(pictures[10].note.captured_ns)
    assert known.attitude is not None
    assert known.mode == "POSCTL"


@pytest.mark.parametrize(("offset_s", "gap"), [(500.0, "by 4[0-9]{2}"), (-30.0, "by 2[0-9]")])
def test_telemetry_of_another_time_is_refused_and_by_how_much_it_misses(
    tmp_path: Path, tlog: Path, offset_s: float, gap: str
) -> None:
    with pytest.raises(RecordError, match=f"miss each other {gap}"):
        LooseFootage(video(tmp_path / "v.avi"), tlog, CAMERA, offset_s=offset_s)


def test_pictures_that_outlast_the_telemetry_are_warned_about(tmp_path: Path, tlog: Path) -> None:
    footage = LooseFootage(video(tmp_path / "v.avi", pictures=40), tlog, CAMERA, offset_s=-2.0)
    assert "2.0 s of the pictures have no telemetry" in footage.warnings[0]


def test_a_video_without_time_stamps_is_refused_until_its_rate_is_given(tmp_path: Path, tlog: Path) -> None:
    jpeg = cv2.imencode(".jpg", np.zeros((64, 64, 3), np.uint8))[1].tobytes()
    bare = tmp_path / "bare.mjpeg"
    bare.write_bytes(jpeg * 12)
    with pytest.raises(RecordError, match=r"a bare \.mjpeg stream carries no time stamps: give --fps"):
        LooseFootage(bare, tlog, CAMERA)
    times = [p.note.captured_ns for p in LooseFootage(bare, tlog, CAMERA, fps=4.0).pictures()]
    assert len(times) == 12
    assert {b - a for a, b in pairwise(times)} == {SECOND_NS // 4}
    folder = pictures_in(tmp_path / "pictures")
    with pytest.raises(RecordError, match=r"have no times: give --fps, or timestamps\.txt in it"):
        LooseFootage(folder, tlog, CAMERA)
    assert len(list(LooseFootage(folder, tlog, CAMERA, fps=5.0).pictures())) == 5


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("0 0.1 0.2", "3 times for 5 pictures"),
        ("0 0.1 0.1 0.3 0.4", "picture 2 is stamped 0.100 s, the one before 0.100 s"),
        ("0 a b c d", "cannot be read as seconds"),
        ("0 nan 1 2 3", "not finite"),
    ],
)
def test_wrong_time_stamps_of_pictures_are_named(tmp_path: Path, tlog: Path, lines: str, words: str) -> None:
    folder = pictures_in(tmp_path / "pictures")
    (folder / "timestamps.txt").write_text(lines)
    with pytest.raises(RecordError, match=words):
        LooseFootage(folder, tlog, CAMERA)


def test_time_stamps_beside_pictures_count(tmp_path: Path, tlog: Path) -> None:
    folder = pictures_in(tmp_path / "pictures")
    (folder / "timestamps.txt").write_text("10\n10.5\n10.7\n11\n13\n")
    pictures = list(LooseFootage(folder, tlog, CAMERA, offset_s=1.0).pictures())
    assert [(p.note.captured_ns - pictures[0].note.captured_ns) / 1e9 for p in pictures] == [
        0,
        0.5,
        0.7,
        1.0,
        3.0,
    ]


def test_a_video_with_a_log_is_replayed_on_the_command_line(
    tmp_path: Path, tlog: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    film = video(tmp_path / "v.avi", pictures=3)
    config = tmp_path / "c.toml"
    config.write_text(
        "[camera]\nsource='x'\nwidth=64\nheight=64\nhorizontal_fov_deg=80.0\n[model]\nprovider='cpu'\n"
    )
    assert run("replay", film, tlog, "--config", config, "--offset", 5) == 0
    assert "v.avi: 3 pictures" in capsys.readouterr().out
    assert run("replay", film, tlog) == 2
    assert "need --config" in capsys.readouterr().err
    assert run("replay", film, tlog, "--config", config, "--offset", 5000) == 1
    assert "miss each other" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "words"), [("x.tlog", "is no .tlog"), ("x.bin", "no dataflash log"), ("x.ulg", "is no ULog")]
)
def test_a_foreign_file_is_no_telemetry(tmp_path: Path, name: str, words: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"%PDF-1.7 something else entirely")
    with pytest.raises(RecordError, match=words):
        LooseFootage(video(tmp_path / "v.avi", pictures=2), path, CAMERA)
