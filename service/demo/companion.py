"""The service of the demo: `uavdepth run` in a process of its own, as on a vehicle."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import TracebackType

from uavdepth.errors import UavDepthError

_STOP_S = 5.0
_LAST_LINES = 5


class CompanionError(UavDepthError):
    """The service ended by itself; the text holds its last words."""


class Companion:
    """A running `uavdepth run`. A context manager.

    Args:
        configuration: its TOML file.
        log: file that takes what it prints.
    """

    def __init__(self, configuration: Path, log: Path) -> None:
        self._log = log
        with log.open("wb") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "service", "run", "--config", str(configuration)],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def check(self) -> None:
        """Raise CompanionError if the service has ended."""
        code = self._process.poll()
        if code is not None:
            lines = self._log.read_text(errors="replace").splitlines()[-_LAST_LINES:]
            raise CompanionError(f"uavdepth run ended with exit code {code}: {' / '.join(lines)}")

    @property
    def peak_memory_mib(self) -> float:
        """Largest resident memory so far in MiB, 0 where the system has no /proc."""
        try:
            lines = Path(f"/proc/{self._process.pid}/status").read_text().splitlines()
        except OSError:
            return 0.0
        kib = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
        return round(kib[0] / 1024, 1) if kib else 0.0

    def __enter__(self) -> Companion:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
