"""Who may look at the ground station's page."""

from __future__ import annotations

from pathlib import Path

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from service.errors import ConfigError
from service.ground.access import Access, check_token, is_loopback, make_token
from service.ground.errors import GroundError
from service.ground.station import StationSettings
from service.security.certificates import Authority


def settings_with(**changes: object) -> StationSettings:
    values: dict[str, object] = {
        "config": None,
        "connect": [],
        "listen": [],
        "port": 8080,
        "bind": "127.0.0.1",
        "token": None,
        "host_names": [],
        "certificate": None,
        "key": None,
        **changes,
    }
    return StationSettings.checked(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("127.0.0.1", True),
        ("127.3.2.1", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.0.2.7", False),
        ("example.org", False),
    ],
)
def test_only_loopback_is_loopback(address: str, expected: bool) -> None:
    assert is_loopback(address) is expected


def test_loopback_needs_no_token_and_a_wider_page_always_has_one() -> None:
    assert settings_with().token is None
    wide = settings_with(bind="0.0.0.0")
    assert wide.made_token
    assert wide.token is not None
    assert len(wide.token) >= 20
    assert settings_with(bind="0.0.0.0").token != wide.token


def test_a_token_given_is_kept_on_loopback_too() -> None:
    given = settings_with(token="correct-horse-battery")
    assert (given.token, given.made_token) == ("correct-horse-battery", False)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"token": "short"}, "5 letters: 16 to 256"),
        ({"bind": "0.0.0.0", "token": ""}, "0 letters"),
        ({"token": "ümläüte-sind-nicht-erlaubt"}, "ASCII"),
        ({"connect": ["tcp/host"]}, "--connect: 'tcp/host' is no endpoint"),
        ({"listen": ["ws/0.0.0.0:1"]}, "--listen: 'ws/0.0.0.0:1' is no endpoint"),
        ({"certificate": Path("a.pem")}, "belong together"),
        ({"certificate": Path("none.pem"), "key": Path("none.key")}, "none.pem"),
        ({"config": Path("none.toml")}, "none.toml"),
    ],
)
def test_options_that_cannot_be_used_are_named(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        settings_with(**changes)


def test_an_encrypted_key_is_refused_and_nobody_is_asked_for_its_password(tmp_path: Path) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    pair = Authority.new(10).pair
    (tmp_path / "page.pem").write_bytes(pair.certificate)
    (tmp_path / "page.key").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"secret"),
        )
    )
    with pytest.raises(ConfigError, match=r"page\.key cannot be used"):
        settings_with(certificate=tmp_path / "page.pem", key=tmp_path / "page.key")


def test_made_tokens_pass_the_check_and_differ() -> None:
    assert len({check_token(make_token()) for _ in range(50)}) == 50
    with pytest.raises(GroundError):
        check_token("a b c d e f g h i j")


def test_the_cookie_is_not_the_token_and_survives_a_restart() -> None:
    access = Access("correct-horse-battery")
    assert "horse" not in access.cookie
    assert Access("correct-horse-battery").knows_cookie(access.cookie)
    assert not Access("another-horse-battery").knows_cookie(access.cookie)
    for wrong in (None, "", "ü", access.cookie[:-1]):
        assert not access.knows_cookie(wrong)
    assert access.knows_token("correct-horse-battery")
    assert not access.knows_token("correct-horse-batterx")


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1:8080", True),
        ("localhost:8080", True),
        ("LOCALHOST", True),
        ("[::1]:8080", True),
        ("192.0.2.7:8080", True),  # an address cannot be made to point elsewhere
        ("station.field:8080", True),
        ("evil.example:8080", False),
        ("127.0.0.1.evil.example", False),
        ("localhost.evil.example:8080", False),
        ("", False),
        (None, False),
        ("[::1", False),
    ],
)
def test_a_foreign_name_that_points_here_is_refused(host: str | None, expected: bool) -> None:
    assert Access(None, ["Station.field"]).is_own_host(host) is expected


@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        (None, True),  # no browser
        ("http://127.0.0.1:8080", True),
        ("http://127.0.0.1:9090", False),
        ("http://evil.example", False),
        ("null", False),
        ("file://127.0.0.1:8080", False),
        ("http://[", False),
        ("http://[127.0.0.1", False),
    ],
)
def test_a_foreign_page_is_refused(origin: str | None, expected: bool) -> None:
    assert Access(None).is_own_origin(origin, "127.0.0.1:8080") is expected
