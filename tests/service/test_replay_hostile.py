"""Files that nobody should replay: cut, foreign, of another version, hostile."""

from __future__ import annotations

import io
import json
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from link_support import LOGS
from mcap.writer import CompressionType, Writer
from test_recorder import record_of
from test_replay import flown, run

from service.errors import RecordError
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_reader import RecordReader
from service.recorder.recover import recover
from service.replay.dataflash_file import read_dataflash
from service.replay.flown_log import FlownLog
from service.replay.golden import load_golden
from service.replay.protobuf_fields import protobuf_fields
from service.replay.recorded_images import depth_of, image_of
from service.replay.recording import Recording
from service.replay.tlog_file import read_tlog
from service.replay.ulog_file import read_ulog

MAGIC = b"\x89MCAP0\r\n"
PLACE = st.integers(0, 2**20)
FUZZ = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)


@lru_cache(maxsize=1)
def good_record() -> bytes:
    """The bytes of a small record."""
    with TemporaryDirectory() as folder:
        return record_of(Path(folder), "record.depth_rate_hz=0", pictures=4).read_bytes()


def mcap_with(metadata: dict[str, str] | None, attachment: bytes | None = None) -> bytes:
    """An MCAP file with one message on a topic of ours."""
    buffer = io.BytesIO()
    writer = Writer(buffer, compression=CompressionType.NONE)
    writer.start()
    if metadata is not None:
        writer.add_metadata("uavdepth", metadata)
    if attachment is not None:
        writer.add_attachment(0, 0, "configuration.json", "application/json", attachment)
    channel = writer.register_channel("/perception", "json", 0)
    writer.add_message(channel, 10, b"{}", 10)
    writer.finish()  # type: ignore[no-untyped-call]
    return buffer.getvalue()


SCAN = {"index": 0, "at_ms": 0, "trouble": None}
OURS = {"format": "1", "wall_offset_ns": "0", "vehicle": "v", "version": "0.1.0"}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"\x1a\x45\xdf\xa3 matroska", "is no MCAP file"),
        (mcap_with(None), "no record of uavdepth"),
        (mcap_with({**OURS, "format": "0"}), "record format 0, written by an older version of uavdepth"),
        (mcap_with({**OURS, "format": "7"}), "record format 7, written by a newer version of uavdepth"),
        (mcap_with({"format": "one"}), "has no format and offset"),
        (mcap_with(OURS, b"\xff\xfe"), "configuration.json is no JSON"),
        (mcap_with(OURS, b"[" * 100_000), "configuration.json"),
        (mcap_with(OURS, b"[1]"), "is no table"),
    ],
)
def test_what_is_wrong_with_a_record_is_said_by_name(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordError, match=words):
        Recording([path])


def test_a_cut_record_is_replayed_as_far_as_it_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = flown(tmp_path, pictures=40)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    assert run("replay", path, "--from-depth") == 0
    told = capsys.readouterr()
    assert "it is cut off; what is whole of it is played" in told.err
    assert "pictures" in told.out


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("none.mcap", "no such file or folder"),
        (".", "no .mcap records in it"),
        ("x.txt", "not a .mcap record"),
    ],
)
def test_wrong_command_lines_end_with_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, words: str
) -> None:
    (tmp_path / "x.txt").write_text("hello")
    assert run("replay", tmp_path / name) == 2
    error = capsys.readouterr().err
    assert words in error
    assert "Traceback" not in error


def test_a_chunk_that_claims_to_hold_terabytes_costs_nothing(tmp_path: Path) -> None:
    whole = 2**26
    bomb = zstandard.ZstdCompressor().compress(b"\0" * whole)
    for size in (2**50, whole, 10, 20_000_000):
        inside = struct.pack("<QQQII4sQ", 0, 0, size, 0, 4, b"zstd", len(bomb)) + bomb
        path = tmp_path / "bomb.mcap"
        path.write_bytes(MAGIC + bytes([6]) + struct.pack("<Q", len(inside)) + inside)
        reader = RecordReader(path)
        tracemalloc.start()
        assert list(reader.items()) == []
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert reader.ending is not None
        assert f"claims to hold {size} bytes" in reader.ending.reason
        assert peak < max(2**20, 3 * size if size < whole else 0)
    path.write_bytes(MAGIC + bytes([9]) + struct.pack("<Q", 2**63) + b"x")
    assert list(RecordReader(path).items()) == []


def test_a_record_that_unpacks_to_endless_telemetry_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = record_of(tmp_path)
    Recording([path])
    monkeypatch.setattr("service.replay.recording._MAX_MAVLINK_BYTES", 2_000)
    with pytest.raises(RecordError, match="more than 2000 bytes of MAVLink"):
        Recording([path])


