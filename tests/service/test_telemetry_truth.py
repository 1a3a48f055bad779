"""Telemetry at capture time, held against what the simulator knew (flight C: S-turns, climbs)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from link_support import (
    SECOND_NS,
    Arrival,
    Conversation,
    TrueOffset,
    Voice,
    dataflash_rows,
    decoded,
    message_id,
    read_tlog,
)
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.motion_history import MotionHistory, MotionLimits
from uavdepth.attitude import Attitude

LATENCY_NS = 80_000_000
"""A frame is looked up this long after its exposure, when the network is done with it."""


@dataclass(frozen=True)
class Recorded:
    arrivals: list[Arrival]
    offset: TrueOffset
    truth_deg: NDArray[np.float64]
    estimate_deg: NDArray[np.float64]


@pytest.fixture(scope="module")
def flight() -> Recorded:
    """SIM rows are the truth at 10 Hz, ATT rows the autopilot's own estimate, both at its boot time."""
    arrivals = read_tlog("C_s_turns.tlog")
    rows = dataflash_rows("C_s_turns.BIN", "SIM", "ATT")
    return Recorded(arrivals, TrueOffset(arrivals), rows["SIM"], rows["ATT"])


def wrapped(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)


def looked_up(
    flight: Recorded, talk: Conversation, arrivals: Iterable[Arrival], latency_ns: int
) -> NDArray[np.float64]:
    """(N, 5) row number, the attitude that the link gives for the moment of each SIM row in degrees, and
    whether it called the clocks synchronised.

    Frames are exposed at the SIM rows and looked up `latency_ns` later, while the bytes arrive.
    """
    recorded = flight.arrivals
    first_ns, last_ns = recorded[0].at_ns + 2 * SECOND_NS, recorded[-1].at_ns - SECOND_NS
    captures = [(flight.offset.host_ns(row[0] * 1000), k) for k, row in enumerate(flight.truth_deg)]
    captures = [(at_ns, k) for at_ns, k in captures if first_ns < at_ns < last_ns]
    found, i = [], 0
    for arrival in arrivals:
        while i < len(captures) and captures[i][0] + latency_ns <= arrival.at_ns:
            attitude = talk.session.telemetry_at(captures[i][0], arrival.at_ns).attitude
            angles = (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad) if attitude else (np.nan,) * 3
            synced = talk.session.status(arrival.at_ns).clock_synced
            found.append((captures[i][1], *np.degrees(angles), synced))
            i += 1
        talk.hear(arrival.data, arrival.at_ns)
    return np.array(found)


