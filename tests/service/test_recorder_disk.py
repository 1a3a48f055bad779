"""The recorder when its disk is full, slow or hangs, or its process is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray
from program_fakes import FakeLink, ScriptedCamera, picture, wait_until
from record_support import HEARTBEAT, SECOND_NS, WALL_NS, contents, record_settings, result_at

from service.clock import ManualClock, MonotonicClock
from service.pipeline import Perception, make_scanner
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_writer import RecordWriter
from service.recorder.recorder import Recorder
from service.recorder.recover import recover
from service.recorder.shelf import Shelf
from service.replay.recorded_images import image_of
from service.run import Service
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints

HERE = Path(__file__).parent


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
