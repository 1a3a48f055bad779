"""R22: bytes per second are capped per link; what protects the vehicle goes first, and nothing queues."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_support import SECOND_NS as S
from link_support import TICK_NS, Voice, clear_scan, message_id
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.byte_budget import ByteBudget, bytes_per_s_of, obstacle_rate_hz
from service.autopilot.outbox import Outbox
from service.autopilot.session import LinkSession
from service.autopilot.signing_key import SigningKey
from service.errors import ConfigError
from service.settings.autopilot import AutopilotSettings
from service.settings.load import load_settings

KEY = SigningKey(bytes(range(32)))
BURST_BYTES = 400


class Flood:
    """A link whose service offers 30 scans and many texts a second, and what really leaves."""

    def __init__(self, seconds: float, key: SigningKey | None = None, **settings: object) -> None:
        settings = {"obstacle_rate_hz": 30.0, **settings}
        self.session = LinkSession(AutopilotSettings.model_validate(settings), key)
        self.session.line_opened(0)
        self.sent: list[tuple[int, bytes]] = []
        voice = Voice()
        if key is not None:
            voice._codec.signing.secret_key, voice._codec.signing.sign_outgoing = key.secret, True
        for tick in range(round(seconds * S) // TICK_NS):
            self.now_ns = tick * TICK_NS
            if tick % 50 == 0:
                self.session.receive(voice.heartbeat(), self.now_ns)
            self.session.say(
                4, f"text number {tick} that is long enough to fill a whole STATUSTEXT", self.now_ns
            )
            self.session.send_obstacles(clear_scan(), self.now_ns, self.now_ns)
            self.session.tick(self.now_ns)
            self.sent += [(self.now_ns, frame) for frame in self.session.take_output(self.now_ns)]

    def times_s(self, kind: int) -> list[float]:
        return [at / S for at, frame in self.sent if message_id(frame) == kind]

    def bytes_in(self, from_ns: int, to_ns: int) -> int:
        return sum(len(frame) for at, frame in self.sent if from_ns <= at < to_ns)


@pytest.mark.parametrize("bytes_per_s", [2100, 3000, 5000])
@pytest.mark.parametrize("key", [None, KEY])
def test_r22_no_second_carries_more_than_the_budget_and_one_burst(
    bytes_per_s: int, key: SigningKey | None
) -> None:
    flood = Flood(20.0, key, bytes_per_s=bytes_per_s)
    for start in range(19):
        assert flood.bytes_in(start * S, (start + 1) * S) <= bytes_per_s + BURST_BYTES
    assert flood.bytes_in(0, 20 * S) <= 20 * bytes_per_s + BURST_BYTES


@pytest.mark.parametrize("key", [None, KEY])
def test_the_smallest_budget_carries_ten_scans_a_second_heartbeats_and_what_telemetry_needs(
    key: SigningKey | None,
) -> None:
    flood = Flood(20.0, key, bytes_per_s=2100)
    assert len(flood.times_s(330)) >= 10 * 20
    assert max(np.diff(flood.times_s(330))) <= 0.12
    assert np.diff(flood.times_s(0)) == pytest.approx(1.0, abs=0.05)
    assert len(flood.times_s(111)) >= 15, "TIMESYNC"
    assert len(flood.times_s(76)) >= 3, "requests for telemetry"


def test_the_status_tells_the_rate_that_is_sent_and_why() -> None:
    flood = Flood(10.0, bytes_per_s=2500)
    status = flood.session.status(flood.now_ns)
    sent = [at for at in flood.times_s(330) if at > 8.0]
    assert status.obstacle_rate_hz == pytest.approx(len(sent) / 2.0, abs=0.6)
    assert status.obstacle_rate_hz == pytest.approx(status.obstacle_rate_limit_hz, rel=0.1)
    assert 10.0 <= status.obstacle_rate_limit_hz < 15.0
    assert status.byte_budget_per_s == 2500
    assert status.bytes_out_per_s <= 2500 + BURST_BYTES / 2
    assert status.refused_obstacles["too_soon"] > 100


def test_a_network_has_no_limit_and_a_serial_port_that_of_its_rate() -> None:
    assert bytes_per_s_of(0, "udp:0.0.0.0:14550") == bytes_per_s_of(0, "tcp:127.0.0.1:5760") == 0
    assert bytes_per_s_of(0, "serial:/dev/ttyAMA0:57600") == 4608
    assert bytes_per_s_of(3000, "serial:/dev/ttyAMA0:921600") == bytes_per_s_of(3000, "udp:0.0.0.0:1") == 3000


def test_a_network_link_sends_as_fast_as_is_wanted() -> None:
    flood = Flood(10.0)
    status = flood.session.status(flood.now_ns)
    assert status.obstacle_rate_hz == pytest.approx(30.0, abs=6.0)
    assert (status.obstacle_rate_limit_hz, status.byte_budget_per_s, status.dropped_messages) == (30.0, 0, 0)


def test_a_serial_port_that_is_too_slow_is_a_problem_that_is_told() -> None:
    flood = Flood(10.0, endpoint="serial:/dev/ttyAMA0:9600")
    status = flood.session.status(flood.now_ns)
    assert status.obstacle_rate_hz < 10.0
    assert "768 bytes/s" in (status.problem or "")
    assert "57600" in (status.problem or "")
    assert Flood(1.0, endpoint="serial:/dev/ttyAMA0:57600").session.status(S).problem is None


@given(st.floats(10.0, 30.0), st.integers(2100, 10**6))
def test_any_budget_that_can_be_set_carries_ten_and_never_more_than_is_wanted(
    wanted_hz: float, bytes_per_s: int
) -> None:
    assert 10.0 <= obstacle_rate_hz(wanted_hz, bytes_per_s) <= wanted_hz


@given(
    st.integers(1, 5000),
    st.lists(st.tuples(st.integers(0, 10**9), st.integers(1, 300), st.integers(0, 200)), max_size=60),
)
def test_a_bucket_never_gives_more_than_it_was_filled_with(
    bytes_per_s: int, wishes: list[tuple[int, int, int]]
) -> None:
    budget, now_ns, spent = ByteBudget(bytes_per_s), 0, 0
    for elapsed_ns, size, keep in wishes:
        now_ns += elapsed_ns
        if budget.spend(size, now_ns, keep):
            spent += size
        assert spent <= max(BURST_BYTES, bytes_per_s / 20) + bytes_per_s * now_ns / 1e9 + 1e-3


class TestOutbox:
    def test_obstacles_and_heartbeats_overtake_the_rest(self) -> None:
        outbox = Outbox()
        text = mavlink.MAVLink_statustext_message(4, b"text")
        beat = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
        distance = mavlink.MAVLink_obstacle_distance_message(0, 4, [1] * 72, 5, 20, 2000)
        outbox.put(text)
        outbox.put(mavlink.MAVLink_timesync_message(0, 1))
        outbox.put_obstacles(lambda _: [distance], S)
        outbox.put(beat)
        kinds = [message.get_type() for message, _ in outbox.take(0)]
        assert kinds == ["HEARTBEAT", "OBSTACLE_DISTANCE", "TIMESYNC", "STATUSTEXT"]

    def test_a_newer_scan_takes_the_place_of_one_that_waits(self) -> None:
        outbox = Outbox(2100)
        for number in range(4):
            words = [100 + number] * 72
            distance = mavlink.MAVLink_obstacle_distance_message(0, 4, words, 5, 20, 2000)
            outbox.put_obstacles(lambda _, distance=distance: [distance], S)
            taken = outbox.take(0)
            assert len(taken) == (1 if number < 2 else 0)
        assert outbox.dropped == 1
        ((message, _),) = outbox.take(S // 10)
        assert message.distances[0] == 103

    def test_what_found_no_room_in_time_is_dropped_and_counted(self) -> None:
        outbox = Outbox(2100)
        for number in range(100):
            outbox.put(mavlink.MAVLink_statustext_message(4, f"{number:050d}".encode()), S // 10)
        first = len(outbox.take(0))
        assert 0 < first < 5
        assert outbox.take(S) == []
        assert outbox.dropped == 100 - first


@pytest.mark.parametrize("value", [1, 2099])
def test_a_budget_that_cannot_carry_ten_scans_a_second_is_refused(value: int) -> None:
    with pytest.raises(
        ConfigError, match=rf"\[autopilot\] bytes_per_s: {value} is neither 0 nor at least 2100"
    ):
        load_settings(None, ["camera.source=sim:wall", f"autopilot.bytes_per_s={value}"])
