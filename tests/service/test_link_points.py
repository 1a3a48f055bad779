"""R21: OBSTACLE_DISTANCE_3D where it is asked for, to ArduPilot, on lines that carry it, and alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from link_support import Conversation, Flight, Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uavdepth import ObstacleScan, SectorState

S, MS = 1_000_000_000, 1_000_000


def wall_scan() -> ObstacleScan:
    """A wall 6 m ahead over 90 degrees, the rest clear."""
    scan = clear_scan()
    ahead = np.abs(scan.bearing_deg) <= 45
    scan.state[ahead] = SectorState.OBSTACLE
    scan.distance_m[ahead] = 6.0
    return scan


def flying(autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, **settings: object) -> Conversation:
    talk, voice = Conversation(S, obstacle_points=True, **settings), Voice()
    talk.hear(voice.heartbeat(autopilot=autopilot))
    for step in range(20):
        talk.hear(voice.attitude(1000 + 20 * step, pitch=math.radians(-30.0)))
        talk.wait_s(0.02)
    return talk


def offer(talk: Conversation, scan: ObstacleScan) -> bool:
    sent = talk.session.send_obstacles(scan, talk.now_ns - 40 * MS, talk.now_ns)
    talk.wait_s(0.02)
    return sent


def points(talk: Conversation, since_ns: int = 0) -> list[mavlink.MAVLink_message]:
    return [message for _, message in talk.sent_of("OBSTACLE_DISTANCE_3D", since_ns)]


def test_r21_ardupilot_gets_points_and_no_obstacle_distance() -> None:
    talk = flying()
    assert offer(talk, wall_scan())
    found = points(talk)
    assert len(found) == 19
    assert {m.frame for m in found} == {12}
    assert len({m.time_boot_ms for m in found}) == 1
    ahead = max(found, key=lambda m: m.x)
    assert (ahead.x, ahead.y, ahead.z) == pytest.approx((6 * math.cos(math.pi / 6), 0.0, -3.0), abs=0.01)
    assert not talk.sent_of("OBSTACLE_DISTANCE")
    assert talk.session.status(talk.now_ns).sent_obstacles == 1
    assert any("OBSTACLE_DISTANCE_3D" in notice for notice in talk.notices)


def test_it_is_off_unless_asked_for() -> None:
    talk = Conversation(S)
    Flight(talk, Voice()).fly(0.4)
    assert offer(talk, wall_scan())
    assert talk.sent_of("OBSTACLE_DISTANCE")
    assert not points(talk)


def test_each_scan_has_a_stamp_of_its_own() -> None:
    talk, voice, stamps = flying(), Voice(), []
    for step in range(5):
        talk.wait_s(0.08)
        talk.hear(voice.attitude(1500 + 100 * step))
        since_ns = talk.now_ns + 1
        assert offer(talk, wall_scan())
        stamps.append({m.time_boot_ms for m in points(talk, since_ns)})
    assert all(len(found) == 1 for found in stamps)
    assert len(set.union(*stamps)) == 5


def test_px4_gets_obstacle_distance_all_the_same() -> None:
    talk = flying(mavlink.MAV_AUTOPILOT_PX4)
    assert offer(talk, wall_scan())
    assert len(talk.sent_of("OBSTACLE_DISTANCE")) == 1
    assert not points(talk)


def test_without_attitude_no_point_is_guessed() -> None:
    talk = Conversation(S, obstacle_points=True)
    talk.hear(Voice().heartbeat())
    assert not offer(talk, wall_scan())
    assert talk.session.status(talk.now_ns).refused_obstacles == {"no_attitude": 1}
    assert not points(talk)


def test_a_line_too_slow_for_a_burst_of_50_ms_gets_obstacle_distance_and_the_log_says_why() -> None:
    talk = flying(endpoint="serial:/dev/ttyAMA0:115200")
    assert offer(talk, wall_scan())
    assert talk.sent_of("OBSTACLE_DISTANCE")
    assert not points(talk)
    assert "too few for obstacle_points" in (talk.session.status(talk.now_ns).problem or "")


def test_a_fast_serial_line_carries_a_whole_scan_within_one_burst() -> None:
    talk = flying(endpoint="serial:/dev/ttyAMA0:460800")
    for _ in range(10):
        talk.wait_s(0.08)
        talk.hear(Voice().attitude(5000))
    assert talk.session.status(talk.now_ns).obstacle_rate_limit_hz >= 10.0
    talk = flying(endpoint="serial:/dev/ttyAMA0:460800")
    assert offer(talk, wall_scan())
    assert len({at for at, _ in talk.sent_of("OBSTACLE_DISTANCE_3D")}) == 1
    assert len(points(talk)) == 19