def errors_deg(
    flight: Recorded, found: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) errors against the truth, and against what the autopilot itself believed."""
    rows = found[:, 0].astype(int)
    truth = flight.truth_deg[rows]
    estimate = np.stack(
        [
            np.interp(
                truth[:, 0], flight.estimate_deg[:, 0], np.unwrap(flight.estimate_deg[:, c], period=360.0)
            )
            for c in (1, 2, 3)
        ],
        axis=1,
    )
    return wrapped(found[:, 1:4] - truth[:, 1:]), wrapped(found[:, 1:4] - estimate)


def test_the_reset_of_heading_in_the_log_is_found_and_no_other(flight: Recorded) -> None:
    """EKF3 IMU0 MAG0 in-flight yaw alignment complete: 49.487 s; later it yaws at 45 degrees a second."""
    motion, resets = MotionHistory(MotionLimits()), []
    frames = [
        each.data for each in flight.arrivals if message_id(each.data) == mavlink.MAVLINK_MSG_ID_ATTITUDE
    ]
    for said in decoded(frames):
        at_ns, rates = said.time_boot_ms * 1_000_000, (said.rollspeed, said.pitchspeed, said.yawspeed)
        motion.add_attitude(at_ns, Attitude(said.roll, said.pitch, said.yaw), rates)
        resets.append((said.time_boot_ms / 1000, np.degrees(motion.heading_shift_at(at_ns))))
    at_s, so_far_deg = np.array(resets).T
    assert len(np.unique(so_far_deg)) == 2
    assert at_s[so_far_deg != 0][0] == pytest.approx(49.487, abs=0.02)
    assert so_far_deg[-1] == pytest.approx(-2.4, abs=0.1)


def test_attitude_at_capture_time_is_the_true_one(flight: Recorded) -> None:
    found = looked_up(flight, Conversation(flight.arrivals[0].at_ns), flight.arrivals, LATENCY_NS)
    assert len(found) > 1800
    assert not np.isnan(found).any(), "an attitude is known for every frame of the flight"
    against_truth, against_autopilot = errors_deg(flight, found)
    assert np.abs(against_truth[:, :2]).max() < 1.0, "roll and pitch"
    assert np.median(np.abs(against_truth[:, 2])) < 1.0, "yaw"
    # In this flight the autopilot's own heading is up to 2.2 degrees off; the link adds less than one.
    assert np.abs(against_autopilot).max() < 1.0


def test_jitter_of_100_ms_on_datagrams_costs_less_than_a_degree(flight: Recorded) -> None:
    rng = np.random.default_rng(7)
    late = [Arrival(a.at_ns + int(rng.integers(0, 100_000_000)), a.data) for a in flight.arrivals]
    late.sort(key=lambda arrival: arrival.at_ns)
    found = looked_up(flight, Conversation(late[0].at_ns), late, LATENCY_NS + 100_000_000)
    against_truth, against_autopilot = errors_deg(flight, found[~np.isnan(found[:, 1])])
    assert np.isnan(found[:, 1]).mean() < 0.01
    assert np.abs(against_truth[:, :2]).max() < 1.0
    assert np.abs(against_autopilot).max() < 1.0


class AnsweringFlight:
    """The recorded flight over a line that delays and keeps the order (TCP), both ways, while the autopilot
    answers our TIMESYNC requests. `talk` hears each arrival before the next is made."""

    def __init__(self, flight: Recorded, jitter_ns: int) -> None:
        self._flight, self._jitter_ns, self._rng = flight, jitter_ns, np.random.default_rng(3)
        self._voice, self._read = Voice(), 0
        self.talk = Conversation(flight.arrivals[0].at_ns)

    def arrivals(self) -> Iterator[Arrival]:
        line: list[Arrival] = []
        newest_ns = 0
        for recorded in self._flight.arrivals:
            line.append(Arrival(recorded.at_ns + self._delay_ns(), recorded.data))
            line += self._answers()
            line.sort(key=lambda arrival: arrival.at_ns)
            while line and line[0].at_ns <= recorded.at_ns:
                newest_ns = max(newest_ns, line[0].at_ns)
                yield Arrival(newest_ns, line.pop(0).data)

    def _answers(self) -> list[Arrival]:
        new = [message for _, message in self.talk.sent[self._read :]]
        self._read += len(new)
        requests = [message for message in new if message.get_type() == "TIMESYNC" and message.tc1 == 0]
        answers = []
        for request in requests:
            there_ns = request.ts1 + self._delay_ns()
            message = mavlink.MAVLink_timesync_message(self._flight.offset.boot_ns(there_ns), request.ts1)
            answers.append(Arrival(there_ns + self._delay_ns(), self._voice.pack(message)))
        return answers

    def _delay_ns(self) -> int:
        return int(self._rng.integers(0, self._jitter_ns))


@pytest.mark.parametrize(("jitter_ms", "synced_share"), [(8, 0.95), (100, 0.2)])
def test_jitter_on_a_line_that_keeps_the_order_costs_less_than_a_degree(
    flight: Recorded, jitter_ms: int, synced_share: float
) -> None:
    """Such a line holds up every message; only round trips tell that from a clock that is off."""
    late = AnsweringFlight(flight, jitter_ms * 1_000_000)
    found = looked_up(flight, late.talk, late.arrivals(), LATENCY_NS + jitter_ms * 1_000_000)
    against_truth, against_autopilot = errors_deg(flight, found)
    assert not np.isnan(found).any()
    assert np.abs(against_truth[:, :2]).max() < 1.0
    assert np.abs(against_autopilot).max() < 1.0
    assert found[:, 4].mean() > synced_share


@pytest.mark.parametrize("step_ns", [SECOND_NS, -SECOND_NS])
def test_a_stepped_clock_gives_the_true_attitude_or_none(flight: Recorded, step_ns: int) -> None:
    """From 60 s on, the host's clock stands one second off, in arrivals and captures alike."""
    start_ns = flight.arrivals[0].at_ns + 55 * SECOND_NS
    at_ns = flight.arrivals[0].at_ns + 60 * SECOND_NS
    before = [a for a in flight.arrivals if start_ns <= a.at_ns < at_ns]
    after = [
        Arrival(a.at_ns + step_ns, a.data)
        for a in flight.arrivals
        if at_ns <= a.at_ns < at_ns + 20 * SECOND_NS
    ]
    talk = Conversation(start_ns)
    for arrival in before:
        talk.session.receive(arrival.data, arrival.at_ns)
    rows = [(flight.offset.host_ns(row[0] * 1000), row) for row in flight.truth_deg]
    captures = [(host_ns + step_ns, row) for host_ns, row in rows if at_ns < host_ns < at_ns + 19 * SECOND_NS]
    i, known, worst = 0, [], 0.0
    for arrival in after:
        while i < len(captures) and captures[i][0] + LATENCY_NS <= arrival.at_ns:
            attitude = talk.session.telemetry_at(captures[i][0], arrival.at_ns).attitude
            known.append(attitude is not None)
            if attitude is not None:
                angles = np.degrees((attitude.roll_rad, attitude.pitch_rad))
                worst = max(worst, float(np.abs(wrapped(angles - captures[i][1][1:3])).max()))
            i += 1
        talk.session.receive(arrival.data, arrival.at_ns)
    assert worst < 1.0
    assert all(known[-100:]), "the link recovers: the last 10 s are known again"
