"""The file that holds the key of signed MAVLink."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from signing_support import KEY, written

from service.autopilot.link import AutopilotLink
from service.autopilot.signing_key import load_signing_key
from service.clock import MonotonicClock
from service.errors import LinkError
from service.settings.autopilot import AutopilotSettings


class TestKeyFile:
    def test_32_bytes_are_the_key(self, tmp_path: Path) -> None:
        path = written(tmp_path, KEY.secret)
        assert load_signing_key(path) == KEY

    @pytest.mark.parametrize("text", [b"passphrase: correct horse\n", b"passphrase:correct horse"])
    def test_a_passphrase_is_hashed_as_ground_stations_do(self, tmp_path: Path, text: bytes) -> None:
        assert load_signing_key(written(tmp_path, text)).secret == hashlib.sha256(b"correct horse").digest()

    @pytest.mark.parametrize(
        ("data", "text"),
        [
            (b"", "holds 0 bytes: exactly 32"),
            (b"x" * 31, "holds 31 bytes"),
            (b"x" * 32 + b"\n", "holds 33 bytes"),
            (b"x" * 5000, "more than 4096 bytes"),
            (bytes(32), "is all zero"),
            (b"passphrase:  \n", "the passphrase is empty"),
            (b"passphrase: a\nb\n", "more than one line"),
        ],
    )
    def test_another_file_is_refused_with_its_name(self, tmp_path: Path, data: bytes, text: str) -> None:
        path = written(tmp_path, data)
        with pytest.raises(LinkError, match=text) as refusal:
            load_signing_key(path)
        assert str(path) in str(refusal.value)

    def test_a_missing_file_and_a_folder_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(LinkError, match="no such file"):
            load_signing_key(tmp_path / "key")
        with pytest.raises(LinkError, match="cannot be read"):
            load_signing_key(tmp_path)

    @pytest.mark.parametrize(
        ("mode", "warned"), [(0o600, False), (0o400, False), (0o640, True), (0o644, True)]
    )
    def test_a_key_that_others_can_read_is_warned_about(
        self, tmp_path: Path, mode: int, warned: bool
    ) -> None:
        path = written(tmp_path, KEY.secret)
        path.chmod(mode)
        warning = load_signing_key(path).warning
        assert (warning is not None) is warned
        assert warning is None or "chmod 600" in warning

    def test_the_key_is_never_shown(self) -> None:
        assert "secret" not in repr(KEY)

    def test_a_link_with_a_wrong_key_file_does_not_start(self, tmp_path: Path) -> None:
        settings = AutopilotSettings(endpoint="udp:127.0.0.1:0", signing_key_file=str(tmp_path / "key"))
        link = AutopilotLink(settings, MonotonicClock())
        with pytest.raises(LinkError, match="no such file"):
            link.start()
        link.close()
