"""Optional packages, asked for by the extra that brings them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from uavdepth.errors import UavDepthError

_OWN = ("uavdepth", "service", "training")


@contextmanager
def needs_extra(command: str, extra: str) -> Iterator[None]:
    """Around imports: a package that is not installed becomes a message that names the extra.

    Args:
        command: what the user called.
        extra: the extra of this project that brings the package.

    Raises:
        UavDepthError: a package is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in (*_OWN, ""):
            raise
        raise UavDepthError(f"uavdepth {command} needs {package}: pip install 'uavdepth[{extra}]'") from error
