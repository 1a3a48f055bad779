"""The secret that MAVLink 2 packets are signed with, read from a file."""

from __future__ import annotations

import hashlib
import stat
from dataclasses import dataclass, field
from pathlib import Path

from service.errors import LinkError

KEY_BYTES = 32
_PASSPHRASE = b"passphrase:"
_LARGEST_FILE = 4096


@dataclass(frozen=True)
class SigningKey:
    """A key for MAVLink 2 signing.

    Args:
        secret: 32 bytes; never shown.
        warning: what is wrong with the way it is kept, fit to show a user; None if nothing.
    """

    secret: bytes = field(repr=False)
    warning: str | None = None


def load_signing_key(path: Path) -> SigningKey:
    """Read a key file.

    Args:
        path: a file of exactly 32 bytes, or of one line `passphrase: WORDS`, from whose UTF-8 bytes the key
            is the SHA-256, as ground stations make it.

    Raises:
        LinkError: no such file, a file that cannot be read, is of another size or holds no secret.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_FILE + 1)
            mode = stat.S_IMODE(path.stat().st_mode)
    except FileNotFoundError as error:
        raise LinkError(f"signing key file {path}: no such file") from error
    except OSError as error:
        raise LinkError(f"signing key file {path}: cannot be read: {error.strerror}") from error
    warning = None
    if mode & (stat.S_IRGRP | stat.S_IROTH):
        warning = f"signing key file {path} can be read by others (mode {mode:04o}): chmod 600 it"
    return SigningKey(_secret(path, data), warning)


def _secret(path: Path, data: bytes) -> bytes:
    if data.startswith(_PASSPHRASE) and len(data) <= _LARGEST_FILE:
        words = data.removeprefix(_PASSPHRASE).strip()
        if not words:
            raise LinkError(f"signing key file {path}: the passphrase is empty")
        if b"\n" in words:
            raise LinkError(f"signing key file {path}: the passphrase has more than one line")
        return hashlib.sha256(words).digest()
    if len(data) != KEY_BYTES:
        size = f"{len(data)} bytes" if len(data) <= _LARGEST_FILE else f"more than {_LARGEST_FILE} bytes"
        raise LinkError(
            f"signing key file {path} holds {size}: exactly {KEY_BYTES}, or one line "
            f"'{_PASSPHRASE.decode()} WORDS', is needed"
        )
    if not any(data):
        raise LinkError(f"signing key file {path} is all zero, which autopilots take as 'no signing'")
    return data
