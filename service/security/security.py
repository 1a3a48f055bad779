"""With what a Zenoh session shows who it is, and whom it lets do what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.security.access import Access
from service.security.errors import SecurityError
from service.security.files import (
    check_certificates,
    check_private,
    read_password,
    read_users,
    validity_problem,
)

_TLS = "tls/"
_CREDENTIALS_FREE = ("tcp/", "udp/")


@dataclass(frozen=True)
class Certificates:
    """The three files of mutual TLS, PEM.

    Args:
        ca: the authority that every member of the fleet is signed by.
        certificate, key: this program's own; the key must be readable by its owner alone.
    """

    ca: Path
    certificate: Path
    key: Path


@dataclass(frozen=True)
class Security:
    """Who a session is, and who may do what with it. The default is no security at all.

    Args:
        certificates: mutual TLS: both ends show a certificate of the same authority, and the connecting
            end checks that the host name or address is one of the certificate's.
        user, password_file: what this end answers when it is asked for a password.
        users_file: `name:password` lines; who connects here must know one of them.
        access: what others may do, by name; None: everything.
    """

    certificates: Certificates | None = None
    user: str | None = None
    password_file: Path | None = None
    users_file: Path | None = None
    access: Access | None = None

    def check(self, listen: Sequence[str], connect: Sequence[str]) -> None:
        """Whether the files are there, fit together and stay private.

        Certificates that are out of date are not looked at: see `validity_problem`.

        Raises:
            SecurityError: the first thing that is wrong, with the file and the fix.
        """
        for endpoint in (*listen, *connect):
            if endpoint.startswith(_TLS) and self.certificates is None:
                raise SecurityError(
                    f"{endpoint}: TLS needs ca, certificate and key; `uavdepth keys new` makes them"
                )
            if self.certificates is not None and endpoint.startswith(_CREDENTIALS_FREE):
                raise SecurityError(
                    f"{endpoint} is not encrypted although certificates are configured: "
                    f"write {_TLS}{endpoint.partition('/')[2]}"
                )
        if self.certificates is not None:
            check_certificates(self.certificates.ca, self.certificates.certificate, self.certificates.key)
        if self.password_file is not None:
            read_password(self.password_file)
        if self.users_file is not None:
            read_users(self.users_file)
        if self.access is not None and self.certificates is None and self.users_file is None:
            raise SecurityError(
                "an access list needs names that can be trusted: certificates, or a users_file, or both"
            )
        if self.access is not None and self.certificates is None and connect:
            # Passwords are asked for where one listens; who is reached has no name for this list, and Zenoh
            # denies it everything without a word.
            raise SecurityError(
                f"an access list without certificates cannot hold at {connect[0]}: who is reached there "
                "shows no name and would be denied everything. Leave vehicles, viewers and routers out here "
                "(the list of the end that listens holds), or use certificates"
            )

    def validity_problem(self) -> str | None:
        """Why the certificate does not hold now, or None if it does or there is none.

        Raises:
            SecurityError: a certificate that cannot be read.
        """
        return None if self.certificates is None else validity_problem(self.certificates.certificate)

    def options(self, connect: Sequence[str] = ()) -> dict[str, Any]:
        """Zenoh's configuration keys and values.

        Args:
            connect: endpoints that the session connects to. Who is reached there shows a certificate and
                never a user, so in such a session the access list goes by certificates alone.

        Raises:
            SecurityError: a password file that cannot be read.
        """
        options: dict[str, Any] = {}
        if self.certificates is not None:
            key, certificate = str(self.certificates.key), str(self.certificates.certificate)
            tls = "transport/link/tls/"
            options |= {
                f"{tls}enable_mtls": True,
                f"{tls}root_ca_certificate": str(self.certificates.ca),
                f"{tls}listen_private_key": key,
                f"{tls}listen_certificate": certificate,
                f"{tls}connect_private_key": key,
                f"{tls}connect_certificate": certificate,
                f"{tls}verify_name_on_connect": True,
            }
        if self.user is not None and self.password_file is not None:
            options["transport/auth/usrpwd/user"] = self.user
            options["transport/auth/usrpwd/password"] = read_password(self.password_file)
        if self.users_file is not None:
            check_private(self.users_file, "users_file")
            options["transport/auth/usrpwd/dictionary_file"] = str(self.users_file)
        if self.access is not None:
            by_certificate = self.certificates is not None
            by_user = self.users_file is not None and not (by_certificate and connect)
            options["access_control"] = self.access.as_zenoh(by_certificate=by_certificate, by_user=by_user)
        return options
