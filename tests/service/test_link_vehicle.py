"""Who is listened to, and what is said of it."""

from __future__ import annotations

import pytest
from link_support import Conversation, Flight, Voice
from pymavlink.dialects.v20 import ardupilotmega as mavlink

S = 1_000_000_000


@pytest.mark.parametrize("system_id", [1, 2, 42, 255])
def test_r18_the_system_id_is_learnt_and_used(system_id: int) -> None:
    talk = Conversation(S)
    Flight(talk, Voice(system_id)).fly(1.0)
    assert talk.session.status(talk.now_ns).system_id == system_id
    talk.wait_s(1.0)
    assert talk.sent_of("HEARTBEAT")[-1][1].get_srcSystem() == system_id
    assert {m.get_srcComponent() for _, m in talk.sent} == {196}
    assert {m.target_system for _, m in talk.sent_of("COMMAND_LONG")} == {system_id}


def test_a_ground_station_gimbal_or_companion_is_no_autopilot() -> None:
    talk = Conversation(S)
    talk.hear(Voice(255, 190).heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID))
    talk.hear(Voice(255, 1).heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA))
    talk.hear(Voice(1, 154).heartbeat(mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_INVALID))
    talk.hear(Voice(1, 196).heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID))
    talk.hear(Voice(1, 191).heartbeat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_PX4))
    talk.hear(Voice(0, 1).heartbeat())
    assert talk.session.status(talk.now_ns).system_id is None


def test_a_ground_stations_heartbeat_does_not_arm_or_change_the_mode() -> None:
    talk, gcs = Conversation(S), Voice(255, 190)
    Flight(talk, Voice(7)).fly(1.0)
    talk.hear(gcs.heartbeat(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, base_mode=0xFF))
    telemetry = talk.session.telemetry_at(talk.now_ns, talk.now_ns)
    assert telemetry.armed is False
    assert telemetry.mode == "LOITER"


@pytest.mark.parametrize(
    ("autopilot", "custom_mode", "flavor", "mode"),
    [
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 5, "ardupilot", "LOITER"),
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 4, "ardupilot", "GUIDED"),
        (mavlink.MAV_AUTOPILOT_PX4, 3 << 16, "px4", "POSCTL"),
        (mavlink.MAV_AUTOPILOT_PX4, 4 << 16 | 3 << 24, "px4", "LOITER"),
        (mavlink.MAV_AUTOPILOT_GENERIC, 5, "generic", "LOITER"),
        (14, 5, "autopilot 14", "LOITER"),
    ],
)
def test_flavor_and_mode_go_by_name(autopilot: int, custom_mode: int, flavor: str, mode: str) -> None:
    talk = Conversation(S)
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    talk.hear(Voice().heartbeat(autopilot=autopilot, base_mode=base, custom_mode=custom_mode))
    status = talk.session.status(talk.now_ns)
    assert (status.autopilot, status.mode, status.armed) == (flavor, mode, True)


def test_the_first_of_two_autopilots_is_kept_and_the_other_told() -> None:
    talk, other = Conversation(S), Voice(9)
    flight = Flight(talk, Voice(3))
    for _ in range(5):
        flight.fly(1.0)
        talk.hear(other.heartbeat())
        talk.hear(other.attitude(flight.boot_ms(talk.now_ns), roll=1.0))
    status = talk.session.status(talk.now_ns)
    assert status.system_id == 3
    assert status.other_system_ids == (9,)
    assert len([notice for notice in talk.notices if "another autopilot" in notice]) == 1
    attitude = talk.session.telemetry_at(talk.now_ns - 50_000_000, talk.now_ns).attitude
    assert attitude is not None
    assert attitude.roll_rad == pytest.approx(0.0, abs=1e-6)


def test_two_autopilots_of_one_id_are_told_apart_by_their_address() -> None:
    talk, voice = Conversation(S), Voice(1)
    here, there = ("10.0.0.1", 14550), ("10.0.0.2", 14550)
    for step in range(100):
        if step % 50 == 0:
            talk.hear(voice.heartbeat(), source=here)
            talk.hear(voice.heartbeat(custom_mode=6), source=there)
        talk.hear(voice.attitude(10_000 + step * 20, roll=0.2), source=here)
        talk.hear(voice.attitude(77_000 + step * 20, roll=-0.9), source=there)
        talk.wait_s(0.02)
    assert talk.session.destination == here
    attitude = talk.session.telemetry_at(talk.now_ns - 50_000_000, talk.now_ns).attitude
    assert attitude is not None
    assert attitude.roll_rad == pytest.approx(0.2, abs=1e-6)
    assert talk.session.status(talk.now_ns).reboots == 0


def test_a_changed_address_is_followed_after_a_silence() -> None:
    talk, voice = Conversation(S), Voice(1)
    talk.hear(voice.heartbeat(), source=("10.0.0.1", 1))
    talk.wait_s(3.5)
    talk.hear(voice.heartbeat(), source=("10.0.0.1", 2))
    assert talk.session.destination == ("10.0.0.1", 2)


def test_a_changed_system_id_is_followed_after_ten_seconds() -> None:
    talk = Conversation(S)
    talk.hear(Voice(1).heartbeat())
    for _ in range(9):
        talk.wait_s(1.0)
        talk.hear(Voice(2).heartbeat())
    assert talk.session.status(talk.now_ns).system_id == 1
    talk.wait_s(1.5)
    talk.hear(Voice(2).heartbeat())
    assert talk.session.status(talk.now_ns).system_id == 2


def test_a_configured_system_id_is_the_only_one() -> None:
    talk = Conversation(S, system_id=5)
    talk.hear(Voice(4).heartbeat())
    assert talk.session.status(talk.now_ns).system_id is None
    talk.hear(Voice(5).heartbeat())
    assert talk.session.status(talk.now_ns).system_id == 5
    assert talk.sent_of("HEARTBEAT")[0][1].get_srcSystem() == 5


def test_a_silent_autopilot_is_told_once_and_no_obstacle_leaves() -> None:
    talk = Conversation(S)
    talk.wait_s(20.0)
    status = talk.session.status(talk.now_ns)
    assert not status.connected
    assert status.problem is not None
    assert "HEARTBEAT" in status.problem
    assert "udp:0.0.0.0:14550" in status.problem
    assert len([notice for notice in talk.notices if "HEARTBEAT" in notice]) == 1
    assert len(talk.sent_of("HEARTBEAT")) == pytest.approx(20, abs=2)
    assert talk.sent_of("COMMAND_LONG") == []


def test_r15_mavlink_1_is_told_once_answered_with_mavlink_2_and_taken_back() -> None:
    talk, voice = Conversation(S), Voice(1)
    for _ in range(5):
        talk.hear(voice.heartbeat(mavlink1=True))
        talk.wait_s(1.0)
    status = talk.session.status(talk.now_ns)
    assert status.mavlink1_seen
    assert status.connected
    assert status.problem is not None
    assert "MAVLink 1" in status.problem
    assert len([notice for notice in talk.notices if "MAVLink 1" in notice]) == 1
    assert all(message.get_msgbuf()[0] == 0xFD for _, message in talk.sent)
    talk.hear(voice.heartbeat())
    assert not talk.session.status(talk.now_ns).mavlink1_seen
    assert talk.session.status(talk.now_ns).problem is None
