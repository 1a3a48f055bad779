"""R9, R10: what the autopilot reads is true when it reads it, whatever clocks and messages do."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from link_support import Conversation, Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.transport_delay import TransportDelay
from uavdepth import ObstacleScan, SectorState

S, MS = 1_000_000_000, 1_000_000


class Turning:
    """A vehicle that turns and flies north while time passes; ATTITUDE 50 Hz, LOCAL_POSITION_NED 30 Hz.

    Args:
        yaw_rate_dps: degrees a second, clockwise.
        north_mps: speed.
        jitter_ms: each message is late by a random part of it; they keep their order.
        trip_ms: answers TIMESYNC with so long a round trip; None answers nothing.
    """

    def __init__(
        self,
        yaw_rate_dps: float = 0.0,
        north_mps: float = 0.0,
        jitter_ms: int = 0,
        trip_ms: int | None = 4,
        **settings: object,
    ) -> None:
        self.talk = Conversation(S, **settings)
        self.voice = Voice()
        self.yaw_rate = math.radians(yaw_rate_dps)
        self.north_mps = north_mps
        self.reset_deg = 0.0
        """How far the autopilot's heading has been reset."""
        self.step_ms = 0
        """How far the autopilot's clock has stepped."""
        self.silent = False
        self._jitter_ms = jitter_ms
        self._trip_ms = trip_ms
        self._random = np.random.default_rng(5)
        self._asked = 0
        self._under_way: list[tuple[int, bytes]] = []

    def yaw(self, at_ns: int) -> float:
        """The true heading."""
        return self.yaw_rate * at_ns / S

    def fly(self, seconds: float) -> None:
        start_ns = self.talk.now_ns
        end_ns = start_ns + round(seconds * 1e9)
        for at_ms in range(-(-start_ns // MS), -(-end_ns // MS)):
            late_ns = round(self._random.uniform(0, self._jitter_ms) * MS)
            latest_ns = self._under_way[-1][0] if self._under_way else 0
            arrival_ns = max(latest_ns, at_ms * MS + 2 * MS + late_ns)
            self._under_way += [(arrival_ns, frame) for frame in self._frames(at_ms)]
        while self._under_way and self._under_way[0][0] <= end_ns:
            arrival_ns, frame = self._under_way.pop(0)
            self.talk.hear(frame, arrival_ns)
            self._answer()
        self.talk.wait_until(end_ns)
        self._answer()

    def _frames(self, at_ms: int) -> Iterator[bytes]:
        if self.silent:
            return
        boot_ms = at_ms + 20_000 + self.step_ms
        if at_ms % 1000 == 0:
            yield self.voice.heartbeat()
        if at_ms % 20 == 0:
            yaw = math.remainder(self.yaw(at_ms * MS) + math.radians(self.reset_deg), math.tau)
            yield self.voice.attitude(boot_ms, yaw=yaw, yaw_rate=self.yaw_rate or 1e-4)
        if at_ms % 33 == 0:
            north_m = self.north_mps * at_ms / 1000
            yield self.voice.position(boot_ms, (north_m, 0.0, -5.0), (self.north_mps, 0.0, 0.0))

    def _answer(self) -> None:
        for _, request in self.talk.sent_of("TIMESYNC")[self._asked :]:
            self._asked += 1
            if self._trip_ms is None:
                continue
            boot_ns = (request.ts1 // MS + self._trip_ms // 2 + 20_000 + self.step_ms) * MS
            answer = mavlink.MAVLink_timesync_message(boot_ns, request.ts1)
            self.talk.session.receive(self.voice.pack(answer), request.ts1 + self._trip_ms * MS)

    def tell(self, scan: ObstacleScan, age_ms: int) -> mavlink.MAVLink_obstacle_distance_message:
        """What is sent now of a scan captured so long ago."""
        captured_ns = self.talk.now_ns - age_ms * MS
        assert self.talk.session.send_obstacles(scan, captured_ns, self.talk.now_ns)
        messages = [m for _, m in self._sent_now()]
        assert len(messages) == 1
        return messages[0]

    def _sent_now(self) -> list[tuple[int, mavlink.MAVLink_message]]:
        codec = mavlink.MAVLink(None)
        frames = self.talk.session.take_output(self.talk.now_ns)
        decoded = [codec.decode(bytearray(frame)) for frame in frames]
        return [(self.talk.now_ns, m) for m in decoded if m.get_type() == "OBSTACLE_DISTANCE"]


def pole(bearing_deg: float, metres: float) -> ObstacleScan:
    """One pole, the rest clear."""
    scan = clear_scan()
    element = round((bearing_deg + 155) / 5)
    scan.state[element], scan.distance_m[element] = SectorState.OBSTACLE, metres
    return scan


def told_at(message: mavlink.MAVLink_obstacle_distance_message) -> list[float]:
    """Bearings of the elements that hold an obstacle, degrees."""
    words = np.array(message.distances)
    return [
        message.angle_offset + message.increment_f * k for k in np.flatnonzero(words <= message.max_distance)
    ]


@pytest.mark.parametrize("yaw_rate_dps", [90.0, -90.0])
@pytest.mark.parametrize("bearing_deg", [-30.0, 0.0, 20.0])
def test_r9_in_a_turn_of_90_degrees_a_second_200_ms_old_bearings_are_right_to_5_degrees(
    yaw_rate_dps: float, bearing_deg: float
) -> None:
    flight = Turning(yaw_rate_dps)
    flight.fly(3.0)
    message = flight.tell(pole(bearing_deg, 8.0), age_ms=200)
    truth = bearing_deg - yaw_rate_dps * 0.2
    found = told_at(message)
    assert found
    assert max(abs(bearing - truth) for bearing in found) < 5.0
    assert min(message.distances) == 800


def test_r9_messages_that_come_up_to_100_ms_late_do_not_spoil_it() -> None:
    flight = Turning(90.0, jitter_ms=100)
    flight.fly(3.0)
    for _ in range(20):
        flight.fly(0.1)
        found = told_at(flight.tell(pole(0.0, 8.0), age_ms=200))
        assert max(abs(bearing + 18.0) for bearing in found) < 5.0


def test_r9_without_the_turn_made_good_the_same_bearing_would_be_18_degrees_off() -> None:
    flight = Turning(90.0)
    flight.fly(3.0)
    flight.silent = True
    flight.fly(0.5)
    message = flight.tell(pole(0.0, 8.0), age_ms=200)
    assert told_at(message) == [0.0]
    assert flight.talk.session.status(flight.talk.now_ns).not_made_good == 1
    # Who does not know how far it has turned knows of no direction that it is free.
    assert set(message.distances) == {800, 65535}


@pytest.mark.parametrize(("yaw_rate_dps", "reset_deg"), [(0.0, 40.0), (0.0, -170.0), (90.0, -30.0)])
def test_a_heading_that_is_reset_while_a_scan_is_under_way_turns_nothing(
    yaw_rate_dps: float, reset_deg: float
) -> None:
    flight = Turning(yaw_rate_dps)
    flight.fly(3.0)
    captured_ns = flight.talk.now_ns
    flight.fly(0.1)
    flight.reset_deg = reset_deg
    flight.fly(0.1)
    age_ms = (flight.talk.now_ns - captured_ns) // MS
    message = flight.tell(pole(0.0, 8.0), age_ms)
    found = told_at(message)
    assert found
    assert max(abs(bearing + yaw_rate_dps * age_ms / 1000) for bearing in found) < 5.0
    assert min(message.distances) == 800


def test_a_way_flown_over_a_reset_of_the_heading_is_made_good_ahead() -> None:
    flight = Turning(north_mps=5.0)
    flight.fly(3.0)
    flight.reset_deg = 20.0
    flight.fly(0.1)
    flight.reset_deg = 10.0
    flight.fly(0.1)
    message = flight.tell(pole(0.0, 8.0), age_ms=150)
    assert max(abs(bearing) for bearing in told_at(message)) <= 5.0
    assert min(message.distances) == pytest.approx(725, abs=10)


def test_what_is_ahead_is_told_nearer_by_the_way_flown_since_the_picture() -> None:
    flight = Turning(north_mps=5.0)
    flight.fly(3.0)
    message = flight.tell(pole(0.0, 8.0), age_ms=200)
    # 2 ms on the way besides.
    assert min(message.distances) == pytest.approx(800 - 500 * 0.202, abs=2)


def test_the_way_of_the_message_itself_is_made_good_too() -> None:
    flight = Turning(north_mps=5.0, trip_ms=60)
    flight.fly(3.0)
    assert min(flight.tell(pole(0.0, 8.0), age_ms=200).distances) == pytest.approx(800 - 500 * 0.230, abs=5)


def test_the_way_is_made_good_up_to_the_moment_of_leaving_not_of_queueing() -> None:
    flight = Turning(north_mps=5.0)
    flight.fly(3.0)
    captured_ns = flight.talk.now_ns - 40 * MS
    assert flight.talk.session.send_obstacles(pole(0.0, 8.0), captured_ns, flight.talk.now_ns)
    flight.talk.now_ns += 100 * MS
    ((_, message),) = flight._sent_now()
    assert min(message.distances) == pytest.approx(800 - 500 * 0.142, abs=2)


def test_an_obstacle_that_must_have_been_reached_is_told_at_hand() -> None:
    flight = Turning(north_mps=5.0)
    flight.fly(3.0)
    assert min(flight.tell(pole(0.0, 0.5), age_ms=200).distances) == 21


def test_a_hovering_vehicle_tells_what_it_has_seen() -> None:
    flight = Turning(yaw_rate_dps=1.0, north_mps=0.2)
    flight.fly(3.0)
    scan = pole(10.0, 6.0)
    assert told_at(flight.tell(scan, age_ms=100)) == [10.0]


def test_unknown_stays_unknown_however_the_vehicle_turns_and_flies() -> None:
    for yaw_rate_dps, north_mps in ((90.0, 0.0), (-60.0, 6.0), (0.0, 6.0)):
        flight = Turning(yaw_rate_dps, north_mps)
        flight.fly(3.0)
        scan = clear_scan()
        scan.state[:] = SectorState.UNKNOWN
        assert set(flight.tell(scan, age_ms=200).distances) == {65535}


def test_latency_is_counted_from_capture_to_the_line() -> None:
    flight = Turning()
    flight.fly(3.0)
    assert flight.talk.session.status(flight.talk.now_ns).obstacle_delay_ms is None
    flight.tell(pole(0.0, 8.0), age_ms=70)
    assert flight.talk.session.status(flight.talk.now_ns).obstacle_delay_ms == (70.0, 70.0)


def test_the_way_to_the_autopilot_is_learnt_from_round_trips() -> None:
    flight = Turning(trip_ms=60)
    flight.fly(3.0)
    assert flight.talk.session.status(flight.talk.now_ns).transport_ms == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("endpoint", "expected_ms"),
    [("tcp:127.0.0.1:5760", 0.0), ("serial:/dev/ttyAMA0:57600", 33.3), ("serial:/dev/ttyAMA0:921600", 2.1)],
)
def test_a_serial_line_takes_the_time_of_the_message_itself(endpoint: str, expected_ms: float) -> None:
    assert TransportDelay(endpoint).estimate_ns / MS == pytest.approx(expected_ms, abs=0.1)


def turn_error_deg(flight: Turning, age_ms: int) -> float | None:
    """Error of the heading told for a picture so long ago; None where none is told."""
    captured_ns = flight.talk.now_ns - age_ms * MS
    attitude = flight.talk.session.telemetry_at(captured_ns, flight.talk.now_ns).attitude
    if attitude is None:
        return None
    return abs(math.degrees(math.remainder(attitude.yaw_rad - flight.yaw(captured_ns), math.tau)))


@pytest.mark.parametrize("step_ms", [1000, -1000])
def test_r10_after_a_step_of_a_clock_attitude_is_right_to_1_degree_or_not_told(step_ms: int) -> None:
    flight = Turning(60.0, jitter_ms=100)
    flight.fly(6.0)
    errors = []
    for moment in range(120):
        if moment == 20:
            flight.step_ms = step_ms
        flight.fly(0.1)
        errors.append(turn_error_deg(flight, age_ms=150))
    told = [error for error in errors if error is not None]
    assert max(told) < 1.0
    assert len(told) > 80, "it is told again soon after the step"
    status = flight.talk.session.status(flight.talk.now_ns)
    assert status.clock_steps + status.reboots >= 1


def test_r10_100_ms_of_jitter_leave_attitude_right_to_1_degree() -> None:
    flight = Turning(60.0, jitter_ms=100)
    flight.fly(3.0)
    errors = []
    for _ in range(100):
        flight.fly(0.07)
        errors.append(turn_error_deg(flight, age_ms=150))
    told = [error for error in errors if error is not None]
    assert max(told) < 1.0
    assert len(told) > 90


def test_r10_a_gap_of_attitude_is_not_bridged() -> None:
    flight = Turning(60.0)
    flight.fly(3.0)
    flight.silent = True
    flight.fly(1.0)
    assert turn_error_deg(flight, age_ms=500) is None
    flight.silent = False
    flight.fly(0.5)
    assert turn_error_deg(flight, age_ms=900) is None
    error = turn_error_deg(flight, age_ms=100)
    assert error is not None
    assert error < 1.0
