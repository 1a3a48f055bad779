"""The recorder: what a record holds, and what becomes of a flight whose disk is slow or full."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from link_support import Voice
from mcap.reader import make_reader
from numpy.typing import NDArray
from program_fakes import FakeLink, ScriptedCamera, make_settings, picture, wait_until
from pymavlink import mavutil
from record_support import SECOND_NS, WALL_NS, record_settings, result_at, scan_with

from service.clock import ManualClock, MonotonicClock
from service.errors import RecordError
from service.pipeline import Perception, make_scanner
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_writer import RecordWriter
from service.recorder.recorder import Recorder
from service.recorder.recover import recover
from service.recorder.shelf import Shelf
from service.recorder.sigma_codes import sigma_codes, sigma_of_codes
from service.recorder.tlog_writer import PacketCutter
from service.replay.recorded_images import depth_of, image_of
from service.run import Service
from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.hints import Hints

HEARTBEAT = Voice().heartbeat()
HERE = Path(__file__).parent


def record_of(folder: Path, *overrides: str, pictures: int = 12) -> Path:
    """A record of pictures at 10 Hz and a heartbeat each way between them."""
    clock = ManualClock(5 * SECOND_NS)
    recorder = Recorder(
        record_settings(folder, *overrides), clock, lambda: '{"name": "net"}', lambda: WALL_NS
    )
    for i in range(pictures):
        at_ns = clock.now_ns()
        recorder.offer_packets(HEARTBEAT, at_ns, False)
        recorder.offer_packets(HEARTBEAT, at_ns + 1, True)
        recorder.offer(result_at(i, at_ns), at_ns + 10, at_ns + 20)
        clock.advance_s(0.1)
    recorder.start()
    recorder.stop()
    return sorted(folder.glob("*.mcap"))[0]


def contents(
    path: Path,
) -> tuple[dict[str, list[Any]], dict[str, bytes], dict[str, dict[str, str]], dict[str, str]]:
    """Messages by topic, attachments, metadata, schema names by topic."""
    topics: dict[str, list[Any]] = {}
    schemas: dict[str, str] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            topics.setdefault(channel.topic, []).append(message)
            schemas[channel.topic] = schema.name if schema else ""
        attachments = {item.name: item.data for item in reader.iter_attachments()}
        metadata = {item.name: dict(item.metadata) for item in reader.iter_metadata()}
    return topics, attachments, metadata, schemas


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


def test_a_large_record_goes_on_in_new_files_and_the_oldest_are_deleted(tmp_path: Path) -> None:
    foreign = tmp_path / "mine.mcap"
    foreign.write_bytes(b"x" * 100)
    clock = ManualClock(0)
    rng = np.random.default_rng(0)
    settings = record_settings(
        tmp_path, "record.max_file_mib=1", "record.max_total_mib=3", "record.depth_rate_hz=0"
    )
    recorder = Recorder(settings, clock, wall_ns=lambda: WALL_NS)
    recorder.start()
    for i in range(300):
        recorder.offer(result_at(i, clock.now_ns(), rng), 0, 0)
        if i % 20 == 19:
            wait_until(lambda: recorder.status().pictures >= i - 1)  # noqa: B023
        clock.advance_s(0.1)
    recorder.stop()
    kept = sorted(tmp_path.glob("uavdepth-*.mcap"))
    assert recorder.status().dropped_pictures == 0
    assert not kept[0].name.endswith("-001.mcap"), "the oldest part made room"
    assert sum(path.stat().st_size for path in kept) < 4.5 * 1024 * 1024
    assert foreign.exists()
    for path in kept:
        assert contents(path)[0]["/camera/image"]


def test_a_full_folder_that_may_not_be_thinned_stops_the_recording_in_words(tmp_path: Path) -> None:
    full = tmp_path / "uavdepth-uav1-20250101T000000Z-001.mcap"
    full.write_bytes(b"x" * 3 * 1024 * 1024)
    clock = ManualClock(0)
    settings = record_settings(tmp_path, "record.max_total_mib=2", "record.when_full=stop")
    recorder = Recorder(settings, clock, wall_ns=lambda: WALL_NS)
    recorder.start()
    recorder.offer(result_at(0, 0), 1, 2)
    wait_until(lambda: recorder.status().dropped_pictures == 1)
    status = recorder.status()
    recorder.stop()
    assert not status.recording
    assert "3 MiB of records, max_total_mib is 2" in status.problem
    assert full.exists()


def test_the_thousandth_part_of_a_record_is_counted_and_deleted_too(tmp_path: Path) -> None:
    settings = record_settings(tmp_path, "record.max_total_mib=2").record
    old = tmp_path / "uavdepth-uav1-20250101T000000Z-1000.mcap"
    old.write_bytes(b"x" * 3 * 1024 * 1024)
    shelf = Shelf(settings, "uav1")
    shelf.make_room(shelf.new_take(WALL_NS), 1)
    assert not old.exists()


class StuckWriter(RecordWriter):
    """A disk that does not answer until it is let go."""

    released = threading.Event()

    def note(self, note: PerceptionNote, camera: str = "") -> None:
        self.released.wait()
        super().note(note, camera)


def test_a_disk_that_hangs_costs_pictures_and_no_time_of_the_flight(tmp_path: Path) -> None:
    StuckWriter.released.clear()
    clock = MonotonicClock()
    settings = record_settings(tmp_path, "record.queue_mib=4")
    recorder = Recorder(settings, clock, open_writer=StuckWriter)
    recorder.start()
    try:
        for i in range(200):
            recorder.offer(result_at(i, i), i, i)
        for i in range(100):
            recorder.offer_packets(HEARTBEAT, i, False)
        status = recorder.status()
        assert status.dropped_pictures > 100, "4 MiB hold some forty of these pictures"
        assert status.dropped_packets == 0, "packets have room of their own"
    finally:
        StuckWriter.released.set()
        recorder.stop()
    status = recorder.status()
    assert status.pictures + status.dropped_pictures == 200
    assert status.packets == 100


class WallEverywhere:
    """A network that answers in metres."""

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        return DepthMap(np.full(image_bgr.shape[:2], 5.0, np.float32), None)


def test_the_service_flies_on_while_the_recorders_disk_hangs(tmp_path: Path) -> None:
    StuckWriter.released.clear()
    clock = MonotonicClock()
    settings = record_settings(tmp_path, "record.queue_mib=4")
    link = FakeLink(clock)
    service = Service(
        settings,
        clock,
        link=link,
        camera=ScriptedCamera(settings, clock, [picture(1)], forever=True),
        load_perception=lambda s: Perception(s, WallEverywhere(), None, make_scanner(s)),
    )
    assert service._recorder is not None
    service._recorder._open_writer = StuckWriter
    try:
        service.start()
        wait_until(lambda: service.status().frames > 100)
        wait_until(lambda: service._recorder is not None and service._recorder.status().dropped_pictures > 0)
    finally:
        StuckWriter.released.set()
        service.stop()


SCRIPT = """
    import resource, sys, time
    sys.path.insert(0, {here!r})
    from pathlib import Path
    import numpy as np
    import structlog
    from record_support import record_settings, result_at
    from service.clock import ManualClock
    from service.recorder.recorder import Recorder
    structlog.configure(logger_factory=structlog.PrintLoggerFactory(sys.stderr))
    limit = int(sys.argv[2])
    if limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    clock = ManualClock(0)
    recorder = Recorder(record_settings(Path(sys.argv[1]), "record.tlog=false"), clock)
    recorder.start()
    rng = np.random.default_rng(0)
    for i in range(100_000):
        at_ns = clock.now_ns()
        recorder.offer_status(b"{{}}")
        recorder.offer_packets(b"packet", at_ns, False)
        recorder.offer(result_at(i, at_ns, rng), at_ns, at_ns)
        while recorder.status().pictures <= i and not recorder.status().problem:
            time.sleep(0.0005)
        print(at_ns, recorder.status().problem, flush=True)
        clock.advance_s(0.02)
