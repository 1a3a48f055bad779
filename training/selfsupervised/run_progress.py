"""How far a run is: a bar with pictures a second and time left on a terminal, a line a minute elsewhere."""

from __future__ import annotations

from types import TracebackType
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from training.selfsupervised.settings import SelfSupervisedSettings
from training.selfsupervised.trainer import SelfSupervisedStep

LINE_EVERY_S = 60.0
_SMOOTHING = 0.05


class RunProgress:
    """Shows the steps of a run.

    Args:
        settings: of the run.
        stream: where to.
    """

    def __init__(self, settings: SelfSupervisedSettings, stream: TextIO) -> None:
        self._total = settings.image_steps
        console = Console(file=stream)
        self._stream = stream
        self._bar: Progress | None = None
        if console.is_terminal:
            self._bar = Progress(
                TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn(), console=console
            )
        self._task: TaskID | None = None
        self._rate = 0.0
        self._before: SelfSupervisedStep | None = None
        self._said_s: float | None = None

    def __enter__(self) -> RunProgress:
        if self._bar is not None:
            self._bar.start()
            self._task = self._bar.add_task("starting", total=self._total)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def add(self, report: SelfSupervisedStep) -> None:
        """Take in a step."""
        self._measure(report)
        text = f"{self._rate:.1f} pictures/s, loss {float(report.terms.total.detach()):.4f}"
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=min(report.images, self._total), description=text)
        elif self._said_s is None or report.trained_s - self._said_s >= LINE_EVERY_S:
            self._said_s = report.trained_s
            left_min = (self._total - report.images) / max(self._rate, 1e-9) / 60
            left = f"{left_min:.0f} min left" if self._rate else "just begun"
            self._stream.write(f"{report.images}/{self._total} pictures, {text}, {left}\n")
            self._stream.flush()

    def _measure(self, report: SelfSupervisedStep) -> None:
        before, self._before = self._before, report
        if before is None or report.trained_s <= before.trained_s:
            return
        rate = (report.images - before.images) / (report.trained_s - before.trained_s)
        self._rate = rate if not self._rate else self._rate + _SMOOTHING * (rate - self._rate)
