"""The publisher and those at the other end: away, in the way, silent, or without a place to listen."""

from __future__ import annotations

import socket
import threading
from pathlib import Path
from typing import Any, cast

import pytest
import zenoh
from program_fakes import free_port, make_settings, wait_until
from publisher_support import Heard, listening, publishing, settings_on

from service.clock import MonotonicClock
from service.errors import PublisherError
from service.publisher.publisher import ZenohPublisher
from service.publisher.session import close_soon, open_session
from service.security.errors import SecurityError
from service.settings.zenoh import ZenohSettings


def test_certificates_that_cannot_be_used_stop_the_program_with_the_file(tmp_path: Path) -> None:
    table = {name: str(tmp_path / name) for name in ("ca", "certificate", "key")}
    settings = ZenohSettings(listen=("tls/127.0.0.1:7447",), **table)
    with pytest.raises(SecurityError, match=r"ca .*: no such file"):
        ZenohPublisher(settings, "kite", make_settings().camera.model, MonotonicClock())


def test_liveliness_goes_with_the_publisher() -> None:
    port = free_port()
    with publishing(settings_on(port)) as publisher, listening(port) as heard:
        wait_until(lambda: heard.alive == [True])
        publisher.close()
        wait_until(lambda: heard.alive == [True, False])


def test_a_port_in_use_is_told_and_taken_when_it_is_free() -> None:
    blocker = socket.create_server(("127.0.0.1", 0))
    port = blocker.getsockname()[1]
    try:
        with publishing(settings_on(port)) as publisher:
            wait_until(lambda: "in use" in publisher.status.detail)
            assert f"tcp/127.0.0.1:{port} is in use by another program" in publisher.status.detail
            assert not publisher.status.open
            blocker.close()
            wait_until(lambda: publisher.status.open)
            assert publisher.status.detail == ""
    finally:
        blocker.close()


def test_a_peer_that_is_away_is_told_and_found_when_it_comes() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.listen=[]", f"zenoh.connect=['tcp/127.0.0.1:{port}']")
    with publishing(settings) as publisher:
        wait_until(lambda: "no peer at" in publisher.status.detail)
        with open_session([f"tcp/127.0.0.1:{port}"], []):
            wait_until(lambda: publisher.status.peers == 1)
            wait_until(lambda: publisher.status.detail == "")


class Stubborn:
    """A session whose peer has accepted and says nothing: it does not close."""

    opened = closing = 0
    released = threading.Event()

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        Stubborn.opened += 1

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    def close(self) -> None:
        Stubborn.closing += 1
        self.released.wait()
        self._session.close()  # type: ignore[no-untyped-call]


def test_nobody_waits_for_sessions_that_do_not_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "service.publisher.publisher.open_session", lambda *words: Stubborn(open_session(*words))
    )
    settings = settings_on(free_port(), f"zenoh.connect=['tcp/127.0.0.1:{free_port()}']")
    publisher = ZenohPublisher(settings.zenoh, "kite", settings.camera.model, MonotonicClock())
    publisher.start()
    wait_until(lambda: Stubborn.opened == 3)  # one that listens, one for scans and one for pictures
    publisher.close()
    with open_session((f"tcp/127.0.0.1:{free_port()}",), ()) as station:
        close_soon(cast(zenoh.Session, Stubborn(station)))
    try:
        assert not Stubborn.released.is_set(), "both have come back and the sessions are still there"
        wait_until(lambda: Stubborn.closing == 3)
    finally:
        Stubborn.released.set()


@pytest.mark.parametrize(
    ("listen", "words"),
    [
        ("tcp/203.0.113.7:7447", "is no address of this computer"),
        ("tcp/no-such-host.invalid:7447", "failed to lookup"),
        ("tcp/127.0.0.1:7447#so_sndbuf=much", "much"),
    ],
)
def test_an_endpoint_that_cannot_be_listened_on_is_named(listen: str, words: str) -> None:
    with pytest.raises(PublisherError, match=words) as refusal:
        open_session([listen], [])
    assert listen.split("#")[0] in str(refusal.value)
    assert ".rs:" not in str(refusal.value)


def test_sessions_do_not_find_each_other_by_themselves() -> None:
    with open_session([f"tcp/127.0.0.1:{free_port()}"], []) as one, open_session([], []) as other:
        heard = Heard(other)
        pause = threading.Event()
        for _ in range(10):
            one.put("uavdepth/kite/scan", b"x")
            pause.wait(0.02)
        assert heard.samples == {}
        assert list(one.info.peers_zid()) == []
