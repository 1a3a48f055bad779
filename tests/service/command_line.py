"""The program as a user starts it: in this process where that proves the same, or in one of its own."""

from __future__ import annotations

import io
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from unittest.mock import patch

import service.log_setup
from service.cli import main

LIMIT_S = 60.0
PROGRAM = (sys.executable, "-c", "from service.cli import main; main()")
SIGNALS = (signal.SIGINT, signal.SIGTERM)


@dataclass(frozen=True)
class Done:
    """A command that has ended: its exit code and its words."""

    returncode: int
    stdout: str
    stderr: str


def uavdepth(*arguments: str) -> Done:
    """Run a command here; an exception that is not its end fails the test.

    Logging and the answers to signals are the whole process's: those stay as they are, these are put back.
    """
    answers = {number: signal.getsignal(number) for number in SIGNALS}
    output, errors = io.StringIO(), io.StringIO()
    try:
        with (
            redirect_stdout(output),
            redirect_stderr(errors),
            patch.object(service.log_setup, "set_up_logging", lambda settings: None),
        ):
            main(arguments)
    except SystemExit as end:
        return Done(int(end.code or 0), output.getvalue(), errors.getvalue())
    finally:
        for number, answer in answers.items():
            signal.signal(number, answer)


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A command in a process of its own, killed at the end if it is still there."""
    process = subprocess.Popen(
        [*PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()
