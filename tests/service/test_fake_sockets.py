"""The fake autopilots over real sockets on the loopback interface, and a pilot who flies them."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
from fake_support import Wall
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.errors import LinkError
from service.fake_autopilot import FakeAutopilot, FaultKind, Pilot, PilotError, Truth
from service.fake_autopilot.faults import Fault
from uavdepth.attitude import Attitude

ANY_TCP = "tcp:127.0.0.1:0"
PATIENCE_S = 20.0


@pytest.fixture
def ardupilot() -> Iterator[FakeAutopilot]:
    with FakeAutopilot("ardupilot", ANY_TCP) as autopilot:
        yield autopilot


class Companion:
    """A pymavlink connection, as a companion program would have."""

    def __init__(self, address: str) -> None:
        self.link = mavutil.mavlink_connection(address, source_system=1, source_component=196)

    def hear(self, kind: str, is_it: Callable[[Any], bool] = lambda _: True) -> Any:
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s:
            message = self.link.recv_match(type=kind, blocking=True, timeout=1.0)
            if message is not None and is_it(message):
                return message
        raise AssertionError(f"no such {kind} within {PATIENCE_S} s")

    def send_obstacles(self, word: int) -> None:
        self.link.mav.obstacle_distance_send(0, 4, [word] * 72, 5, 20, 2000, 5.0, -155.0, 12)

    def __enter__(self) -> Companion:
        return self

    def __exit__(self, *_: object) -> None:
        self.link.close()


def wait_for(autopilot: FakeAutopilot, is_so: Callable[[Truth], bool]) -> Truth:
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        truth = autopilot.truth()
        if is_so(truth):
            return truth
        time.sleep(0.01)
    raise AssertionError(f"not so within {PATIENCE_S} s: {autopilot.truth()}")


class TestLinks:
    def test_a_tcp_client_hears_a_mavlink_2_heartbeat_and_gets_what_it_asks_for(
        self, ardupilot: FakeAutopilot
    ) -> None:
        with Companion(ardupilot.address) as companion:
            heartbeat = companion.hear("HEARTBEAT")
            assert heartbeat.get_msgbuf()[0] == 0xFD
            assert (heartbeat.get_srcSystem(), heartbeat.get_srcComponent()) == (1, 1)
            ask = (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 20000)
            companion.link.mav.command_long_send(1, 1, *ask, 0, 0, 0, 0, 0)
            assert companion.hear("COMMAND_ACK").result == mavlink.MAV_RESULT_ACCEPTED
            first = companion.hear("LOCAL_POSITION_NED").time_boot_ms
            second = companion.hear("LOCAL_POSITION_NED").time_boot_ms
            assert second - first == 20

    def test_a_time_request_is_answered(self, ardupilot: FakeAutopilot) -> None:
        with Companion(ardupilot.address) as companion:
            companion.link.mav.timesync_send(0, 4242)
            answer = companion.hear("TIMESYNC", lambda message: message.tc1 != 0)
            assert answer.ts1 == 4242
            assert answer.tc1 <= ardupilot.truth().time_boot_s * 1e9

    def test_two_clients_are_served_and_one_may_leave(self, ardupilot: FakeAutopilot) -> None:
        with Companion(ardupilot.address) as companion:
            with Companion(ardupilot.address) as other:
                other.hear("HEARTBEAT")
            companion.hear("HEARTBEAT")
            companion.send_obstacles(500)
            assert wait_for(ardupilot, lambda truth: truth.obstacle_messages == 1).nearest_m == pytest.approx(
                5.0
            )

    def test_noise_on_the_line_does_no_harm(self, ardupilot: FakeAutopilot) -> None:
        host, port = ardupilot.address.split(":")[1:]
        with socket.create_connection((host, int(port))) as noisy:
            noisy.sendall(bytes(range(256)) * 40 + b"\xfd\x09\x00")
        with Companion(ardupilot.address) as companion:
            companion.hear("HEARTBEAT")
        assert ardupilot.is_running

    def test_udpout_sends_to_its_peer_and_takes_its_answers(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
            ground.bind(("127.0.0.1", 0))
            ground.settimeout(PATIENCE_S)
            with FakeAutopilot(
                "px4", f"udpout:127.0.0.1:{ground.getsockname()[1]}", system_id=7
            ) as autopilot:
                data, sender = ground.recvfrom(2048)
                (heartbeat,) = mavlink.MAVLink(None).parse_buffer(data)[:1]
                assert heartbeat.get_srcSystem() == 7
                codec = mavlink.MAVLink(None, srcSystem=7, srcComponent=196)
                words = mavlink.MAVLink_obstacle_distance_message(
                    0, 4, [300] * 72, 5, 20, 2000, 5.0, -155.0, 12
                )
                ground.sendto(words.pack(codec), sender)
                wait_for(autopilot, lambda truth: truth.nearest_m == 3.0)

    def test_udp_answers_whoever_has_spoken(self) -> None:
        with (
            FakeAutopilot("ardupilot", "udp:127.0.0.1:0") as autopilot,
            Companion(autopilot.address.replace("udp:", "udpout:")) as companion,
        ):
            companion.link.mav.heartbeat_send(18, 8, 0, 0, 4)
            companion.hear("HEARTBEAT")

    def test_mavlink_1_has_heartbeats_but_no_large_ids(self) -> None:
        with (
            FakeAutopilot("ardupilot", ANY_TCP, mavlink1=True) as autopilot,
            Companion(autopilot.address) as companion,
        ):
            assert companion.hear("HEARTBEAT").get_msgbuf()[0] == 0xFE
            assert companion.hear("ATTITUDE").get_msgbuf()[0] == 0xFE

    @pytest.mark.parametrize(
        "text", ["", "tcp", "tcp:127.0.0.1", "tcp::5760", "tcp:h:70000", "serial:/dev/x:1"]
    )
    def test_an_endpoint_that_cannot_be_read_is_named(self, text: str) -> None:
        with pytest.raises(LinkError, match="is none of tcp:HOST:PORT"):
            FakeAutopilot("ardupilot", text).start()

    def test_a_port_in_use_is_named_and_the_other_endpoint_is_let_go(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as taken, socket.create_server(("127.0.0.1", 0)) as probe:
            busy = f"tcp:127.0.0.1:{taken.getsockname()[1]}"
            free = f"tcp:127.0.0.1:{probe.getsockname()[1]}"
            probe.close()
            with pytest.raises(LinkError, match=f"{busy}.*in use"):
                FakeAutopilot("ardupilot", [free, busy]).start()
            with FakeAutopilot("ardupilot", free) as autopilot:
                assert autopilot.address == free

    def test_closing_twice_is_fine(self) -> None:
        autopilot = FakeAutopilot("ardupilot", ANY_TCP)
        autopilot.start()
        autopilot.close()
        autopilot.close()
        assert not autopilot.is_running


class TestFaults:
    def test_a_reboot_hangs_up_and_comes_back_with_its_time_at_zero(self, ardupilot: FakeAutopilot) -> None:
        with Companion(ardupilot.address) as companion:
            companion.hear("HEARTBEAT")
            ardupilot.inject(FaultKind.REBOOT)
            wait_for(ardupilot, lambda truth: truth.reboots == 1 and truth.time_boot_s > 0.5)
        with Companion(ardupilot.address) as companion:
            assert companion.hear("ATTITUDE").time_boot_ms < 20000

    def test_in_a_pause_both_directions_are_lost(self, ardupilot: FakeAutopilot) -> None:
        with Companion(ardupilot.address) as companion:
            companion.hear("HEARTBEAT")
            ardupilot.inject(FaultKind.PAUSE, 1.0)
            began_s = ardupilot.truth().time_s
            companion.send_obstacles(500)
            wait_for(ardupilot, lambda truth: truth.time_s > began_s + 1.1)
            stamps = [companion.hear("ATTITUDE").time_boot_ms for _ in range(12)]
            assert max(b - a for a, b in pairwise(stamps)) >= 1000
            assert ardupilot.truth().obstacle_messages == 0

    def test_a_burst_delivers_everything_late(self, ardupilot: FakeAutopilot) -> None:
        with Companion(ardupilot.address) as companion:
            companion.hear("HEARTBEAT")
            ardupilot.inject(FaultKind.BURST, 1.0)
            began = ardupilot.truth()
            for _ in range(5):
                companion.send_obstacles(500)
            wait_for(ardupilot, lambda truth: truth.time_s > began.time_s + 0.9)
            assert ardupilot.truth().obstacle_messages == 0
            wait_for(ardupilot, lambda truth: truth.obstacle_messages == 5)
            stamps = [companion.hear("ATTITUDE").time_boot_ms for _ in range(8)]
            assert max(b - a for a, b in pairwise(stamps)) <= 260

    def test_a_fault_can_be_planned_before_the_start(self) -> None:
        with FakeAutopilot("ardupilot", ANY_TCP, faults=[Fault(FaultKind.CLOCK, 0.1, 100.0)]) as autopilot:
            assert wait_for(autopilot, lambda truth: truth.time_s > 0.2).time_boot_s > 160.0


class TestPilot:
    def test_an_arducopter_takes_off_flies_forward_and_stops_by_itself(self) -> None:
        wall = Wall(north_m=6.0)
        with (
            FakeAutopilot("ardupilot", ANY_TCP, scene=wall, parameters={"PRX_FILT": 5.0}) as autopilot,
            Companion(autopilot.address) as companion,
            Pilot(autopilot.address) as pilot,
        ):

            def tell(truth: Truth) -> None:
                companion.send_obstacles(round(100.0 * (wall.north_m - truth.position_ned_m[0])))

            with pytest.raises(PilotError, match="PRX1: No Data"):
                pilot.arm(timeout_s=0.0)
            tell(autopilot.truth())
            pilot.take_off(1.0)
            assert pilot.mode == "GUIDED"
            pilot.fly_forward(3.0)

            def is_at_rest(truth: Truth) -> bool:
                tell(truth)
                return truth.position_ned_m[0] > 3.0 and abs(truth.velocity_ned_mps[0]) < 0.05

            truth = wait_for(autopilot, is_at_rest)
            assert not truth.collided
            assert wall.north_m - truth.position_ned_m[0] == pytest.approx(2.1, abs=0.4)

    def test_a_px4_is_flown_with_the_stick_of_position_mode(self) -> None:
        with FakeAutopilot("px4", ANY_TCP) as autopilot, Pilot(autopilot.address) as pilot:
            pilot.take_off(1.0)
            pilot.fly_forward(3.0)
            truth = wait_for(autopilot, lambda truth: truth.velocity_ned_mps[0] > 1.0)
            assert truth.mode == "POSCTL"
            assert isinstance(truth.attitude, Attitude)
            assert truth.attitude.pitch_rad < 0.0

    def test_a_speed_beyond_the_full_stick_is_refused(self, ardupilot: FakeAutopilot) -> None:
        with Pilot(ardupilot.address) as pilot, pytest.raises(PilotError, match="outside 0 to 5 m/s"):
            pilot.fly_forward(6.0)

    def test_an_unknown_mode_is_refused_with_the_known_ones(self, ardupilot: FakeAutopilot) -> None:
        with Pilot(ardupilot.address) as pilot, pytest.raises(PilotError, match=r"'FLOAT'.*LOITER"):
            pilot.set_mode("FLOAT")

    def test_nobody_there_is_said_so(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as silent:
            address = f"tcp:127.0.0.1:{silent.getsockname()[1]}"
            with pytest.raises(LinkError, match="no heartbeat"):
                Pilot(address, timeout_s=0.2)
        with pytest.raises(LinkError, match="cannot reach"):
            Pilot(address, timeout_s=0.2)
