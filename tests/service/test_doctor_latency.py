"""The doctor counts with the latency that a running service measures, and says whose it is (R9)."""

from __future__ import annotations

import json
import socket
import threading
from contextlib import ExitStack
from dataclasses import replace

import pytest
from doctor_vehicles import COPTER, PLAN, PX4, about
from program_fakes import free_port
from test_doctor_sockets import ANY_TCP, findings_of, run_bare
from test_watch import status_bytes

from service.clock import ManualClock
from service.doctor.finding import Level
from service.doctor.live_latency import KnownLatency, ServiceEar, latency_of, service_endpoints
from service.fake_autopilot.fake_autopilot import FakeAutopilot
from service.freshness import Freshness
from service.publisher.session import open_session
from service.publisher.status_wire import StatusSample
from service.security.security import Security
from service.settings.zenoh import ZenohSettings
from service.watch.board import VehicleView

PLACE = "tcp/127.0.0.1:7447"


def service_of(name: str, p95_ms: float | None = 88.0, **changes: object) -> VehicleView:
    status = StatusSample.decode(status_bytes(latency_ms_p95=p95_ms, **changes))
    return VehicleView(name, True, Freshness.LIVE, 0.1, None, status, 0)


class TestWhoseLatency:
    def test_the_one_service_that_runs(self) -> None:
        known = latency_of([service_of("kite", system_id=1)], None, 1, PLACE)
        assert (known.seconds, known.source) == (0.088, "measured by the running service of kite")

    def test_the_slowest_of_its_cameras_counts(self) -> None:
        side = {"name": "right", "used": True, "camera": "delivering", "frames_per_s": 14.0}
        kite = service_of("kite", extra_cameras=[{**side, "latency_ms_p95": 131.0}])
        assert latency_of([kite], None, 1, PLACE).seconds == 0.131

    def test_the_configured_vehicle_of_several(self) -> None:
        fleet = [service_of("crow", 300.0), service_of("kite")]
        assert latency_of(fleet, "kite", 1, PLACE).seconds == 0.088
        assert latency_of(fleet, "wren", 1, PLACE).source == f"no running service of wren at {PLACE}"
        nobody = latency_of(fleet, None, 1, PLACE)
        assert nobody.seconds is None
        assert "services of crow, kite run" in nobody.source

    def test_never_that_of_another_autopilot(self) -> None:
        fleet = [service_of("crow", 300.0, system_id=2), service_of("kite", system_id=1)]
        assert latency_of(fleet, None, 1, PLACE).seconds == 0.088
        stranger = latency_of(fleet[:1], None, 1, PLACE)
        assert stranger.seconds is None
        assert "another autopilot than system 1" in stranger.source

    def test_a_service_that_has_sent_nothing_has_none(self) -> None:
        known = latency_of([service_of("kite", None)], None, 1, PLACE)
        assert (known.seconds, known.source) == (None, "the service of kite has not sent distances yet")


def test_it_is_said_which_latency_is_counted_with() -> None:
    finding = about("latency", COPTER, replace(PLAN, latency_source="given with --latency"))
    assert (finding.level, finding.text) == (
        Level.OK,
        "0.1 s from capture to the line, given with --latency",
    )
    unknown = about("latency", PX4, replace(PLAN, latency_s=None, latency_source="--no-live"))
    assert unknown.level is Level.NOTE
    assert "--latency" in unknown.fix


@pytest.mark.parametrize(
    ("listen", "heard_at"),
    [
        ("tcp/0.0.0.0:7447", "tcp/127.0.0.1:7447"),
        ("tls/[::]:7448", "tls/[::1]:7448"),
        ("tcp/10.0.0.7:7447", "tcp/10.0.0.7:7447"),
    ],
)
def test_a_service_is_looked_for_where_its_own_configuration_lets_it_listen(
    listen: str, heard_at: str
) -> None:
    settings = ZenohSettings(listen=(listen,), connect=("tcp/router:7447",))
    assert service_endpoints(settings) == (heard_at, "tcp/router:7447")
    assert service_endpoints(settings.model_copy(update={"enabled": False})) == ()


def test_a_viewers_file_leads_to_where_it_connects() -> None:
    settings = ZenohSettings(connect=("tls/router:7447",), ca="ca.pem", certificate="a.pem", key="a.key")
    assert service_endpoints(settings) == ("tls/router:7447",)


def test_a_running_service_is_asked_over_zenoh() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    stop = threading.Event()
    with ExitStack() as stack:
        autopilot = stack.enter_context(FakeAutopilot("ardupilot", ANY_TCP, parameters={"PRX_FILT": 5.0}))
        session = stack.enter_context(open_session([endpoint], []))

        def tell() -> None:
            while not stop.wait(0.1):
                session.put("uavdepth/kite/status", status_bytes(system_id=1))

        teller = threading.Thread(target=tell)
        teller.start()
        stack.callback(teller.join)
        stack.callback(stop.set)
        result = run_bare(
            "--autopilot", autopilot.address, "--connect", endpoint, "--seconds", "1", "--no-probe", "--json"
        )
    findings = findings_of(result)
    assert findings["latency"]["text"].startswith("0.088 s from capture to the line, measured by the running")
    assert findings["AVOID_MARGIN"]["recommended"] == 2.6
    assert "latency not counted" not in findings["safe speed"]["text"]
    assert json.loads(result.stdout)["latency_s"] == 0.088


class HurriedClock(ManualClock):
    """Half a second passes with each look at it."""

    def now_ns(self) -> int:
        self.advance_s(0.5)
        return super().now_ns()


def test_who_does_not_answer_is_not_waited_for() -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        place = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        with ServiceEar([place], None, None, HurriedClock()) as ear:
            known = ear.latency(1, threading.Event())
    assert known == KnownLatency(None, f"no running service at {place}")


def test_a_session_that_cannot_be_opened_is_told_and_stops_nothing() -> None:
    with ServiceEar(["tls/127.0.0.1:7447"], Security(), None, HurriedClock()) as ear:
        known = ear.latency(1, threading.Event())
    assert known.seconds is None
    assert "TLS needs ca, certificate and key" in known.source