"""


def recording_process(folder: Path, limit: int = 0) -> subprocess.Popen[str]:
    script = textwrap.dedent(SCRIPT).format(here=str(HERE))
    words = [sys.executable, "-c", script, str(folder), str(limit)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def test_after_kill_9_at_most_the_last_second_is_lost(tmp_path: Path) -> None:
    """A second of the recorder's own clock, which goes on when the recorder has taken what it was given."""
    process = recording_process(tmp_path)
    assert process.stdout is not None
    last_ns = 0
    for line in process.stdout:
        last_ns = int(line.split()[0])
        if last_ns > 3.3 * SECOND_NS:
            break
    os.kill(process.pid, signal.SIGKILL)
    last_ns = max([last_ns, *(int(line.split()[0]) for line in process.stdout if line.endswith("\n"))])
    process.wait()
    cut = next(tmp_path.glob("*.mcap"))
    with pytest.raises(Exception, match=r".*"), cut.open("rb") as file:
        next(make_reader(file).iter_messages())
    rescued = recover(cut)
    assert not rescued.ending.whole
    topics, attachments, metadata, _ = contents(rescued.output)
    offset_ns = int(metadata["uavdepth"]["wall_offset_ns"])
    assert {"/perception", "/camera/image", "/mavlink/in", "/status"} <= topics.keys()
    for topic in topics.keys() - {"/camera/depth"}:  # which is thinned
        assert topics[topic][-1].log_time - offset_ns >= last_ns - SECOND_NS, topic
    assert [PerceptionNote.decode(m.data).index for m in topics["/perception"]] == list(
        range(len(topics["/perception"]))
    ), "nothing is missing before"
    assert "configuration.json" in attachments
    assert metadata["uavdepth"]["vehicle"] == "uav1"
    assert image_of(topics["/camera/image"][-1].data).shape == (96, 160, 3)


def test_what_waits_for_a_disk_that_hangs_is_told(tmp_path: Path) -> None:
    StuckWriter.released.clear()
    clock = ManualClock(0)
    recorder = Recorder(record_settings(tmp_path), clock, open_writer=StuckWriter)
    recorder.start()
    try:
        for i in range(2):
            recorder.offer(result_at(i, 0), 0, 0)
        wait_until(lambda: recorder.status().recording)
        assert recorder.status().problem == ""
        clock.advance_s(1.5)
        assert recorder.status().problem == "1.5 s behind: disk or processor is slow"
    finally:
        StuckWriter.released.set()
        recorder.stop()


def test_a_full_disk_ends_the_file_in_words_and_the_flight_goes_on(tmp_path: Path) -> None:
    process = recording_process(tmp_path, 400_000)
    assert process.stdout is not None
    problems = []
    for line in process.stdout:
        problems.append(line.split(" ", 1)[1].strip())
        if len(problems) > 20 and problems[-20]:
            break
    process.kill()
    process.wait()
    process.stdout.close()
    assert "File too large" in problems[-1], "twenty offers after the disk was full nothing has broken"
    first = sorted(tmp_path.glob("*.mcap"))[0]
    assert recover(first, tmp_path / "rescued.mcap").messages > 10


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
