"""`uavdepth fake-autopilot`: clear words and exit codes."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner, Result

from service.fake_autopilot.command import fake_autopilot

PROGRAM = "import typer; from service.fake_autopilot.command import fake_autopilot; typer.run(fake_autopilot)"


def run(*arguments: str) -> Result:
    application = typer.Typer()
    application.command()(fake_autopilot)
    return CliRunner().invoke(application, ["--endpoint", "tcp:127.0.0.1:0", *arguments])


def test_it_runs_for_so_long_and_says_where_it_listens() -> None:
    result = run("--seconds", "0.2", "--flavor", "px4", "--fault", "clock@0.1:2", "-p", "CP_DIST=5")
    assert result.exit_code == 0, result.output
    assert "px4 1/1 on tcp:127.0.0.1:" in result.output
    assert "AUTO.LOITER disarmed" in result.output


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--fault", "crash@20"], "'crash@20' is none of reboot@SECOND"),
        (["--fault", "pause@30"], "duration 0.0 s must be above 0"),
        (["--parameter", "PRX_FILT"], "'PRX_FILT' is not NAME=VALUE"),
        (["--parameter", "PRX_FILT=fast"], "'PRX_FILT=fast' is not NAME=VALUE"),
        (["--parameter", "CP_DIST=5"], "no parameter 'CP_DIST'"),
        (["--flavor", "betaflight"], "betaflight"),
        (["--system-id", "0"], "equal to 1"),
        (["--scene", "moon:1"], "moon"),
    ],
)
def test_bad_use_is_named_and_exits_2(arguments: list[str], complaint: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert complaint in " ".join(result.output.split())
    assert "Traceback" not in result.output


def test_a_port_in_use_is_named_and_exits_1() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        busy = f"tcp:127.0.0.1:{taken.getsockname()[1]}"
        result = run("--endpoint", busy)
    assert result.exit_code == 1
    assert f"'{busy}' cannot be opened" in " ".join(result.output.split())


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(number: signal.Signals) -> None:
    command = [sys.executable, "-c", PROGRAM, "--endpoint", "tcp:127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert "ardupilot 1/1 on" in process.stdout.readline()
        process.stdout.readline()
        process.send_signal(number)
        _, errors = process.communicate(timeout=20)
    assert process.returncode == 0
    assert errors == ""