def test_a_broken_record_in_a_folder_is_named_and_the_others_are_played(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = flown(tmp_path)
    broken = [tmp_path / "a.mcap", tmp_path / "z.mcap"]
    for path in broken:
        path.write_bytes(b"\x1a\x45\xdf\xa3 matroska")
    assert run("replay", tmp_path, "--from-depth") == 1
    told = capsys.readouterr()
    assert f"{good.name}: 8 pictures" in told.out
    assert all(f"{path}: is no MCAP file" in told.err for path in broken)
    assert "2 of 3 flights could not be played" in told.err


def only_record_errors(act: Callable[[], Any]) -> None:
    with suppress(RecordError):
        act()


def everything_of(path: Path) -> None:
    """Open, survey and play a record, then rescue it."""
    recording = Recording([path])
    for picture in recording.pictures():
        assert picture.note.index >= 0


@FUZZ
@given(
    edits=st.lists(st.tuples(st.integers(0, 2**20), st.binary(min_size=1, max_size=8)), max_size=6),
    cut=st.integers(0, 2**20),
)
def test_damaged_records_end_in_words(edits: list[tuple[int, bytes]], cut: int) -> None:
    data = bytearray(good_record())
    for at, patch in edits:
        at = 8 + at % (len(data) - 8)
        data[at : at + len(patch)] = patch
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        path.write_bytes(bytes(data[: 8 + cut % len(data)]))
        only_record_errors(lambda: everything_of(path))
        only_record_errors(lambda: recover(path))


@FUZZ
@given(data=st.binary(max_size=400))
def test_noise_behind_the_right_beginning_ends_in_words(data: bytes) -> None:
    with TemporaryDirectory() as folder:
        for name, head, read in (
            ("x.mcap", MAGIC, everything_of),
            ("x.tlog", b"", read_tlog),
            ("x.bin", b"\xa3\x95", read_dataflash),
            ("x.ulg", b"ULog\x01\x12\x35\x01" + bytes(8), read_ulog),
            ("x.json", b'{"format": 1', load_golden),
        ):
            path = Path(folder) / name
            path.write_bytes(head + data)
            only_record_errors(lambda read=read, path=path: read(path))  # type: ignore[misc]


@FUZZ
@given(data=st.binary(max_size=200))
def test_messages_of_noise_end_in_words(data: bytes) -> None:
    for read in (protobuf_fields, image_of, depth_of, PerceptionNote.decode):
        only_record_errors(lambda read=read: read(data))  # type: ignore[misc]


@FUZZ
@given(edits=st.lists(st.tuples(st.integers(0, 2**20), st.integers(0, 255)), min_size=1, max_size=10))
def test_damaged_dataflash_logs_end_in_words(edits: list[tuple[int, int]]) -> None:
    data = bytearray((LOGS / "D_reboot_and_link_pause.BIN").read_bytes()[:6_000])
    for at, value in edits:
        data[at % len(data)] = value
    with TemporaryDirectory() as folder:
        path = Path(folder) / "x.bin"
        path.write_bytes(bytes(data))
        only_record_errors(lambda: read_dataflash(path))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"format": 2}, "format 2; this version reads format 1"),
        ({"scans": [{"index": 0, "at_ms": 0, "trouble": None, "elements": "c c"}]}, "72 elements are needed"),
        (
            {"scans": [{"index": 0, "at_ms": 0, "trouble": None, "elements": "x " * 72}]},
            "centimetres, c or u",
        ),
        ({"tolerances": {"distance_m": -1}}, "tolerances.distance_m"),
        ({"surprise": 1}, "surprise"),
    ],
)
def test_what_is_wrong_with_a_golden_file_is_said(tmp_path: Path, change: dict[str, Any], words: str) -> None:
    path = tmp_path / "g.json"
    path.write_text(json.dumps({"format": 1, "record": "r", "network": "n", "scans": [], **change}))
    with pytest.raises(RecordError, match=words):
        load_golden(path)
    with pytest.raises(RecordError, match="no such file; --update makes it"):
        load_golden(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("data", "words"), [(b"", "no dataflash log"), (b"\xa3\x95" * 50, "no SIM and SIM2")]
)
def test_a_simulated_flight_whose_log_is_damaged_is_refused(tmp_path: Path, data: bytes, words: str) -> None:
    log = tmp_path / "flight.BIN"
    log.write_bytes(data)
    with pytest.raises(RecordError, match=words):
        FlownLog(LOGS / "A_hover_and_forward.tlog", [log])


def test_a_recorded_picture_that_claims_to_be_huge_is_refused_before_memory_is_taken() -> None:
    jpeg = bytearray(cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes())
    struct.pack_into(">HH", jpeg, jpeg.find(b"\xff\xc0") + 5, 30_000, 30_000)
    message = b"\x12" + bytes([len(jpeg) & 0x7F | 0x80, len(jpeg) >> 7]) + bytes(jpeg)
    with pytest.raises(RecordError, match="30000x30000 pixels"):
        image_of(message)
