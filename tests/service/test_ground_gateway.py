"""The ground station between real Zenoh sessions and real WebSockets."""

from __future__ import annotations

import http.client
import json
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest
from ground_support import RunningStation, Talk, Vehicle, depth_png, jpeg, station
from program_fakes import WAIT_S, wait_until
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from service.ground.browser import WINDOW
from service.ground.frames import HEADER, FrameKind

TOKEN = "correct-horse-battery"


class Page:
    """What the page does: it keeps the newest frame of each kind and says that it was shown."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.newest: dict[FrameKind, tuple[Any, bytes]] = {}
        self.count = 0

    def watch(self, name: str | None, selection: int = 1, *, pictures: bool = True) -> None:
        self.socket.send(json.dumps({"watch": name, "selection": selection, "pictures": pictures}))

    def take(self, *, shown: bool = True) -> FrameKind:
        """One frame."""
        data = self.socket.recv(WAIT_S)
        assert isinstance(data, bytes)
        header = HEADER.unpack_from(data)
        kind = FrameKind(header[1])
        self.newest[kind] = (header, data[HEADER.size :])
        self.count += 1
        if shown:
            self.socket.send('{"shown": 1}')
        return kind

    def take_until(self, kind: FrameKind) -> tuple[Any, bytes]:
        while self.take() is not kind:
            pass
        return self.newest[kind]

    def document(self, kind: FrameKind) -> Any:
        return json.loads(self.take_until(kind)[1])

    def refusal(self) -> int | None:
        """Close code with which the gateway ends it."""
        try:
            while True:
                self.take(shown=False)
        except ConnectionClosed as closed:
            return None if closed.rcvd is None else closed.rcvd.code


@contextmanager
def page(running: RunningStation, **options: Any) -> Iterator[Page]:
    with connect(running.live_url, max_size=None, **options) as socket:
        yield Page(socket)


def ask(
    running: RunningStation,
    method: str,
    path: str,
    body: str | None = None,
    headers: dict[str, str] | None = None,
) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", running.port, timeout=WAIT_S)
    connection.request(method, path, body, headers or {})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer


@pytest.fixture(scope="module")
def open_station() -> Iterator[RunningStation]:
    with station() as running:
        yield running


@pytest.fixture(scope="module")
def guarded_station() -> Iterator[RunningStation]:
    with station(TOKEN) as running:
        yield running


def test_a_browser_gets_fleet_detail_history_and_pictures(open_station: RunningStation) -> None:
    kite = Vehicle(open_station.vehicles, "kite")
    with Talk(lambda: kite.say(6.0, shade=90)), page(open_station) as browser:
        browser.watch("kite", 7)
        names = []
        while "kite" not in names:
            names = [vehicle["name"] for vehicle in browser.document(FrameKind.FLEET)["vehicles"]]
        detail = browser.document(FrameKind.DETAIL)
        assert (detail["name"], detail["verdict"], detail["nearest_cm"]) == ("kite", 2, 600)
        assert detail["age_ms"] < 3000
        assert len(detail["scan"]["cm"]) == 72
        header, picture = browser.take_until(FrameKind.CAMERA)
        assert picture == jpeg(90)
        assert (header[0], header[2]) == (1, 7)
        header, picture = browser.take_until(FrameKind.DEPTH)
        assert picture == depth_png(6.0)
        assert (header[5], header[6]) == pytest.approx((0.5, 60.0))
        wait_until(lambda: (view := open_station.fleet.view("kite")) is not None and view.status is not None)
        assert browser.document(FrameKind.DETAIL)["status"]["mode"] == "GUIDED"
        browser.watch("kite", 8)
        history = browser.document(FrameKind.HISTORY)
        assert {verdict for _, verdict, _ in history["points"]} == {2}
    kite.die()


def test_vehicles_may_connect_to_the_station() -> None:
    with station(listens=True) as running:
        gull = Vehicle(running.vehicles, "gull")
        with Talk(gull.say), page(running) as browser:
            browser.watch("gull")
            while browser.document(FrameKind.DETAIL)["nearest_cm"] != 600:
                pass
            browser.take_until(FrameKind.DEPTH)


def test_pictures_are_fetched_only_while_somebody_looks(open_station: RunningStation) -> None:
    heron = Vehicle(open_station.vehicles, "heron")
    with Talk(heron.say):
        wait_until(lambda: open_station.fleet.changes("heron") > 3)
        assert open_station.fleet.picture("heron", "camera") is None
        with page(open_station) as browser:
            browser.watch("heron", pictures=False)
            browser.document(FrameKind.DETAIL)
            assert open_station.fleet.picture("heron", "camera") is None
            browser.watch("heron", 2)
            browser.take_until(FrameKind.CAMERA)
        wait_until(lambda: open_station.fleet.picture("heron", "camera") is None)
    heron.die()


def test_a_stalled_browser_holds_nobody_up_and_gets_the_newest_when_it_comes_back(
    open_station: RunningStation,
) -> None:
    swift = Vehicle(open_station.vehicles, "swift")
    with Talk(swift.say), page(open_station) as stalled, page(open_station) as lively:
        stalled.watch("swift")
        lively.watch("swift")
        for _ in range(WINDOW):
            stalled.take(shown=False)
        before = stalled.count
        for _ in range(60):
            lively.take()
        with pytest.raises(TimeoutError):
            stalled.socket.recv(0)
        assert stalled.count == before == WINDOW
        newest = lively.document(FrameKind.DETAIL)["scan"]["index"]
        stalled.socket.send(json.dumps({"shown": WINDOW}))
        while stalled.take() is not FrameKind.DETAIL:
            pass
        assert json.loads(stalled.newest[FrameKind.DETAIL][1])["scan"]["index"] >= newest
    swift.die()


def test_a_vehicle_whose_session_goes_is_told(open_station: RunningStation) -> None:
    owl = Vehicle(open_station.vehicles, "owl")
    owl.say()
    wait_until(lambda: (view := open_station.fleet.view("owl")) is not None and view.alive)
    owl.die()
    wait_until(lambda: (view := open_station.fleet.view("owl")) is not None and not view.alive)


def test_garbage_on_every_key_leaves_the_station_working(open_station: RunningStation) -> None:
    for topic in ("scan", "status", "camera", "depth", "video", "wind"):
        open_station.vehicles.put(f"uavdepth/raven/{topic}", b"\xff\x00garbage" * 20, attachment=b"{")
    open_station.vehicles.put("uavdepth/raven/scan", bytes(300_000))
    raven = Vehicle(open_station.vehicles, "raven")
    with Talk(raven.say), page(open_station) as browser:
        browser.watch("raven")
        assert browser.document(FrameKind.DETAIL)["name"] == "raven"
        while browser.document(FrameKind.FLEET)["bad_samples"] == 0:
            pass
    raven.die()


@pytest.mark.parametrize(
    "message",
    ["x", "[]", '{"shown": 99}', '{"shown": true}', '{"watch": 5}', '{"watch": "a"}', "[" * 900, "z" * 5000],
)
def test_a_browser_that_says_nonsense_is_let_go(open_station: RunningStation, message: str) -> None:
    with page(open_station) as browser:
        browser.socket.send(message)
        assert browser.refusal() in (4400, 1009)


def test_the_page_comes_with_a_strict_policy_and_loads_nothing_from_elsewhere(
    open_station: RunningStation,
) -> None:
    answer = ask(open_station, "GET", "/")
    policy = answer.headers["Content-Security-Policy"]
    assert answer.status == 200
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert ask(open_station, "GET", "/main.js", headers={"If-None-Match": "x"}).status == 200
    etag = ask(open_station, "GET", "/style.css").headers["ETag"]
    assert ask(open_station, "GET", "/style.css", headers={"If-None-Match": etag}).status == 304


@pytest.mark.parametrize("path", ["/..%2fapp.py", "/../app.py", "/page/main.js", "/app.py", "/.env"])
def test_nothing_but_the_page_can_be_read(open_station: RunningStation, path: str) -> None:
    assert ask(open_station, "GET", path).status == 404


@pytest.mark.parametrize(
    "begun",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: 127",
        b"POST /login HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nContent-Length: 30\r\n\r\n{",
    ],
    ids=["nothing", "half a header", "half a body"],
)
def test_who_does_not_finish_a_request_is_let_go(
    open_station: RunningStation, monkeypatch: pytest.MonkeyPatch, begun: bytes
) -> None:
    monkeypatch.setattr("service.ground.patience.REQUEST_S", 0.2)
    with socket.create_connection(("127.0.0.1", open_station.port)) as client:
        client.settimeout(60.0)
        client.sendall(begun % open_station.port if b"%d" in begun else begun)
        with suppress(ConnectionResetError):
            while client.recv(4096):
                pass  # until the station ends it


def test_a_foreign_host_name_is_refused(open_station: RunningStation) -> None:
    assert ask(open_station, "GET", "/", headers={"Host": "evil.example:80"}).status == 421
    assert ask(open_station, "GET", "/", headers={"Host": f"localhost:{open_station.port}"}).status == 200
    with pytest.raises(InvalidStatus), page(open_station, additional_headers={"Host": "evil.example"}):
        pass


def test_a_foreign_page_cannot_listen(open_station: RunningStation) -> None:
    with pytest.raises(InvalidStatus) as refusal, page(open_station, origin="http://evil.example"):
        pass
    assert refusal.value.response.status_code == 403
    with page(open_station, origin=open_station.url) as browser:
        browser.take_until(FrameKind.FLEET)


def test_without_the_token_nothing_is_told(guarded_station: RunningStation) -> None:
    assert ask(guarded_station, "GET", "/session").status == 401
    with page(guarded_station) as browser:
        assert browser.refusal() == 4401
    with page(
        guarded_station, additional_headers={"Cookie": f"uavdepth_ground_{guarded_station.port}=x"}
    ) as b:
        assert b.refusal() == 4401


def test_the_token_opens_the_page_for_its_cookie(guarded_station: RunningStation) -> None:
    body = json.dumps({"token": TOKEN})
    answer = ask(guarded_station, "POST", "/login", body)
    assert answer.status == 204
    cookie = answer.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert TOKEN not in cookie
    with page(guarded_station, additional_headers={"Cookie": cookie.split(";")[0]}) as browser:
        browser.take_until(FrameKind.FLEET)


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (json.dumps({"token": TOKEN + "x"}), 403),
        (json.dumps({"token": 5}), 403),
        ("{", 400),
        ("[1]", 400),
        ("x" * 5000, 413),
    ],
)
def test_a_wrong_token_opens_nothing(guarded_station: RunningStation, body: str, status: int) -> None:
    answer = ask(guarded_station, "POST", "/login", body)
    assert answer.status == status
    assert "Set-Cookie" not in answer.headers


def test_the_right_token_from_a_foreign_page_opens_nothing(guarded_station: RunningStation) -> None:
    answer = ask(
        guarded_station, "POST", "/login", json.dumps({"token": TOKEN}), {"Origin": "http://evil.example"}
    )
    assert answer.status == 421
    assert "Set-Cookie" not in answer.headers


def test_the_header_of_a_frame_has_24_bytes() -> None:
    assert HEADER.size == struct.calcsize("<BBHfdff") == 24
