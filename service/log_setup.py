"""How the service logs: to standard error, for people or for machines."""

from __future__ import annotations

import io
import logging
import sys
from contextlib import suppress
from typing import TextIO, cast

import structlog

from service.settings.log import LogSettings


def set_up_logging(settings: LogSettings) -> None:
    """Make every structlog logger write as `[log]` says."""
    is_json = settings.format == "json"
    processors: list[structlog.typing.Processor] = [
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso" if is_json else "%H:%M:%S", utc=is_json),
    ]
    if is_json:
        processors += [structlog.processors.dict_tracebacks, structlog.processors.JSONRenderer()]
    else:
        # One line an exception: a traceback is for whoever asked for debug.
        if settings.level != "debug":
            processors.append(_exception_in_words)
        plain = structlog.dev.plain_traceback
        processors.append(
            structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), exception_formatter=plain)
        )
    level = logging.getLevelNamesMapping()[settings.level.upper()]
    structlog.configure(
        processors=processors,
        wrapper_class=structlog.make_filtering_bound_logger(level),
        logger_factory=structlog.PrintLoggerFactory(cast(TextIO, _LastingStream(sys.stderr))),
        cache_logger_on_first_use=True,
    )


def log_to_standard_error() -> None:
    """Keep standard output for a command's result; the form of log lines stays as it is."""
    # Looked up at each line: who redirects standard error later gets what is logged later.
    structlog.configure(
        logger_factory=lambda *_arguments: structlog.PrintLogger(sys.stderr), cache_logger_on_first_use=False
    )


class _LastingStream(io.TextIOBase):
    """A stream that may go away: no thread ends because nobody reads what it says."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, or not."""
        with suppress(OSError, ValueError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Hand on, or not."""
        with suppress(OSError, ValueError):
            self._stream.flush()


def _exception_in_words(
    logger: object, name: str, event: structlog.typing.EventDict
) -> structlog.typing.EventDict:
    """Replace a traceback with the error's class and text."""
    if event.pop("exc_info", None):
        error = sys.exc_info()[1]
        event["error"] = f"{type(error).__name__}: {error}"
    return event
