"""Replays: the same pipeline on the record's clock, and what they are held against."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import structlog
from link_support import SECOND_NS, Conversation, Voice, read_tlog
from program_fakes import HEIGHT, WIDTH, wall_over_ground
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from record_support import WALL_NS, record_settings, result_at

from service.cli import main
from service.clock import ManualClock
from service.errors import ConfigError, RecordError
from service.recorder.recorder import Recorder
from service.replay.comparison import compare
from service.replay.footage import Packets
from service.replay.golden import Golden, GoldenScan, Tolerances, golden_scans
from service.replay.open_footage import flights_in, open_flight
from service.replay.player import Replayed, play
from service.replay.recorded_settings import settings_of
from service.replay.recording import Recording
from service.replay.replayed_link import ReplayedLink
from service.settings import ExtraCameraSettings, Settings
from service.settings.autopilot import AutopilotSettings
from uavdepth.depth.depth_map import DepthMap
from uavdepth.scan.obstacle_scan import SectorState

MS_NS = 1_000_000
WALL_M = 6.0
AHEAD = 31
"""Element along the nose."""


def flown(
    folder: Path,
    *overrides: str,
    pictures: int = 8,
    sigma: float | None = None,
    right_m: float | None = None,
) -> Path:
    """A record of a vehicle 2 m above ground that looks at a wall 6 m ahead, pictures at 10 Hz.

    Args:
        sigma: what depth is said to be uncertain by.
        right_m: a second camera looks to the right at a wall so far away; its measurements end later.
    """
    settings = record_settings(folder, "record.depth_rate_hz=60", "model.provider=cpu", *overrides)
    if right_m is not None:
        looks = {"name": "right", "camera": settings.camera.model_dump(), "mount": {"yaw_deg": 90.0}}
        right = ExtraCameraSettings.model_validate(looks)
        settings = settings.model_copy(update={"extra_camera": (right,)})
    clock = ManualClock(100 * SECOND_NS)
    recorder = Recorder(settings, clock, wall_ns=lambda: WALL_NS)
    voice = Voice()
    depth_m = wall_over_ground(settings.camera.model, WALL_M)
    rng = np.random.default_rng(4)
    for tick in range(20 + 5 * pictures + 10):
        now_ns, boot_ms = clock.now_ns(), 7000 + 20 * tick
        if tick % 20 == 0:
            recorder.offer_packets(voice.heartbeat(), now_ns, False)
        recorder.offer_packets(voice.attitude(boot_ms) + voice.distance(boot_ms, 200), now_ns, False)
        recorder.offer_packets(voice.position(boot_ms, (0.0, 0.0, -2.0), (0.0, 0.0, 0.0)), now_ns, False)
        if tick >= 20 and tick % 5 == 0 and tick < 20 + 5 * pictures:
            result = result_at((tick - 20) // 5, now_ns, rng)
            doubt = None if sigma is None else np.full_like(depth_m, sigma)
            result = replace(result, depth=DepthMap(depth_m, doubt))
            recorder.offer(result, now_ns + 5 * MS_NS, now_ns + 60 * MS_NS)
            if right_m is not None:
                aside = DepthMap(wall_over_ground(settings.camera.model, right_m))
                recorder.offer(
                    replace(result, depth=aside), now_ns + 20 * MS_NS, now_ns + 80 * MS_NS, "right"
                )
        clock.advance_s(0.02)
    recorder.start()
    recorder.stop()
    return next(folder.glob("*.mcap"))


def replayed(path: Path, *overrides: str, from_depth: bool = True) -> list[Replayed]:
    flight = open_flight([path], None, overrides)
    return list(play(flight.settings, flight.footage, from_depth=from_depth))


def same(first: Sequence[Replayed], second: Sequence[Replayed]) -> bool:
    return len(first) == len(second) and all(
        np.array_equal(a.result.scan.distance_m, b.result.scan.distance_m, equal_nan=True)
        and np.array_equal(a.result.scan.state, b.result.scan.state)
        and a.result.telemetry == b.result.telemetry
        and a.result.trouble == b.result.trouble
        for a, b in zip(first, second, strict=True)
    )


def test_recorded_depth_gives_the_wall_again_without_the_network(tmp_path: Path) -> None:
    results = replayed(flown(tmp_path))
    assert len(results) == 8
    for one in results:
        assert one.result.trouble is None
        ahead = one.result.scan.state == SectorState.OBSTACLE
        assert ahead.any()
        assert one.result.scan.nearest_m == pytest.approx(WALL_M, abs=0.1)
        assert one.result.telemetry.height_m == pytest.approx(2.0)


def test_recorded_doubt_shortens_distances_again(tmp_path: Path) -> None:
    for one in replayed(flown(tmp_path, sigma=0.4)):
        assert one.result.scan.nearest_m == pytest.approx(WALL_M * (1 - 0.25 * 0.4), rel=0.04)


def test_two_replays_of_one_record_are_the_same_to_the_bit(tmp_path: Path) -> None:
    path = flown(tmp_path)
    assert same(replayed(path), replayed(path))
    assert same(replayed(path, from_depth=False), replayed(path, from_depth=False)), "through the network"


def test_a_replayed_link_knows_what_the_live_one_knew() -> None:
    """A real flight, with TIMESYNC answers as an autopilot gives them, heard live and from the record."""
    arrivals = read_tlog("A_hover_and_forward.tlog")[:3000]
    start_ns = arrivals[0].at_ns
    live, voice = Conversation(start_ns), Voice()
    packets, answered, asked = [], 0, []
    for arrival in arrivals:
        live.hear(arrival.data, arrival.at_ns)
        packets.append(Packets(arrival.at_ns, arrival.data))
        for at_ns, message in live.sent[answered:]:
            answered += 1
            packets.append(Packets(at_ns, bytes(message.get_msgbuf()), outgoing=True))
            if message.get_type() == "TIMESYNC" and message.tc1 == 0:
                boot_ns = at_ns - start_ns + 2 * SECOND_NS
                answer = voice.pack(mavlink.MAVLink_timesync_message(boot_ns, message.ts1))
                live.hear(answer, arrival.at_ns)
                packets.append(Packets(arrival.at_ns, answer))
        if len(packets) % 50 == 0:
            asked.append(
                (arrival.at_ns, live.session.telemetry_at(arrival.at_ns - 60 * MS_NS, arrival.at_ns))
            )
    order = sorted(range(len(packets)), key=lambda i: packets[i].at_ns)
    link = ReplayedLink(AutopilotSettings(), [packets[i] for i in order])
    assert len(asked) > 20
    for at_ns, known in asked:
        link.hear_until(at_ns)
        assert link.telemetry_at(at_ns - 60 * MS_NS) == known


def test_a_picture_is_measured_with_what_was_known_when_its_measurement_ended(tmp_path: Path) -> None:
    """Yaw at the capture lies between two messages, one of which came while the network ran."""
    path = flown(tmp_path)
    recording = Recording([path])
    voice = Voice()
    packets = [Packets(0, voice.heartbeat())]
    packets += [Packets(ms * MS_NS, voice.attitude(ms, yaw=ms / 1000)) for ms in range(100, 2000, 40)]
    link = ReplayedLink(AutopilotSettings(), packets)
    link.hear_until(1000 * MS_NS)
    attitude = link.telemetry_at(950 * MS_NS).attitude
    assert attitude is not None
    assert attitude.yaw_rad == pytest.approx(0.95, abs=1e-3)
    assert link.telemetry_at(1500 * MS_NS).attitude is None, "the record's future is not known yet"
    assert recording.picture_count == 8


def test_the_parts_of_one_recording_are_one_flight(tmp_path: Path) -> None:
    path = flown(tmp_path)
    (tmp_path / "other.mcap").write_bytes(path.read_bytes())
    second = path.with_name(path.name.replace("-001", "-002"))
    second.write_bytes(path.read_bytes())
    groups = flights_in([tmp_path])
    assert sorted(len(group) for group in groups) == [1, 2]


# -- golden scans


def golden_of(results: Sequence[Replayed], **tolerances: float) -> Golden:
    return Golden(
        record="r", network="n", tolerances=Tolerances.model_validate(tolerances), scans=golden_scans(results)
    )


def with_elements(scan: GoldenScan, changes: dict[int, str]) -> GoldenScan:
    words = scan.elements.split()
    for element, word in changes.items():
        words[element] = word
    return scan.model_copy(update={"elements": " ".join(words)})


def test_a_replay_is_as_golden_within_the_stated_tolerances(tmp_path: Path) -> None:
    golden = golden_of(replayed(flown(tmp_path)))
    element = next(i for i, word in enumerate(golden.scans[0].elements.split()) if word.isdigit())
    near = int(golden.scans[0].elements.split()[element])
    slightly = [with_elements(scan, {element: str(near + 9)}) for scan in golden.scans]
    assert compare(golden, slightly).passed
    far_off = [with_elements(scan, {element: str(near + 100)}) for scan in golden.scans]
    comparison = compare(golden, far_off)
    assert not comparison.passed
    assert len(comparison.differences) == len(golden.scans)
    bearing = -155 + 5 * element
    assert f"{bearing:+d} deg: {near / 100:.2f} m -> {near / 100 + 1:.2f} m" in "\n".join(comparison.lines())


@pytest.mark.parametrize("word", ["c", "u"])
def test_an_obstacle_that_vanishes_from_many_scans_is_a_difference(tmp_path: Path, word: str) -> None:
    golden = golden_of(replayed(flown(tmp_path)))
    gone = [
        with_elements(scan, {i: word for i, old in enumerate(scan.elements.split()) if old.isdigit()})
        for scan in golden.scans
    ]
    assert not compare(golden, gone).passed


def test_scans_that_are_trusted_no_more_are_a_difference(tmp_path: Path) -> None:
    golden = golden_of(replayed(flown(tmp_path)))
    comparison = compare(golden, [s.model_copy(update={"trouble": "stale"}) for s in golden.scans])
    assert "8 of 8 scans differ in trust" in comparison.complaints[0]
    assert not compare(golden, golden.scans[:-1]).passed, "a picture is missing"


def run(*words: object) -> int:
    try:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
    finally:
        structlog.reset_defaults()  # it would log to this test's standard error for ever
    return int(ended.value.code or 0)


def test_update_check_and_picture_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = flown(tmp_path)
    golden = path.with_name(path.name.replace("-001.mcap", ".golden.json"))
    assert run("replay", tmp_path, "--from-depth", "--update") == 0
    assert run("replay", path, "--from-depth", "--check", tmp_path) == 0
    assert "as golden: 8 scans" in capsys.readouterr().out
    table = json.loads(golden.read_text())
    table["tolerances"]["changed_in_scan"] = 1
    table["scans"][3]["elements"] = " ".join(["c"] * 72)
    golden.write_text(json.dumps(table))
    drawn = tmp_path / "drawn.png"
    assert run("replay", path, "--from-depth", "--check", golden, "--picture", drawn) == 1
    told = capsys.readouterr().out
    assert "DIFFERS" in told
    assert "picture 3" in told
    picture = cv2.imread(str(drawn))
    assert picture is not None
    assert (picture == (60, 60, 255)).all(axis=2).any(), "differences are red"
    assert run("replay", path, "--from-depth", "--check", golden, "--picture", drawn) == 2, "it exists"
    assert run("replay", path, "--from-depth", "--check", golden, "--update") == 0
    assert json.loads(golden.read_text())["tolerances"]["changed_in_scan"] == 1, "tolerances stay"
    assert run("replay", path, "--from-depth", "--check", golden) == 0


def test_golden_scans_of_a_flight_with_two_cameras(tmp_path: Path) -> None:
    path, beside = flown(tmp_path, right_m=4.0), AHEAD + 18
    results = replayed(path)
    first, later = results[0].result.scan, [one.result.scan for one in results[1:]]
    assert first.state[beside] == SectorState.UNKNOWN, "the right camera's first picture came later"
    assert all(scan.distance_m[AHEAD] == pytest.approx(WALL_M, abs=0.1) for scan in (first, *later))
    assert all(scan.distance_m[beside] == pytest.approx(4.0, abs=0.1) for scan in later)
    golden = golden_of(results)
    assert compare(golden, golden_scans(replayed(path))).passed
    flight = open_flight([path], None, [])
    alone = flight.settings.model_copy(update={"extra_camera": ()})
    comparison = compare(golden, golden_scans(play(alone, flight.footage, from_depth=True)))
    assert {difference.element for difference in comparison.differences} >= {beside}
    assert AHEAD not in {difference.element for difference in comparison.differences}


def test_a_file_that_is_no_golden_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = flown(tmp_path)
    precious = tmp_path / "notes.json"
    precious.write_text("{}")
    assert run("replay", path, "--from-depth", "--check", precious, "--update") == 1
    assert "--force replaces it" in capsys.readouterr().err
    assert precious.read_text() == "{}"
    assert run("replay", path, "--from-depth", "--check", precious, "--update", "--force") == 0


# -- settings


def test_a_replay_uses_the_recorded_calibration_and_what_the_user_adds(tmp_path: Path) -> None:
    path = flown(tmp_path, "mount.pitch_deg=-7")
    flight = open_flight([path], None, ["scan.max_distance_m=9"])
    assert flight.settings.mount.pitch_deg == -7.0
    assert flight.settings.scan.max_distance_m == 9.0
    assert not flight.settings.zenoh.enabled


def test_keys_of_another_version_are_left_out_and_impossible_values_named() -> None:
    recorded = {"camera": {"source": "0", "horizontal_fov_deg": 80.0, "shutter": 3}, "warp": {"x": 1}}
    warnings: list[str] = []
    settings = settings_of(recorded, "old.mcap", warnings=warnings)
    assert isinstance(settings, Settings)
    assert [words.split()[3] for words in warnings] == ["camera.shutter", "warp"]
    with pytest.raises(RecordError, match=r"old.mcap:\n.*\[camera\] fps: 5000"):
        settings_of({"camera": {"source": "0", "horizontal_fov_deg": 80.0, "fps": 5000.0}}, "old.mcap")
    with pytest.raises(ConfigError, match=r"\[scan\] max_distance_m"):
        settings_of(recorded, "old.mcap", overrides=["scan.max_distance_m=-4"])


def test_pictures_of_another_size_are_refused(tmp_path: Path) -> None:
    path = flown(tmp_path)
    with pytest.raises(RecordError, match=f"is {WIDTH}x{HEIGHT}, \\[camera\\] says 320x192"):
        replayed(path, "camera.width=320", "camera.height=192", from_depth=False)


def test_a_record_without_depth_cannot_be_replayed_from_it(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="holds no depth to replay"):
        replayed(flown(tmp_path, "record.depth_rate_hz=0"))


def test_unknown_stays_unknown_in_golden_words(tmp_path: Path) -> None:
    for one, scan in zip(replays := replayed(flown(tmp_path)), golden_scans(replays), strict=True):
        assert np.array_equal(scan.state, one.result.scan.state)
        both = np.isfinite(one.result.scan.distance_m)
        assert math.isclose(
            float(np.nanmin(scan.distance_m)), float(one.result.scan.distance_m[both].min()), abs_tol=0.011
        )
