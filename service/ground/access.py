"""Who may look: token, session cookie, Host and Origin."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import secrets
import socket
from collections.abc import Iterable
from typing import Final
from urllib.parse import urlsplit

from service.ground.errors import GroundError

MIN_TOKEN_LETTERS: Final = 16
MAX_TOKEN_LETTERS: Final = 256
_TOKEN_BYTES = 18
_COOKIE_PURPOSE = b"uavdepth ground session"


def make_token() -> str:
    """A token of 144 random bits that a person can still type."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


def check_token(token: str) -> str:
    """`token` unchanged.

    Raises:
        GroundError: one that could be guessed, or cannot travel.
    """
    if not MIN_TOKEN_LETTERS <= len(token) <= MAX_TOKEN_LETTERS:
        raise GroundError(
            f"the token has {len(token)} letters: {MIN_TOKEN_LETTERS} to {MAX_TOKEN_LETTERS} are needed"
        )
    if not token.isascii() or not token.isprintable() or " " in token:
        raise GroundError("the token has letters other than printable ASCII without spaces")
    return token


def is_loopback(address: str) -> bool:
    """Whether only programs of this computer reach a server bound to `address`."""
    if address == "localhost":
        return True
    try:
        return ipaddress.ip_address(address.strip("[]")).is_loopback
    except ValueError:
        return False


class Access:
    """Judges requests. Every comparison of a secret takes the same time whatever was sent.

    Args:
        token: what a browser must know; None lets everyone in who gets through to the port.
        host_names: names that this station is called by, besides addresses, `localhost` and the name
            of this computer.
    """

    def __init__(self, token: str | None, host_names: Iterable[str] = ()) -> None:
        self._token = None if token is None else token.encode()
        own_name = socket.gethostname().lower()
        self._host_names = {
            "localhost",
            own_name,
            f"{own_name}.local",
            *(name.lower() for name in host_names),
        }

    @property
    def needs_token(self) -> bool:
        """Whether a token is asked for."""
        return self._token is not None

    @property
    def cookie(self) -> str:
        """What a browser keeps instead of the token; the same after a restart with the same token."""
        return hmac.new(self._token or b"", _COOKIE_PURPOSE, hashlib.sha256).hexdigest()

    def knows_token(self, token: str) -> bool:
        """Whether `token` is the right one."""
        return self._token is None or hmac.compare_digest(token.encode(errors="replace"), self._token)

    def knows_cookie(self, cookie: str | None) -> bool:
        """Whether the browser was let in before."""
        if self._token is None:
            return True
        return hmac.compare_digest((cookie or "").encode(errors="replace"), self.cookie.encode())

    def is_own_host(self, host: str | None) -> bool:
        """Whether a Host header names this station.

        A page of a foreign name that was made to point here (DNS rebinding) sends that foreign name; an
        address cannot be made to point elsewhere.
        """
        name = _host_name(host)
        if name is None:
            return False
        if name in self._host_names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True

    def is_own_origin(self, origin: str | None, host: str | None) -> bool:
        """Whether a request comes from this station's own page, or from a program that is no browser."""
        if origin is None:
            return True
        try:
            parts = urlsplit(origin)
        except ValueError:
            return False
        return (
            parts.scheme in ("http", "https") and bool(host) and parts.netloc.lower() == (host or "").lower()
        )


def _host_name(host: str | None) -> str | None:
    if not host:
        return None
    try:
        name = urlsplit(f"//{host}").hostname
    except ValueError:
        return None
    return None if name is None else name.rstrip(".")
