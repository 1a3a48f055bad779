"""The files of a member of the fleet: are they there, do they fit together, are they private."""

from __future__ import annotations

import re
import stat
from datetime import UTC, datetime
from pathlib import Path

from service.security.errors import SecurityError

_MAX_FILE_BYTES = 1_000_000
_USER_LINE = re.compile(r"^[^\s:]+:\S+$")


def check_certificates(ca: Path, certificate: Path, key: Path) -> None:
    """Whether `key` belongs to `certificate` and `certificate` to `ca`.

    Raises:
        SecurityError: a file that is missing, is not what it should be, does not fit or can be read by
            others than its owner.
    """
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
    from cryptography.hazmat.primitives import serialization

    texts = {name: _read(path, name) for name, path in (("ca", ca), ("certificate", certificate))}
    loaded = {}
    for name, path in (("ca", ca), ("certificate", certificate)):
        try:
            loaded[name] = x509.load_pem_x509_certificate(texts[name])
        except ValueError as error:
            raise SecurityError(f"{name} {path}: holds no PEM certificate") from error
    check_private(key, "key")
    try:
        private = serialization.load_pem_private_key(_read(key, "key"), password=None)
    except TypeError as error:
        raise SecurityError(f"key {key}: is encrypted; a service that starts alone cannot open it") from error
    except (ValueError, UnsupportedAlgorithm) as error:
        raise SecurityError(f"key {key}: holds no PEM private key") from error
    own = loaded["certificate"]
    form = (serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)
    if private.public_key().public_bytes(*form) != own.public_key().public_bytes(*form):
        raise SecurityError(f"key {key}: is not the key of certificate {certificate}")
    try:
        own.verify_directly_issued_by(loaded["ca"])
    except (ValueError, TypeError, InvalidSignature) as error:
        raise SecurityError(f"certificate {certificate}: is not signed by ca {ca}") from error


def validity_problem(certificate: Path, now: datetime | None = None) -> str | None:
    """Why the certificate does not hold at `now` (UTC; None: the computer's time), or None if it does.

    Raises:
        SecurityError: a file that holds no certificate.
    """
    from cryptography import x509

    try:
        loaded = x509.load_pem_x509_certificate(_read(certificate, "certificate"))
    except ValueError as error:
        raise SecurityError(f"certificate {certificate}: holds no PEM certificate") from error
    at = datetime.now(UTC) if now is None else now
    if at > loaded.not_valid_after_utc:
        return f"certificate {certificate}: expired on {loaded.not_valid_after_utc:%Y-%m-%d}"
    if at < loaded.not_valid_before_utc:
        return (
            f"certificate {certificate}: is valid from {loaded.not_valid_before_utc:%Y-%m-%d} on, "
            f"and this computer's clock says {at:%Y-%m-%d}"
        )
    return None


def check_private(path: Path, name: str) -> None:
    """Raise SecurityError if others than its owner can read or write `path`."""
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
    except OSError as error:
        raise SecurityError(f"{name} {path}: {_words(error)}") from error
    if mode & 0o077:
        raise SecurityError(f"{name} {path}: others can read it (mode {mode:04o}): chmod 600 {path}")


def read_password(path: Path) -> str:
    """The password in the first line of `path`.

    Raises:
        SecurityError: a file that is missing, empty, or can be read by others than its owner.
    """
    check_private(path, "password_file")
    password = _text(path, "password_file").split("\n", 1)[0].strip()
    if not password:
        raise SecurityError(f"password_file {path}: its first line is empty")
    return password


def read_users(path: Path) -> tuple[str, ...]:
    """The names in a file of `name:password` lines.

    Raises:
        SecurityError: a file that is missing, without users, with a line of another form, or that others
            than its owner can read.
    """
    check_private(path, "users_file")
    lines = [line for line in _text(path, "users_file").splitlines() if line.strip()]
    for number, line in enumerate(lines, start=1):
        if not _USER_LINE.match(line):
            raise SecurityError(f"users_file {path}: line {number} is not of the form name:password")
    if not lines:
        raise SecurityError(f"users_file {path}: holds no user")
    return tuple(line.partition(":")[0] for line in lines)


def _text(path: Path, name: str) -> str:
    try:
        return _read(path, name).decode()
    except UnicodeDecodeError as error:
        raise SecurityError(f"{name} {path}: is not UTF-8 text at byte {error.start}") from error


def _read(path: Path, name: str) -> bytes:
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_FILE_BYTES + 1)
    except OSError as error:
        raise SecurityError(f"{name} {path}: {_words(error)}") from error
    if len(data) > _MAX_FILE_BYTES:
        raise SecurityError(f"{name} {path}: is larger than {_MAX_FILE_BYTES} bytes")
    return data


def _words(error: OSError) -> str:
    return "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or str(error)).lower()
