"""Who belongs to a fleet, and the folder in which each member's certificate and configuration lie."""

from __future__ import annotations

import ipaddress
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, Literal

from service.publisher.keys import VEHICLE_NAME_PATTERN
from service.security.certificates import Authority, KeyPair
from service.security.errors import SecurityError

PORT: Final = 7447
_AUTHORITY = "ca"
_FLEET = "fleet.json"
_HOST = re.compile(r"^[A-Za-z0-9._:\[\]-]+$")
_AUTHORITY_DAYS = 3650

Role = Literal["vehicle", "viewer", "router"]


@dataclass(frozen=True)
class Member:
    """One program of the fleet.

    Args:
        name: common name of its certificate; a vehicle's is that of its keys.
        role: what it may do.
        hosts: names and addresses at which others reach it; without any it only connects.
    """

    name: str
    role: Role
    hosts: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str, role: Role) -> Member:
        """A member of `NAME` or `NAME=HOST,HOST`; a router may be `HOST` alone.

        Raises:
            SecurityError: a name or host that cannot be used.
        """
        name, _, rest = text.partition("=")
        hosts = tuple(host for host in rest.split(",") if host)
        if role == "router" and not hosts:
            hosts, name = (name,), re.sub(r"[^A-Za-z0-9_-]", "-", name)
        if not re.fullmatch(VEHICLE_NAME_PATTERN, name) or len(name) > 64:
            raise SecurityError(
                f"--{role} {text!r}: {name!r} is no name: 1 to 64 letters, digits, `_` and `-` are needed"
            )
        if name == _AUTHORITY:
            raise SecurityError(f"--{role} {text!r}: {name!r} is the folder of the authority: choose another")
        for host in hosts:
            if not _HOST.fullmatch(host):
                raise SecurityError(f"--{role} {text!r}: {host!r} is neither a host name nor an address")
        if role == "viewer" and hosts:
            raise SecurityError(
                f"--viewer {text!r}: viewers connect and are not reached: leave the hosts out"
            )
        return cls(name, role, hosts)

    @property
    def listen(self) -> tuple[str, ...]:
        """Endpoints of its own addresses; all addresses where it is known by name only."""
        addresses = [host for host in self.hosts if _is_address(host)]
        if not self.hosts:
            return ()
        return tuple(_endpoint(host) for host in addresses) or (_endpoint("0.0.0.0"),)

    @property
    def reached_at(self) -> str | None:
        """Endpoint for others, None if it only connects."""
        return _endpoint(self.hosts[0]) if self.hosts else None


