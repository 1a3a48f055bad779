"""Keys of a fleet on disk: made once, private, and named when something is wrong with them."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli import build_app
from service.errors import ConfigError
from service.router_command import router_settings
from service.security.certificates import Authority, KeyPair
from service.security.command import keys_app
from service.security.errors import SecurityError
from service.security.files import validity_problem
from service.security.fleet import FleetFolder, Member, read_fleet
from service.security.options import load_zenoh_settings
from service.settings.zenoh import ZenohSettings


def members(*texts: str) -> tuple[Member, ...]:
    return tuple(Member.parse(text.partition(" ")[2], text.partition(" ")[0]) for text in texts)  # type: ignore[arg-type]


HUB, KITE, DESK = "router hub=127.0.0.1", "vehicle kite", "viewer desk"


def make(folder: Path, *texts: str, passwords: bool = True) -> FleetFolder:
    fleet = FleetFolder(folder, members(*texts), 100, passwords=passwords, target=None)
    fleet.make(force=False)
    return fleet


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make(tmp_path / "fleet", HUB, KITE, DESK)
    return tmp_path / "fleet"


def test_every_member_gets_a_configuration_that_works_as_it_is(folder: Path) -> None:
    for name in ("hub", "desk", "kite"):
        settings = load_zenoh_settings(folder / name / "zenoh.toml")
        assert settings.security.validity_problem() is None
        assert (settings.vehicles, settings.viewers, settings.routers) == (("kite",), ("desk",), ("hub",))
    assert load_zenoh_settings(folder / "desk" / "zenoh.toml").connect == ("tls/127.0.0.1:7447",)
    assert tomllib.loads((folder / "kite" / "zenoh.toml").read_text())["vehicle"] == {"name": "kite"}


def test_keys_and_passwords_are_their_owners_alone(folder: Path) -> None:
    private = [*folder.rglob("*key*"), *folder.rglob("password"), *folder.rglob("users")]
    assert len(private) == 4 + 3 + 1
    assert {path.stat().st_mode & 0o777 for path in private} == {0o600}


def test_nothing_is_overwritten_without_force(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(SecurityError, match="is not empty"):
        make(folder, HUB, KITE, DESK)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before
    FleetFolder(folder, members(HUB, KITE), 100, passwords=True, target=None).make(force=True)
    assert (folder / "ca" / "ca.key").read_bytes() != before[folder / "ca" / "ca.key"]


def test_force_replaces_a_fleet_and_no_other_folder(tmp_path: Path) -> None:
    (tmp_path / "kite").mkdir()
    (tmp_path / "kite" / "diary.txt").write_text("not yours")
    members = (Member("kite", "vehicle", ("10.0.0.1",)),)
    with pytest.raises(SecurityError, match="holds no fleet"):
        FleetFolder(tmp_path, members, 10, passwords=True, target=None).make(force=True)
    assert (tmp_path / "kite" / "diary.txt").exists()


def test_members_can_be_added_and_the_others_keep_their_keys(folder: Path) -> None:
    key = (folder / "kite" / "key.pem").read_bytes()
    known, passwords = read_fleet(folder)
    FleetFolder(folder, (*known, *members("vehicle heron")), 100, passwords=passwords, target=None).extend()
    assert (folder / "kite" / "key.pem").read_bytes() == key
    assert load_zenoh_settings(folder / "heron" / "zenoh.toml").vehicles == ("kite", "heron")
    assert load_zenoh_settings(folder / "hub" / "zenoh.toml").vehicles == ("kite", "heron")


def test_a_viewer_reaches_vehicles_directly_where_there_is_no_router(tmp_path: Path) -> None:
    fleet = make(tmp_path / "f", "vehicle kite=10.0.0.2", "vehicle heron=heron.local", DESK, passwords=False)
    desk = tomllib.loads(fleet.configuration(fleet.members[2]))["zenoh"]
    assert desk["connect"] == ["tls/10.0.0.2:7447", "tls/heron.local:7447"]
    assert "user" not in desk
    assert fleet.members[0].listen == ("tls/10.0.0.2:7447",)
    assert fleet.members[1].listen == ("tls/0.0.0.0:7447",)


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        ("no vehicle", [HUB, DESK]),
        ("nobody can be reached", [KITE, DESK]),
        ("given twice", [HUB, KITE, "viewer kite"]),
    ],
)
def test_a_fleet_that_cannot_work_is_refused(tmp_path: Path, words: str, texts: list[str]) -> None:
    with pytest.raises(SecurityError, match=words):
        make(tmp_path / "fleet", *texts)
    assert not (tmp_path / "fleet").exists()


@pytest.mark.parametrize(
    ("role", "text"),
    [
        ("vehicle", "kite\n"),
        ("vehicle", "a/b"),
        ("vehicle", ""),
        ("vehicle", "ca"),
        ("router", "h=a b"),
        ("viewer", "desk=10.0.0.1"),
    ],
)
def test_names_and_hosts_that_cannot_be_used_are_refused(role: str, text: str) -> None:
    with pytest.raises(SecurityError, match=f"--{role}"):
        Member.parse(text, role)  # type: ignore[arg-type]


def overwrite(name: str, data: bytes) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_bytes(data) and None


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda f: (f / "key.pem").unlink(), "key .*key.pem: no such file"),
        (lambda f: (f / "certificate.pem").unlink(), "certificate .*: no such file"),
        (lambda f: (f / "key.pem").chmod(0o644), r"others can read it \(mode 0644\): chmod 600"),
        (lambda f: (f / "password").chmod(0o640), r"password_file .*mode 0640"),
        (overwrite("ca.pem", b"nothing"), "ca .*: holds no PEM certificate"),
        (overwrite("key.pem", b"nothing"), "key .*: holds no PEM private key"),
        (overwrite("certificate.pem", b"\xff" * 20), "certificate .*: holds no PEM certificate"),
        (overwrite("key.pem", Authority.new(1).pair.key), "is not the key of certificate"),
        (overwrite("ca.pem", Authority.new(1).pair.certificate), "is not signed by ca"),
        (overwrite("users", b"no colon\n"), "users_file .*line 1 is not of the form name:password"),
        (overwrite("users", b"\n"), "holds no user"),
        (overwrite("password", b"\n"), "its first line is empty"),
        (overwrite("password", b"\xff\xfe"), "not UTF-8"),
        (overwrite("ca.pem", b" " * 1_000_001), "larger than"),
    ],
)
def test_a_file_that_is_wrong_is_named(folder: Path, damage: Callable[[Path], None], words: str) -> None:
    damage(folder / "hub")
    with pytest.raises(SecurityError, match=words):
        load_zenoh_settings(folder / "hub" / "zenoh.toml")


@pytest.mark.parametrize(("days", "words"), [(101, "expired on"), (-2, "is valid from")])
def test_a_certificate_out_of_date_is_told(folder: Path, days: int, words: str) -> None:
    at = datetime.now(UTC) + timedelta(days=days)
    assert words in (validity_problem(folder / "kite" / "certificate.pem", at) or "")
    assert validity_problem(folder / "kite" / "certificate.pem") is None


def test_a_router_whose_certificate_has_expired_says_so_and_does_not_start(
    folder: Path,
) -> None:
    authority = Authority(
        KeyPair((folder / "ca" / "ca.pem").read_bytes(), (folder / "ca" / "ca.key").read_bytes())
    )
    old = authority.issue("hub", ("127.0.0.1",), 10, datetime.now(UTC) - timedelta(days=50))
    (folder / "hub" / "certificate.pem").write_bytes(old.certificate)
    (folder / "hub" / "key.pem").write_bytes(old.key)
    settings = router_settings(folder / "hub" / "zenoh.toml", None, None)
    assert "expired on" in (settings.security.validity_problem() or "")
    result = CliRunner().invoke(
        build_app("router"), ["router", "--config", str(folder / "hub" / "zenoh.toml")]
    )
    assert isinstance(result.exception, SecurityError)
    assert "expired on" in str(result.exception)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"ca": "a"}, "certificate, key: missing"),
        ({"user": "kite"}, "belong together"),
        ({"vehicles": ("a", "a")}, "named twice"),
        ({"viewers": ("a/*",)}, "is no name"),
        ({"listen": ("tls/127.0.0.1:0",)}, "port 0"),
    ],
)
def test_settings_that_do_not_fit_together_are_refused(table: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ZenohSettings(**table)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"listen": ("tls/127.0.0.1:7447",)}, "TLS needs ca"),
        ({"viewers": ("desk",)}, "an access list needs names"),
    ],
)
def test_security_without_what_it_needs_is_refused(table: dict[str, object], words: str) -> None:
    settings = ZenohSettings(**table)  # type: ignore[arg-type]
    with pytest.raises(SecurityError, match=words):
        settings.security.check(settings.listen, settings.connect)


def test_plain_endpoints_beside_certificates_are_refused(folder: Path) -> None:
    with pytest.raises(ConfigError, match="not encrypted although certificates are configured: write tls/"):
        router_settings(folder / "hub" / "zenoh.toml", ["tcp/127.0.0.1:7447"], None)


def test_everything_is_off_the_network_unless_configured() -> None:
    assert ZenohSettings().listen == ("tcp/127.0.0.1:7447",)
    assert ZenohSettings().connect == ()


def test_keys_says_what_goes_where(tmp_path: Path) -> None:
    arguments = ["new", str(tmp_path / "f"), "--vehicle", "kite", "--viewer", "desk", "--router", "10.0.0.1"]
    result = CliRunner().invoke(keys_app, [*arguments, "--target", "/etc/uavdepth"])
    assert result.exit_code == 0, result.output
    assert "copy to vehicle kite" in result.output
    assert 'key = "/etc/uavdepth/key.pem"' in (tmp_path / "f" / "10-0-0-1" / "zenoh.toml").read_text()
    added = CliRunner().invoke(keys_app, ["add", str(tmp_path / "f"), "--vehicle", "heron"])
    assert added.exit_code == 0, added.output
    assert isinstance(
        CliRunner().invoke(keys_app, ["add", str(tmp_path), "--vehicle", "x"]).exception, SecurityError
    )
