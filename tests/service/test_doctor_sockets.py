"""`uavdepth doctor` over real sockets: exit codes, table, JSON, files."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner, Result

from service.doctor.command import doctor
from service.errors import ConfigError
from service.fake_autopilot.fake_autopilot import FakeAutopilot

ANY_TCP = "tcp:127.0.0.1:0"


def run(endpoint: str, *arguments: str, seconds: float = 1.5) -> Result:
    return run_bare("--autopilot", endpoint, "--seconds", str(seconds), "--no-live", *arguments)


def run_bare(*arguments: str) -> Result:
    application = typer.Typer()
    application.command()(doctor)
    return CliRunner().invoke(application, list(arguments))


def findings_of(result: Result) -> dict[str, Any]:
    report = json.loads(result.stdout.splitlines()[0])
    assert report["ok"] is (result.exit_code == 0)
    return {finding["topic"]: finding for finding in report["findings"]}


@pytest.fixture
def silent_port() -> Iterator[str]:
    """A port that lets everybody in and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp:127.0.0.1:{server.getsockname()[1]}"


def test_r14_a_good_ardupilot_ends_with_0_and_the_trial_is_seen() -> None:
    with FakeAutopilot("ardupilot", ANY_TCP, parameters={"PRX_FILT": 5.0}) as autopilot:
        result = run(autopilot.address, "--json", seconds=4.0)
    assert result.exit_code == 0, result.output
    findings = findings_of(result)
    assert findings["heartbeat"]["level"] == findings["echo"]["level"] == "ok"
    assert findings["PRX_FILT"]["level"] == "ok"


def test_r14_a_px4_with_collision_prevention_off_ends_with_1_and_a_file_with_the_fix(tmp_path: Path) -> None:
    fix = tmp_path / "px4.params"
    with FakeAutopilot("px4", ANY_TCP, parameters={"CP_DIST": -1.0}) as autopilot:
        result = run(autopilot.address, "--json", "--fix", str(fix), "--latency", "0.1")
    assert result.exit_code == 1
    assert findings_of(result)["CP_DIST"]["fix"] == "set CP_DIST to 3 or more"
    assert "1\t1\tCP_DIST\t3\t9\n" in fix.read_text(encoding="utf-8")


def test_r14_a_wrong_proximity_type_is_told_in_a_table_with_its_fix() -> None:
    with FakeAutopilot("ardupilot", ANY_TCP, parameters={"PRX1_TYPE": 0}) as autopilot:
        result = run(autopilot.address, "--no-probe")
    assert result.exit_code == 1
    words = " ".join(result.stdout.split())
    assert "failure PRX1_TYPE is 0" in words
    assert "-> set PRX1_TYPE to 2 (MAVLink)" in words


def test_r15_mavlink_1_ends_with_1() -> None:
    with FakeAutopilot("ardupilot", ANY_TCP, mavlink1=True) as autopilot:
        result = run(autopilot.address, "--json", "--no-probe")
    assert result.exit_code == 1
    assert findings_of(result)["MAVLink version"]["level"] == "failure"


def test_r14_a_silent_endpoint_ends_with_1_and_writes_no_file(silent_port: str, tmp_path: Path) -> None:
    fix = tmp_path / "fix.param"
    result = run(silent_port, "--json", "--fix", str(fix), seconds=1.0)
    assert result.exit_code == 1
    assert "nothing at all came" in findings_of(result)["heartbeat"]["text"]
    assert not fix.exists()


def test_r14_an_endpoint_that_refuses_says_so() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        endpoint = f"tcp:127.0.0.1:{server.getsockname()[1]}"
    result = run(endpoint, "--json", seconds=1.0)
    assert result.exit_code == 1
    assert "refused" in findings_of(result)["heartbeat"]["text"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--set", "autopilot.endpoint=carrier-pigeon"], "carrier-pigeon"),
        (["--set", "scan.range=3"], "unknown key"),
        (["--config", "/nowhere/uavdepth.toml"], "no such file"),
    ],
)
def test_a_wrong_configuration_is_named_before_anything_is_opened(
    arguments: list[str], complaint: str
) -> None:
    result = run_bare(*arguments)
    assert isinstance(result.exception, ConfigError)
    assert complaint in str(result.exception)


def test_a_file_that_exists_is_never_overwritten(tmp_path: Path) -> None:
    mine = tmp_path / "mine.param"
    mine.write_text("PRX1_TYPE,4\n", encoding="utf-8")
    result = run("tcp:127.0.0.1:1", "--fix", str(mine))
    assert isinstance(result.exception, ConfigError)
    assert mine.read_text(encoding="utf-8") == "PRX1_TYPE,4\n"
