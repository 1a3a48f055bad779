"""What the document on training shows works as it stands there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from service.cli import COMMANDS
from training.networks.catalogue import NETWORK_NAMES
from training.selfsupervised.settings import NetworkName, SourceKind, load_settings
from training.sequences.opening import SEQUENCE_KINDS

DOCUMENT = Path(__file__).parents[2] / "docs" / "training.md"
TEXT = DOCUMENT.read_text(encoding="utf-8")


def test_the_example_run_is_a_run(tmp_path: Path) -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    path = tmp_path / "run.toml"
    path.write_text(example)
    settings = load_settings(path)
    assert [source.kind for source in settings.sources] == ["kitti-raw", "video"]
    assert settings.sources[0].split == tmp_path / "eigen_zhou_train.txt"


@pytest.mark.parametrize("command", re.findall(r"^uavdepth ([a-z-]+)", TEXT, re.MULTILINE))
def test_its_commands_exist(command: str) -> None:
    assert command in COMMANDS


def test_settings_know_every_reader_and_network() -> None:
    assert set(get_args(SourceKind)) == set(SEQUENCE_KINDS)
    assert set(get_args(NetworkName)) == set(NETWORK_NAMES)
    for kind in SEQUENCE_KINDS:
        assert f"`{kind}`" in TEXT
