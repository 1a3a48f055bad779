"""The recorder: what a record holds, and what can be rescued of one."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from program_fakes import FakeLink, ScriptedCamera, make_settings
from pymavlink import mavutil
from record_support import (
    HEARTBEAT,
    WALL_NS,
    contents,
    record_of,
    record_settings,
    result_at,
    scan_with,
)

from service.clock import ManualClock, MonotonicClock
from service.errors import RecordError
from service.recorder.perception_note import PerceptionNote
from service.recorder.recorder import Recorder
from service.recorder.recover import recover
from service.recorder.sigma_codes import sigma_codes, sigma_of_codes
from service.recorder.tlog_writer import PacketCutter
from service.replay.recorded_images import depth_of
from service.run import Service


def test_a_record_holds_what_foxglove_and_rerun_draw(tmp_path: Path) -> None:
    topics, attachments, metadata, schemas = contents(record_of(tmp_path))
    assert schemas == {
        "/camera/image": "foxglove.CompressedImage",
        "/camera/calibration": "foxglove.CameraCalibration",
        "/camera/depth": "foxglove.RawImage",
        "/scan": "foxglove.LaserScan",
        "/scan/points": "foxglove.PointCloud",
        "/vehicle/pose": "foxglove.PoseInFrame",
        "/tf": "foxglove.FrameTransforms",
        "/perception": "uavdepth.Perception",
        "/mavlink/in": "",
        "/mavlink/out": "",
    }
    assert len(topics["/camera/image"]) == len(topics["/perception"]) == 12
    assert json.loads(attachments["model_card.json"]) == {"name": "net"}
    assert json.loads(attachments["configuration.json"])["camera"]["source"] == "sim:wall"
    assert metadata["uavdepth"]["format"] == "2"
    assert metadata["uavdepth.end"] == {
        "pictures": "12",
        "packets": "24",
        "dropped_pictures": "0",
        "dropped_packets": "0",
    }


def test_log_times_are_wall_clock_by_one_constant(tmp_path: Path) -> None:
    topics, _, metadata, _ = contents(record_of(tmp_path))
    offset_ns = int(metadata["uavdepth"]["wall_offset_ns"])
    for message in topics["/perception"]:
        note = PerceptionNote.decode(message.data)
        assert message.log_time == note.captured_ns + offset_ns
    assert topics["/perception"][0].log_time == WALL_NS


def test_mavlink_lies_in_the_record_byte_for_byte_and_in_the_tlog(tmp_path: Path) -> None:
    path = record_of(tmp_path)
    topics, _, _, _ = contents(path)
    assert [message.data for message in topics["/mavlink/in"]] == [HEARTBEAT] * 12
    assert [message.data for message in topics["/mavlink/out"]] == [HEARTBEAT] * 12
    log = mavutil.mavlink_connection(str(path.with_suffix(".tlog")))
    stamps = []
    while (message := log.recv_match()) is not None:
        assert message.get_type() == "HEARTBEAT"
        stamps.append(message._timestamp)
    assert len(stamps) == 24
    assert stamps[0] == pytest.approx(WALL_NS / 1e9)


def test_recorded_depth_is_never_farther_than_the_measured_one(tmp_path: Path) -> None:
    topics, _, _, _ = contents(record_of(tmp_path, "record.depth_rate_hz=60"))
    depth_m = depth_of(topics["/camera/depth"][0].data)
    assert np.isnan(depth_m[0, :3]).all(), "unknown, infinite and beyond 65.535 m have no code"
    assert depth_m[0, 3] == pytest.approx(65.535)
    assert depth_m[1, 1] == pytest.approx(4.0)


def test_recorded_doubt_is_never_smaller_than_the_measured_one() -> None:
    sigma = np.geomspace(1e-5, 50.0, 2000, dtype=np.float32)
    again = sigma_of_codes(sigma_codes(sigma))
    assert (again >= 0.9999 * sigma).all()
    inside = (sigma > 0.001) & (sigma < 6.0)
    assert (again[inside] <= 1.037 * sigma[inside]).all()
    codes = np.arange(256, dtype=np.uint8)
    assert np.array_equal(sigma_codes(sigma_of_codes(codes)), codes), "nothing grows by being copied"
    assert np.isnan(sigma_of_codes(sigma_codes(np.array([np.nan], np.float32))))


def test_depth_is_thinned_to_its_rate_and_the_camera_may_be_left_out(tmp_path: Path) -> None:
    topics, _, _, _ = contents(record_of(tmp_path, "record.depth_rate_hz=5", "record.camera=false"))
    assert 6 <= len(topics["/camera/depth"]) <= 7
    assert "/camera/image" not in topics


def test_no_password_and_no_key_file_lies_in_a_record(tmp_path: Path) -> None:
    clock = ManualClock(0)
    settings = record_settings(
        tmp_path, "camera.source=rtsp://me:secret@camera/1", "autopilot.signing_key_file=/keys/secret"
    )
    recorder = Recorder(settings, clock, wall_ns=lambda: WALL_NS)
    recorder.offer(result_at(0, 0), 1, 2)
    recorder.start()
    recorder.stop()
    assert b"secret" not in next(tmp_path.glob("*.mcap")).read_bytes()


def test_the_exact_scan_comes_back_from_its_note() -> None:
    result = result_at(3, 77)
    note = PerceptionNote.decode(PerceptionNote.of(result, 80, 90).encode())
    assert note.scan is not None
    again, scan = note.scan.scan(), scan_with()
    assert np.array_equal(again.distance_m, scan.distance_m, equal_nan=True)
    assert np.array_equal(again.state, scan.state)
    assert note.telemetry.telemetry(77) == result.telemetry


def test_recover_overwrites_nothing_without_force(tmp_path: Path) -> None:
    path = record_of(tmp_path)
    output = tmp_path / "out.mcap"
    output.write_bytes(b"precious")
    with pytest.raises(RecordError, match="exists; --force replaces it"):
        recover(path, output)
    assert output.read_bytes() == b"precious"
    assert recover(path, output, force=True).ending.whole
    with pytest.raises(RecordError, match="is the damaged file itself"):
        recover(path, path, force=True)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"PK\x03\x04 a zip file", "is no MCAP file"),
        (b"\x89MCAP0\r\n", "holds no message"),
    ],
)
def test_recover_says_what_is_wrong_with_a_foreign_file(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordError, match=words):
        recover(path)
    assert sorted(tmp_path.iterdir()) == [path]


def test_packets_are_cut_out_of_any_stream() -> None:
    cutter = PacketCutter()
    stream = b"noise" + HEARTBEAT * 3 + b"\x00" + HEARTBEAT
    cut = [packet for i in range(0, len(stream), 7) for packet in cutter.cut(stream[i : i + 7])]
    assert cut.count(HEARTBEAT) >= 3
    assert all(packet == HEARTBEAT for packet in cut)


def rerun_program() -> str | None:
    """Rerun's own command line, where it is installed."""
    found = importlib.util.find_spec("rerun_cli")
    beside = Path(found.origin).with_name("rerun") if found is not None and found.origin else None
    return str(beside) if beside is not None and beside.exists() else shutil.which("rerun")


def test_reruns_own_converter_reads_pictures_depth_and_points(tmp_path: Path) -> None:
    program = rerun_program()
    if program is None:
        pytest.skip("Rerun is not installed (pip install rerun-sdk)")
    record, converted = record_of(tmp_path), tmp_path / "record.rrd"
    told = [
        subprocess.run(
            [program, *words],
            check=True,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            timeout=60,
        ).stdout
        for words in (["mcap", "convert", record, "-o", converted], ["rrd", "print", converted])
    ]
    # Image:buffer is the depth in millimetres.
    for component in ("EncodedImage", "Image:buffer", "Pinhole", "Points3D", "Transform3D"):
        assert component in told[1]


def test_a_recording_service_says_so(tmp_path: Path) -> None:
    clock = MonotonicClock()
    off = make_settings()
    assert (
        Service(off, clock, link=FakeLink(clock), camera=ScriptedCamera(off, clock, [])).status().recording
        is None
    )
    on = record_settings(tmp_path)
    service = Service(on, clock, link=FakeLink(clock), camera=ScriptedCamera(on, clock, []))
    assert service.status().recording is False
