"""The layout follows the autopilot: its HEARTBEAT, and for PX4 its version."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from link_support import Conversation, Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.profile_choice import ProfileChoice
from service.fake_autopilot.autopilot import SimulatedAutopilot, make_controller
from service.fake_autopilot.obstacle_map_px4 import ObstacleMap
from service.fake_autopilot.obstacle_words import ObstacleWords
from uavdepth import SectorState, encode_obstacle_distance
from uavdepth.messages.autopilot_profile import PROFILES

S, MS = 1_000_000_000, 1_000_000
ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4


def version(major: int, minor: int, patch: int = 0) -> mavlink.MAVLink_autopilot_version_message:
    word = major << 24 | minor << 16 | patch << 8 | 255
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(0, word, 0, 0, 0, nothing, nothing, nothing, 0, 0, 0)


def asked(talk: Conversation) -> list[int]:
    """When AUTOPILOT_VERSION was asked for."""
    return [
        at
        for at, m in talk.sent_of("COMMAND_LONG")
        if m.command == mavlink.MAV_CMD_REQUEST_MESSAGE and m.param1 == 148
    ]


def layout(talk: Conversation) -> tuple[int, float]:
    """Increment and offset of the OBSTACLE_DISTANCE that leaves now."""
    talk.wait_s(0.1)
    assert talk.session.send_obstacles(clear_scan(), talk.now_ns, talk.now_ns)
    talk.wait_s(0.02)
    message = talk.sent_of("OBSTACLE_DISTANCE")[-1][1]
    return message.increment, message.angle_offset


def test_ardupilot_gets_5_degrees_and_is_not_asked_for_its_version() -> None:
    talk = Conversation(S)
    talk.hear(Voice().heartbeat(autopilot=ARDUPILOT))
    assert layout(talk) == (5, -155.0)
    assert not asked(talk)
    assert talk.session.status(talk.now_ns).profile == "ardupilot"


@pytest.mark.parametrize(
    ("release", "expected"),
    [
        ((1, 13, 3), (10, -180.0)),
        ((1, 15, 4), (10, -180.0)),
        ((1, 17, 0), (10, -180.0)),
        ((0, 0, 0), (10, -180.0)),
        ((1, 18, 0), (5, -155.0)),
        ((2, 0, 1), (5, -155.0)),
    ],
)
def test_px4_gets_what_every_version_reads_until_it_tells_its_own(
    release: tuple[int, int, int], expected: tuple[int, float]
) -> None:
    talk, voice = Conversation(S), Voice()
    talk.hear(voice.heartbeat(autopilot=PX4))
    assert layout(talk) == (10, -180.0)
    assert len(asked(talk)) == 1
    talk.hear(voice.pack(version(*release)))
    assert layout(talk) == expected


def test_a_version_is_asked_for_until_it_comes_ever_more_seldom() -> None:
    talk, voice = Conversation(S), Voice()
    for _ in range(60):
        talk.hear(voice.heartbeat(autopilot=PX4))
        talk.wait_s(1.0)
    gaps = np.diff(asked(talk)) / 1e9
    assert gaps[:4] == pytest.approx([1, 2, 4, 8], abs=0.1)
    assert max(gaps) < 16.1
    talk.hear(voice.pack(version(1, 18)))
    before = len(asked(talk))
    for _ in range(40):
        talk.hear(voice.heartbeat(autopilot=PX4))
        talk.wait_s(1.0)
    assert len(asked(talk)) == before


def test_an_autopilot_that_comes_back_is_asked_once_more_and_may_have_been_updated() -> None:
    talk, voice = Conversation(S), Voice()
    talk.hear(voice.heartbeat(autopilot=PX4))
    talk.wait_s(0.1)
    talk.hear(voice.pack(version(1, 15, 4)))
    assert layout(talk) == (10, -180.0)
    talk.wait_s(4.0)
    talk.hear(voice.heartbeat(autopilot=PX4))
    talk.wait_s(0.1)
    assert len(asked(talk)) == 2
    talk.hear(voice.pack(version(1, 18)))
    assert layout(talk) == (5, -155.0)
    assert any("profile px4 for version 1.18.0" in notice for notice in talk.notices)


def test_the_version_of_another_sender_decides_nothing() -> None:
    talk = Conversation(S)
    talk.hear(Voice().heartbeat(autopilot=PX4))
    talk.hear(Voice(component_id=158).pack(version(1, 18)))
    talk.hear(Voice(system_id=9).pack(version(1, 18)))
    assert layout(talk) == (10, -180.0)


@pytest.mark.parametrize("name", sorted(PROFILES))
@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4, mavlink.MAV_AUTOPILOT_GENERIC])
def test_a_profile_that_is_set_stays(name: str, autopilot: int) -> None:
    talk, voice = Conversation(S, profile=name), Voice()
    talk.hear(voice.heartbeat(autopilot=autopilot))
    talk.hear(voice.pack(version(1, 18)))
    assert layout(talk) == ((10, -180.0) if name == "px4-legacy" else (5, -155.0))
    assert not asked(talk)


def test_another_autopilot_brings_its_own_layout() -> None:
    choice = ProfileChoice("auto")
    choice.on_vehicle("px4")
    choice.on_version(version(1, 18))
    assert choice.profile.name == "px4"
    choice.on_vehicle("px4")
    assert choice.profile.name == "px4-legacy", "what is known of one vehicle says nothing of the next"
    choice.on_vehicle("ardupilot")
    assert choice.profile.name == "ardupilot"


def test_the_limits_of_the_first_scan_hold_for_the_flight() -> None:
    talk = Conversation(S)
    talk.hear(Voice().heartbeat())
    assert layout(talk) == (5, -155.0)
    lowered = dataclasses.replace(clear_scan(), max_distance_m=10.0)
    talk.wait_s(0.1)
    assert not talk.session.send_obstacles(lowered, talk.now_ns, talk.now_ns)
    assert talk.session.status(talk.now_ns).refused_obstacles == {"limits_changed": 1}


@pytest.mark.parametrize("name", sorted(PROFILES))
@pytest.mark.parametrize("bearing", [-155, -30, -10, -5, 0, 5, 10, 30, 180])
def test_px4_1_18_sees_a_pole_of_every_profile_at_its_bearing(name: str, bearing: int) -> None:
    scan = clear_scan()
    sector = int(np.flatnonzero(scan.bearing_deg == bearing)[0])
    scan.state[sector], scan.distance_m[sector] = SectorState.OBSTACLE, 3.0
    known = ObstacleMap()
    known.update(ObstacleWords.from_message(encode_obstacle_distance(scan, profile=PROFILES[name])), 0.0)
    assert known.distance_m(bearing // 5) == 3.0
    elsewhere = [i for i in range(72) if abs((5 * i - bearing + 180) % 360 - 180) > 10]
    assert all(known.distance_m(i) == float("inf") for i in elsewhere)


@pytest.mark.parametrize(("flavor", "profile"), [("ardupilot", "ardupilot"), ("px4", "px4")])
def test_the_fake_autopilots_tell_the_version_that_they_imitate(flavor: str, profile: str) -> None:
    fake = SimulatedAutopilot(make_controller(flavor))  # type: ignore[arg-type]
    talk, voice, channel = Conversation(S), Voice(), fake.open_channel()
    talk.hear(voice.heartbeat(autopilot=fake.controller.autopilot))
    talk.wait_s(0.1)
    for _, message in talk.sent_of("COMMAND_LONG"):
        fake.receive(channel, message)
    for message in fake.collect(channel)[0]:
        talk.hear(voice.pack(message))
    assert talk.session.status(talk.now_ns).profile == profile
