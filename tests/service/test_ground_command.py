"""`uavdepth ground` as a user meets it."""

from __future__ import annotations

import io
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr

import pytest
from program_fakes import free_port

from service.cli import main
from service.ground.station import Station, StationSettings

PROGRAM = [sys.executable, "-c", "from service.cli import main; main()", "ground"]
LIMIT_S = 90.0
TOKEN = "correct-horse-battery"


def ground(*arguments: str) -> tuple[int, str]:
    """Exit code and words of a run that cannot work."""
    words = io.StringIO()
    with redirect_stderr(words), pytest.raises(SystemExit) as ended:
        main(["ground", *arguments])
    return int(str(ended.value.code)), words.getvalue()


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [*PROGRAM, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def line_with(process: subprocess.Popen[str], words: str) -> str:
    """The next line of the program that holds these words."""
    assert process.stdout is not None
    for line in process.stdout:
        if words in line:
            return line.strip()
    raise AssertionError(f"it ended without a word of {words!r}")


def test_a_port_in_use_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as blocker:
        port = blocker.getsockname()[1]
        code, words = ground("--port", str(port))
    assert code == 1
    assert f"--port {port} on 127.0.0.1: in use by another program" in words


def test_an_unreachable_router_is_told() -> None:
    place = f"tcp/127.0.0.1:{free_port()}"
    code, words = ground("--port", str(free_port()), "--connect", place, "--give-up", "0.3")
    assert code == 1
    assert f"no vehicle or router was reached at {place} within 0.3 s" in words


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--connect", "nowhere"], 2, "--connect: 'nowhere' is no endpoint"),
        (["--bind", "203.0.113.7"], 1, "no address of this computer"),
        (["--bind", "0.0.0.0", "--token", "short"], 2, "5 letters: 16 to 256"),
    ],
)
def test_wrong_options_are_named(arguments: list[str], code: int, words: str) -> None:
    told_code, told = ground("--port", str(free_port()), *arguments)
    assert told_code == code
    assert words in told


def test_it_says_where_the_page_is_and_ends_when_it_is_told_to() -> None:
    port = free_port()
    with started("--port", str(port), "--connect", f"tcp/127.0.0.1:{free_port()}") as process:
        url = line_with(process, "Ground station:").split()[-1]
        assert url == f"http://127.0.0.1:{port}/"
        line_with(process, "no vehicle or router is connected")
        with urllib.request.urlopen(url, timeout=LIMIT_S) as answer:
            assert b"uavdepth" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(LIMIT_S) == 0


def test_a_wider_page_prints_a_token_and_warns_of_plain_http() -> None:
    with started("--bind", "0.0.0.0", "--port", str(free_port())) as process:
        assert "/#token=" in line_with(process, "Ground station:")
        line_with(process, "Plain HTTP")


def test_a_token_that_was_given_is_not_printed() -> None:
    settings = StationSettings.checked(
        config=None,
        connect=[],
        listen=[f"tcp/127.0.0.1:{free_port()}"],
        port=free_port(),
        bind="0.0.0.0",
        token=TOKEN,
        host_names=[],
        certificate=None,
        key=None,
    )
    with Station(settings) as station:
        assert TOKEN not in station.words
        assert "Vehicles may connect to tcp/" in station.words
