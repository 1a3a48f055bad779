"""Who may speak and who is refused: real sessions with real certificates through a real router."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh
from program_fakes import free_port, wait_until

from service.publisher import keys
from service.publisher.session import Role, open_session
from service.security.access import Access
from service.security.certificates import Authority
from service.security.errors import SecurityError
from service.security.security import Certificates, Security

FLEET = Access(vehicles=("kite", "heron"), viewers=("desk",), routers=("hub",))
HOST = "127.0.0.1"


@dataclass(frozen=True)
class Fleet:
    """Certificates of a fleet and of its enemies."""

    folder: Path

    def issue(self, authority: Authority, name: str, hosts: tuple[str, ...] = (), age_days: int = 0) -> None:
        pair = authority.issue(name, hosts, 100, datetime.now(UTC) - timedelta(days=age_days))
        (self.folder / f"{name}.pem").write_bytes(pair.certificate)
        key = self.folder / f"{name}.key"
        key.touch(mode=0o600)
        key.write_bytes(pair.key)

    def security(self, name: str, ca: str = "ca", access: Access | None = None) -> Security:
        folder = self.folder
        files = Certificates(folder / f"{ca}.pem", folder / f"{name}.pem", folder / f"{name}.key")
        return Security(certificates=files, access=access)

    def private(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.touch(mode=0o600)
        path.write_text(text)
        return path


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    made = Fleet(tmp_path_factory.mktemp("fleet"))
    ours, theirs = Authority.new(1000), Authority.new(1000)
    for name, authority in (("ca", ours), ("foreign-ca", theirs)):
        (made.folder / f"{name}.pem").write_bytes(authority.pair.certificate)
    made.issue(ours, "hub", (HOST,))
    made.issue(ours, "elsewhere", ("hub.example.org",))
    for name in ("kite", "heron", "desk", "stranger"):
        made.issue(ours, name)
    made.issue(ours, "expired", age_days=200)
    made.issue(theirs, "forged")
    return made


@contextmanager
def router(security: Security) -> Iterator[tuple[zenoh.Session, str]]:
    endpoint = f"{'tls' if security.certificates else 'tcp'}/{HOST}:{free_port()}"
    with open_session([endpoint], [], security, Role.STATION) as session:
        yield session, endpoint


def connected(session: zenoh.Session) -> set[str]:
    return {str(zid) for zid in (*session.info.peers_zid(), *session.info.routers_zid())}


def is_heard(viewer: zenoh.Session, vehicle: zenoh.Session, key: str) -> None:
    """Return when what `vehicle` puts on `key` arrives at `viewer`."""
    heard: list[str] = []
    subscriber = viewer.declare_subscriber(key, lambda sample: heard.append(str(sample.key_expr)))

    def put() -> bool:
        vehicle.put(key, b"x")
        return bool(heard)

    wait_until(put)
    subscriber.undeclare()  # type: ignore[no-untyped-call]


@dataclass
class Ground:
    """What a viewer heard, in order."""

    keys: list[str]
    alive: list[str]


def test_members_do_what_they_may_and_nothing_else(fleet: Fleet) -> None:
    with ExitStack() as stack:
        _, endpoint = stack.enter_context(router(fleet.security("hub", access=FLEET)))
        kite, heron = (
            stack.enter_context(open_session([], [endpoint], fleet.security(name)))
            for name in ("kite", "heron")
        )
        desk = stack.enter_context(open_session([], [endpoint], fleet.security("desk"), Role.STATION))
        ground = Ground([], [])
        desk.declare_subscriber(
            "uavdepth/*/scan", lambda s: ground.keys.append(f"{s.key_expr} {s.payload.to_string()}")
        )
        desk.liveliness().declare_subscriber(
            "uavdepth/*/alive", lambda s: ground.alive.append(str(s.key_expr)), history=True
        )
        reports: list[str] = []
        kite.declare_subscriber(
            keys.key("kite", keys.RECEIVED), lambda s: reports.append(s.payload.to_string())
        )
        eavesdropped: list[str] = []
        kite.declare_subscriber(
            keys.key("heron", keys.STATUS), lambda s: eavesdropped.append(str(s.key_expr))
        )
        # A vehicle that poses as another: its token, then its scans, and then its own.
        kite.liveliness().declare_token(keys.key("heron", keys.ALIVE))
        kite.liveliness().declare_token(keys.key("kite", keys.ALIVE))

        def speak() -> bool:
            kite.put(keys.key("heron", keys.SCAN), "spoofed")
            kite.put(keys.key("kite", keys.SCAN), "own")
            heron.put(keys.key("heron", keys.STATUS), "for the ground")
            heron.put(keys.key("heron", keys.SCAN), "own")
            return {"uavdepth/kite/scan own", "uavdepth/heron/scan own"} <= set(ground.keys)

        wait_until(speak)
        wait_until(lambda: bool(ground.alive))
        assert not [line for line in ground.keys if "spoofed" in line]
        assert set(ground.alive) == {keys.key("kite", keys.ALIVE)}

        # A viewer that writes: refused on every key but its report.
        other = stack.enter_context(open_session([], [endpoint], fleet.security("desk"), Role.STATION))
        wait_until(lambda: bool(connected(other)))

        def write() -> bool:
            other.put(keys.key("kite", keys.SCAN), "written by a viewer")
            other.put(keys.key("kite", keys.RECEIVED), "report")
            return bool(reports)

        wait_until(write)
        is_heard(desk, kite, keys.key("kite", keys.SCAN))
        assert not [line for line in ground.keys if "viewer" in line]
        assert eavesdropped == []


@pytest.mark.parametrize("who", ["nobody", "forged", "expired"])
def test_without_a_certificate_that_holds_nobody_gets_in(fleet: Fleet, who: str) -> None:
    with router(fleet.security("hub")) as (hub, endpoint):
        if who == "nobody":
            # A client that shows nothing: TLS towards us, no certificate of its own.
            config = zenoh.Config()
            config.insert_json5("connect/endpoints", f'["{endpoint}"]')
            config.insert_json5("mode", '"peer"')
            config.insert_json5("scouting/multicast/enabled", "false")
            ca = fleet.folder / "ca.pem"
            config.insert_json5("transport/link/tls/root_ca_certificate", f'"{ca}"')
            intruder = zenoh.open(config)
        else:
            security = fleet.security(who, ca="foreign-ca" if who == "forged" else "ca")
            intruder = open_session([], [endpoint], security)
        with intruder, open_session([], [endpoint], fleet.security("kite")) as kite:
            # The intruder came first: when the member is in, it has had its turn.
            wait_until(lambda: bool(connected(kite)))
            assert connected(hub) == {str(kite.info.zid())}
            assert connected(intruder) == set()


def test_a_router_that_shows_another_name_is_not_believed(fleet: Fleet) -> None:
    with (
        router(fleet.security("elsewhere")) as (_, wrong),
        router(fleet.security("hub")) as (_, right),
        open_session([], [wrong], fleet.security("kite")) as misled,
        open_session([], [right], fleet.security("kite")) as kite,
    ):
        wait_until(lambda: bool(connected(kite)))
        assert connected(misled) == set()


def test_a_certificate_that_no_list_names_may_do_nothing(fleet: Fleet) -> None:
    with (
        router(fleet.security("hub", access=FLEET)) as (_, endpoint),
        open_session([], [endpoint], fleet.security("stranger"), Role.STATION) as stranger,
        open_session([], [endpoint], fleet.security("desk"), Role.STATION) as desk,
        open_session([], [endpoint], fleet.security("kite")) as kite,
    ):
        heard: list[str] = []
        stranger.declare_subscriber("uavdepth/**", lambda sample: heard.append(str(sample.key_expr)))
        wait_until(lambda: bool(connected(stranger)))
        is_heard(desk, kite, keys.key("kite", keys.SCAN))
        assert heard == []


def test_a_viewer_on_a_direct_link_hears_no_vehicle_under_anothers_name(tmp_path: Path) -> None:
    made = Fleet(tmp_path)
    authority = Authority.new(100)
    (made.folder / "direct-ca.pem").write_bytes(authority.pair.certificate)
    made.issue(authority, "kite", (HOST,))
    made.issue(authority, "desk")
    endpoint = f"tls/{HOST}:{free_port()}"
    with (
        open_session([endpoint], [], made.security("kite", "direct-ca", FLEET)) as kite,
        open_session([], [endpoint], made.security("desk", "direct-ca", FLEET), Role.STATION) as desk,
    ):
        heard: list[str] = []
        desk.declare_subscriber("uavdepth/*/scan", lambda sample: heard.append(str(sample.key_expr)))

        def speak() -> bool:
            kite.put(keys.key("heron", keys.SCAN), b"spoofed")
            kite.put(keys.key("kite", keys.SCAN), b"own")
            return len(heard) >= 3

        wait_until(speak)
        assert set(heard) == {keys.key("kite", keys.SCAN)}


@pytest.mark.parametrize(("user", "password"), [("kite", "wrong"), ("nobody", "right"), (None, None)])
def test_a_wrong_password_does_not_get_in(fleet: Fleet, user: str | None, password: str | None) -> None:
    users = fleet.private("users", "kite:right\ndesk:seen\n")
    right = Security(user="kite", password_file=fleet.private("right", "right\n"))
    wrong = Security()
    if user is not None:
        wrong = Security(user=user, password_file=fleet.private("given", f"{password}\n"))
    with (
        router(Security(users_file=users, access=replace(FLEET, routers=()))) as (hub, endpoint),
        open_session([], [endpoint], wrong) as intruder,
        open_session([], [endpoint], right) as kite,
    ):
        wait_until(lambda: bool(connected(kite)))
        assert connected(hub) == {str(kite.info.zid())}
        assert connected(intruder) == set()


def test_with_passwords_alone_the_list_of_who_listens_holds(fleet: Fleet) -> None:
    users = fleet.private("passwords", "kite:k\ndesk:d\n")
    access = replace(FLEET, routers=())
    kite, desk = (
        Security(user=name, password_file=fleet.private(f"alone-{name}", f"{name[0]}\n"))
        for name in ("kite", "desk")
    )
    with (
        router(Security(users_file=users, access=access)) as (_, endpoint),
        open_session([], [endpoint], desk, Role.STATION) as viewer,
        open_session([], [endpoint], kite) as vehicle,
    ):
        heard: list[str] = []
        viewer.declare_subscriber("uavdepth/*/scan", lambda sample: heard.append(str(sample.key_expr)))

        def speak() -> bool:
            vehicle.put(keys.key("heron", keys.SCAN), b"spoofed")
            vehicle.put(keys.key("kite", keys.SCAN), b"own")
            return len(heard) >= 3

        wait_until(speak)
        assert set(heard) == {keys.key("kite", keys.SCAN)}
        # Zenoh would deny this session everything, its own scans too, and say nothing.
        with pytest.raises(
            SecurityError, match=f"cannot hold at {endpoint}: who is reached there shows no name"
        ):
            open_session([], [endpoint], replace(kite, users_file=users, access=access))


def test_certificate_and_password_together_name_who_it_is(fleet: Fleet) -> None:
    users = fleet.private("both", "kite:k\ndesk:d\n")

    def member(name: str, user: str, password: str) -> Security:
        path = fleet.private(f"password-{user}", f"{password}\n")
        return replace(fleet.security(name), user=user, password_file=path)

    with (
        router(replace(fleet.security("hub", access=FLEET), users_file=users)) as (_, endpoint),
        open_session([], [endpoint], member("desk", "desk", "d"), Role.STATION) as desk,
        open_session([], [endpoint], member("heron", "kite", "k")) as mixed,
        open_session([], [endpoint], member("kite", "kite", "k")) as kite,
    ):
        heard: list[str] = []
        desk.declare_subscriber("uavdepth/*/scan", lambda sample: heard.append(sample.payload.to_string()))
        wait_until(lambda: bool(connected(mixed)))

        def speak() -> bool:
            mixed.put(keys.key("kite", keys.SCAN), "mixed")
            mixed.put(keys.key("heron", keys.SCAN), "mixed")
            kite.put(keys.key("kite", keys.SCAN), "right")
            return len(heard) >= 3

        wait_until(speak)
        assert set(heard) == {"right"}
