"""Recorded flights with a reboot, a 5 s loss and a 3 s stall, played through the real link code."""

from __future__ import annotations

import numpy as np
import pytest
from link_support import (
    SECOND_NS,
    Arrival,
    Conversation,
    attitude_stamps,
    message_id,
    read_tlog,
)
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.session import LinkSession

MS = 1_000_000


@pytest.fixture(scope="module")
def arrivals() -> list[Arrival]:
    return read_tlog("D_reboot_and_link_pause.tlog")


@pytest.fixture(scope="module")
def stamps(arrivals: list[Arrival]) -> NDArray[np.int64]:
    """Arrival and boot time of each recorded ATTITUDE."""
    return attitude_stamps(arrivals)


def play(talk: Conversation, arrivals: list[Arrival], until_ns: int) -> None:
    """Let the bytes arrive as recorded, from where the clock stands until `until_ns`."""
    for arrival in arrivals:
        if talk.now_ns < arrival.at_ns <= until_ns:
            talk.hear(arrival.data, arrival.at_ns)
    talk.wait_until(until_ns)


def gaps(stamps: NDArray[np.int64], longer_than_s: float) -> list[tuple[int, int]]:
    """Silences of the recorded ATTITUDE: (last arrival before, first arrival after)."""
    at_ns = stamps[:, 0]
    where = np.flatnonzero(np.diff(at_ns) > longer_than_s * SECOND_NS)
    return [(int(at_ns[i]), int(at_ns[i + 1])) for i in where]


def recorded_roll_pitch(arrivals: list[Arrival], after_ns: int) -> NDArray[np.float64]:
    """(N, 3) boot time in ns, roll and pitch of every ATTITUDE that arrived after `after_ns`."""
    codec = mavlink.MAVLink(None)
    found = [
        a for a in arrivals if a.at_ns > after_ns and message_id(a.data) == mavlink.MAVLINK_MSG_ID_ATTITUDE
    ]
    messages = [codec.decode(bytearray(a.data)) for a in found]
    return np.array([(m.time_boot_ms * MS, m.roll, m.pitch) for m in messages])


@pytest.mark.parametrize("name", ["C_s_turns.tlog", "D_reboot_and_link_pause.tlog", "px4_118_manoeuvre.tlog"])
def test_a_recorded_flight_is_followed_from_end_to_end(name: str) -> None:
    arrivals = read_tlog(name)
    talk = Conversation(arrivals[0].at_ns)
    play(talk, arrivals, arrivals[-1].at_ns)
    status = talk.session.status(talk.now_ns)
    assert status.connected
    assert status.system_id == 1
    assert status.autopilot == ("px4" if name.startswith("px4") else "ardupilot")
    assert status.rates_hz["ATTITUDE"] == pytest.approx(49.5, abs=2.5)
    assert status.bad_bytes == 0
    assert status.clock_steps == 0
    assert status.reboots == (1 if name.startswith("D") else 0)
    assert talk.session.telemetry_at(talk.now_ns - 50 * MS, talk.now_ns).attitude is not None


def test_a_reboot_forgets_the_old_attitude_and_asks_for_the_streams_again(
    arrivals: list[Arrival], stamps: NDArray[np.int64]
) -> None:
    reboot = int(np.flatnonzero(np.diff(stamps[:, 1]) < 0)[0])
    last_ns, first_ns = int(stamps[reboot, 0]), int(stamps[reboot + 1, 0])
    talk = Conversation(arrivals[0].at_ns)
    play(talk, arrivals, last_ns + 200 * MS)
    before = talk.session.status(talk.now_ns)
    assert before.reboots == 0
    play(talk, arrivals, first_ns - 1)
    # The autopilot is heard again before it streams anything: only the missing rate tells.
    asked = talk.sent_of("COMMAND_LONG", last_ns + SECOND_NS)
    assert {m.param1 for _, m in asked} >= {mavlink.MAVLINK_MSG_ID_ATTITUDE}
    assert talk.session.telemetry_at(talk.now_ns, talk.now_ns).attitude is None
    play(talk, arrivals, first_ns + SECOND_NS)
    after = talk.session.status(talk.now_ns)
    assert after.reboots == 1
    assert after.connected
    assert talk.session.telemetry_at(talk.now_ns - 60 * MS, talk.now_ns).attitude is not None
    assert talk.session.telemetry_at(last_ns - 100 * MS, talk.now_ns).attitude is None, (
        "another boot's attitude"
    )
    again = talk.sent_of("COMMAND_LONG", first_ns - 1)
    assert {m.param1 for _, m in again} >= {30.0, 32.0, 132.0}


