"""Logging: standard output belongs to a command's result."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator

import pytest
import structlog

from service.log_setup import log_to_standard_error, set_up_logging
from service.settings.log import LogSettings


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    """Logging is the whole process's: each test begins anew, and puts back what was."""
    before = structlog.get_config()
    structlog.reset_defaults()
    yield
    structlog.configure(**before)


def test_what_is_logged_does_not_stand_in_a_result(capsys: pytest.CaptureFixture[str]) -> None:
    structlog.get_logger().info("first")
    log_to_standard_error()
    structlog.get_logger().info("second", number=2)
    printed = capsys.readouterr()
    assert "first" in printed.out
    assert "second" not in printed.out
    assert "second" in printed.err
    assert "number" in printed.err


def test_nobody_who_logs_ends_because_nobody_reads_it(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    stream = os.fdopen(writing, "w", buffering=1)
    monkeypatch.setattr(sys, "stderr", stream)
    set_up_logging(LogSettings())
    structlog.get_logger().warning("zenoh", problem="no peer")
    structlog.get_logger().warning("zenoh", problem="no peer")
    with pytest.raises(BrokenPipeError):
        stream.close()