class FleetFolder:
    """The folder of `uavdepth keys`: one subfolder a member, and the authority's.

    Args:
        path: the folder.
        members: everybody.
        days: how long new certificates hold.
        passwords: give everybody a user and password as well.
        target: folder on the member's computer that the configuration names; None: where the files are.
    """

    def __init__(
        self, path: Path, members: tuple[Member, ...], days: int, *, passwords: bool, target: Path | None
    ) -> None:
        names = [member.name for member in members]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise SecurityError(f"{twice[0]!r} is given twice: every member needs a name of its own")
        if not any(member.role == "vehicle" for member in members):
            raise SecurityError("no vehicle is given: --vehicle NAME")
        if not any(member.hosts for member in members):
            raise SecurityError(
                "nobody can be reached: give a router (--router HOST) or a vehicle's address "
                "(--vehicle NAME=HOST)"
            )
        self._path, self.members, self._days = path, members, days
        self._passwords, self._target = passwords, target

    def make(self, *, force: bool) -> None:
        """A new authority, and everything signed by it.

        Raises:
            SecurityError: a folder that is not empty, unless it holds a fleet and `force` is given, or that
                cannot be written.
        """
        is_taken = self._path.exists() and (not self._path.is_dir() or any(self._path.iterdir()))
        if is_taken and not (self._path / _AUTHORITY / _FLEET).is_file():
            # Folders named like members would be deleted, whatever is in them.
            raise SecurityError(f"{self._path} is not empty and holds no fleet: choose another folder")
        if is_taken and not force:
            raise SecurityError(
                f"{self._path} is not empty: a new authority makes every certificate in it worthless; "
                "`uavdepth keys add` adds members, --force replaces it"
            )
        with _named(self._path):
            for member in self.members:
                shutil.rmtree(self._path / member.name, ignore_errors=True)
            shutil.rmtree(self._path / _AUTHORITY, ignore_errors=True)
            authority = Authority.new(_AUTHORITY_DAYS)
            folder = self._path / _AUTHORITY
            folder.mkdir(mode=0o700, parents=True)
            _write_pair(folder, authority.pair, "ca")
        self._write(authority)

    def extend(self) -> None:
        """Certificates of the same authority for members that have none yet; configurations for all.

        Raises:
            SecurityError: an authority that cannot be read, or a folder that cannot be written.
        """
        folder = self._path / _AUTHORITY
        with _named(folder):
            pair = KeyPair((folder / "ca.pem").read_bytes(), (folder / "ca.key").read_bytes())
        try:
            authority = Authority(pair)
        except (ValueError, TypeError) as error:
            raise SecurityError(f"{folder}: holds no authority: {error}") from error
        self._write(authority)

    def _write(self, authority: Authority) -> None:
        with _named(self._path):
            for member in self.members:
                folder = self._path / member.name
                if not (folder / "certificate.pem").exists():
                    folder.mkdir(mode=0o700, exist_ok=True)
                    pair = authority.issue(member.name, member.hosts, self._days)
                    _write_pair(folder, pair, "certificate", "key")
                    _write_public(folder / "ca.pem", authority.pair.certificate)
                if self._passwords and not (folder / "password").exists():
                    _write_private(folder / "password", f"{secrets.token_urlsafe(24)}\n".encode())
            for member in self.members:
                self._configure(member)
            fleet = {"members": [asdict(member) for member in self.members], "passwords": self._passwords}
            _write_public(self._path / _AUTHORITY / _FLEET, json.dumps(fleet, indent=1).encode())

    def _configure(self, member: Member) -> None:
        folder = self._path / member.name
        if self._passwords and member.hosts:
            users = [
                f"{other.name}:{(self._path / other.name / 'password').read_text().strip()}\n"
                for other in self.members
                if other is not member
            ]
            (folder / "users").unlink(missing_ok=True)
            _write_private(folder / "users", "".join(users).encode())
        (folder / "zenoh.toml").unlink(missing_ok=True)
        _write_public(folder / "zenoh.toml", self.configuration(member).encode())

    def configuration(self, member: Member) -> str:
        """The member's TOML."""
        place = self._target or (self._path / member.name).absolute()
        routers = [
            other.reached_at for other in self.members if other.role == "router" and other is not member
        ]
        connect = [endpoint for endpoint in routers if endpoint is not None]
        if member.role == "viewer" and not connect:
            connect = [
                other.reached_at
                for other in self.members
                if other.role == "vehicle" and other.reached_at is not None
            ]
        if member.role == "router":
            # Routers that know each other both ways would connect twice: the later ones connect.
            earlier = self.members[: self.members.index(member)]
            connect = [o.reached_at for o in earlier if o.role == "router" and o.reached_at is not None]
        lines = [f'[vehicle]\nname = "{member.name}"\n'] if member.role == "vehicle" else []
        lines += [
            "[zenoh]",
            f"listen = {json.dumps(member.listen)}",
            f"connect = {json.dumps(connect)}",
            *(f"{key} = {json.dumps(str(place / name))}" for key, name in _FILES),
        ]
        if self._passwords:
            lines += [f'user = "{member.name}"', f"password_file = {json.dumps(str(place / 'password'))}"]
            if member.hosts:
                lines.append(f"users_file = {json.dumps(str(place / 'users'))}")
        for key, role in (("vehicles", "vehicle"), ("viewers", "viewer"), ("routers", "router")):
            lines.append(f"{key} = {json.dumps([m.name for m in self.members if m.role == role])}")
        return "\n".join(lines) + "\n"


_FILES = (("ca", "ca.pem"), ("certificate", "certificate.pem"), ("key", "key.pem"))


def read_fleet(path: Path) -> tuple[tuple[Member, ...], bool]:
    """The members of a fleet folder, and whether they have passwords.

    Raises:
        SecurityError: a folder that `FleetFolder.make` has not written.
    """
    try:
        table = json.loads((path / _AUTHORITY / _FLEET).read_bytes())
        members = tuple(Member(m["name"], m["role"], tuple(m["hosts"])) for m in table["members"])
        return members, bool(table["passwords"])
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise SecurityError(f"{path}: holds no fleet; `uavdepth keys new` makes one") from error


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return False
    return True


def _endpoint(host: str) -> str:
    bare = host.strip("[]")
    return f"tls/[{bare}]:{PORT}" if ":" in bare else f"tls/{bare}:{PORT}"


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """OSError as SecurityError with the path."""
    try:
        yield
    except OSError as error:
        words = (error.strerror or str(error)).lower()
        raise SecurityError(f"{error.filename or path}: {words}") from error


def _write_pair(folder: Path, pair: KeyPair, certificate: str, key: str | None = None) -> None:
    _write_public(folder / f"{certificate}.pem", pair.certificate)
    _write_private(folder / (f"{key}.pem" if key else f"{certificate}.key"), pair.key)


def _write_public(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _write_private(path: Path, data: bytes) -> None:
    """A file that nobody else could read at any moment."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