def test_five_seconds_of_loss_leave_no_stale_attitude(
    arrivals: list[Arrival], stamps: NDArray[np.int64]
) -> None:
    lost_ns, back_ns = next(gap for gap in gaps(stamps, 4.5) if gap[1] - gap[0] < 6 * SECOND_NS)
    talk = Conversation(lost_ns - 20 * SECOND_NS)
    play(talk, arrivals, lost_ns)
    assert talk.session.telemetry_at(lost_ns - 60 * MS, lost_ns).attitude is not None
    while talk.now_ns < back_ns - 60 * MS:
        talk.wait_s(0.05)
        telemetry = talk.session.telemetry_at(talk.now_ns, talk.now_ns)
        beyond_ms = (talk.now_ns - lost_ns) / MS
        assert telemetry.attitude is None or beyond_ms <= 60
        assert telemetry.position_ned_m is None or beyond_ms <= 60
        assert telemetry.height_m is None or beyond_ms <= 600
    status = talk.session.status(talk.now_ns)
    assert not status.connected
    assert status.problem is not None
    assert "silent" in status.problem
    assert talk.session.telemetry_at(talk.now_ns, talk.now_ns).armed is None
    play(talk, arrivals, back_ns + SECOND_NS)
    assert talk.session.status(talk.now_ns).connected
    assert talk.session.status(talk.now_ns).problem is None
    assert talk.session.telemetry_at(talk.now_ns - 60 * MS, talk.now_ns).attitude is not None
    assert {m.param1 for _, m in talk.sent_of("COMMAND_LONG", back_ns)} == {30.0, 32.0, 132.0}


def test_a_burst_after_a_stall_is_put_where_it_belongs(
    arrivals: list[Arrival], stamps: NDArray[np.int64]
) -> None:
    stall_ns, burst_ns = next(gap for gap in gaps(stamps, 2.5) if gap[1] - gap[0] < 3.5 * SECOND_NS)
    talk = Conversation(stall_ns - 20 * SECOND_NS)
    play(talk, arrivals, stall_ns)
    recorded = recorded_roll_pitch(arrivals, stall_ns)
    for arrival in arrivals:  # during the stall and, message by message, through the burst
        if not stall_ns < arrival.at_ns < burst_ns + 100 * MS:
            continue
        talk.hear(arrival.data, arrival.at_ns)
        offset_ns = offset(talk.session, talk.now_ns)
        newest = talk.session.newest_pose(arrival.at_ns)
        assert newest.attitude is None or arrival.at_ns - newest.at_ns <= 500 * MS
        now = talk.session.telemetry_at(arrival.at_ns, arrival.at_ns).attitude
        if now is not None:  # only ever an attitude stamped within the 50 ms that may be bridged
            boot_ns = arrival.at_ns - offset_ns
            i = int(np.argmin(np.abs(recorded[:, 0] - boot_ns)))
            assert abs(recorded[i, 0] - boot_ns) <= 60 * MS
            assert abs(np.degrees(now.roll_rad - recorded[i, 1])) < 1.5
    # Afterwards the stall's own moments are known: the attitudes were stored by their stamps.
    for share in (0.2, 0.5, 0.8):
        moment_ns = round(stall_ns + share * (burst_ns - stall_ns))
        attitude = talk.session.telemetry_at(moment_ns, talk.now_ns).attitude
        boot_ns = moment_ns - offset(talk.session, talk.now_ns)
        assert attitude is not None
        assert np.degrees(attitude.roll_rad) == pytest.approx(
            np.degrees(np.interp(boot_ns, recorded[:, 0], recorded[:, 1])), abs=0.3
        )
        assert np.degrees(attitude.pitch_rad) == pytest.approx(
            np.degrees(np.interp(boot_ns, recorded[:, 0], recorded[:, 2])), abs=0.3
        )
    assert talk.session.status(talk.now_ns).clock_steps == 0
    play(talk, arrivals, burst_ns + SECOND_NS)
    assert talk.session.telemetry_at(talk.now_ns - 60 * MS, talk.now_ns).attitude is not None


def offset(session: LinkSession, now_ns: int) -> int:
    offset_s = session.status(now_ns).clock_offset_s
    assert offset_s is not None
    return round(offset_s * 1e9)


def test_a_burst_does_not_move_the_clock(arrivals: list[Arrival], stamps: NDArray[np.int64]) -> None:
    stall_ns, burst_ns = next(gap for gap in gaps(stamps, 2.5) if gap[1] - gap[0] < 3.5 * SECOND_NS)
    talk = Conversation(stall_ns - 20 * SECOND_NS)
    play(talk, arrivals, stall_ns)
    before_ns = offset(talk.session, talk.now_ns)
    for arrival in arrivals:
        if stall_ns < arrival.at_ns < burst_ns + 100 * MS:
            talk.hear(arrival.data, arrival.at_ns)
            assert abs(offset(talk.session, talk.now_ns) - before_ns) < 20 * MS
