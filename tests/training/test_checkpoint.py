"""Checkpoints: whole or not there, refused by name, and the start of other runs."""

from __future__ import annotations

import resource
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_runs import run_to_end, settings

from training.checkpoint import Checkpoint
from training.data.batches import FramePool
from training.errors import CheckpointError
from training.trainer import Trainer


def test_a_checkpoint_survives_a_crash_while_it_is_written(pool: FramePool, tmp_path: Path) -> None:
    trainer = Trainer(settings(), pool, pretrained=False)
    path = tmp_path / "run" / "checkpoint.pt"
    trainer.save(path)
    (path.parent / "checkpoint.pt.part").write_bytes(b"half of it")
    assert Checkpoint.load(path).settings == trainer.settings


def test_a_full_disk_leaves_the_last_good_checkpoint(pool: FramePool, tmp_path: Path) -> None:
    trainer = Trainer(settings(), pool, pretrained=False)
    path = tmp_path / "checkpoint.pt"
    trainer.save(path)
    good = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(CheckpointError, match=r"checkpoint\.pt cannot be written.*before it is whole"):
            trainer.save(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == good
    assert list(tmp_path.glob("*.part")) == []


def changed(path: Path, **entries: object) -> Path:
    """The checkpoint with other entries."""
    content = torch.load(path, weights_only=True)
    torch.save({**content, **entries}, path)
    return path


def test_an_old_checkpoint_is_refused_with_a_way_out(pool: FramePool, tmp_path: Path) -> None:
    path = tmp_path / "old.pt"
    Trainer(settings(), pool, pretrained=False).save(path)
    with pytest.raises(CheckpointError, match=r"old\.pt is a checkpoint of format 1, 2 is needed.*--init"):
        Checkpoint.load(changed(path, format=1))


def test_a_checkpoint_of_another_network_is_named(pool: FramePool, tmp_path: Path) -> None:
    path = tmp_path / "other.pt"
    Trainer(settings(), pool, pretrained=False).save(path)
    with pytest.raises(CheckpointError, match="network 'monodepth2', 'lite0-fan-eca-hints' is needed"):
        Checkpoint.load(changed(path, architecture="monodepth2"))


def test_a_run_starts_from_the_weights_of_an_older_format(pool: FramePool, tmp_path: Path) -> None:
    older = Trainer(settings(), pool, pretrained=False)
    run_to_end(older)
    path = tmp_path / "old.pt"
    older.save(path)
    average = dict(older.checkpoint().average)
    hints = {name: average.pop(name) for name in list(average) if name.startswith(("hints.", "correction."))}
    average["sigma_head.output.weight"] = torch.ones(1)
    changed(path, format=1, average=average, settings={})

    trainer = Trainer(replace(settings(), seed=7), pool, pretrained=False)
    assert trainer.start_from(path) == sum(
        v.numel() for k, v in average.items() if k != "sigma_head.output.weight"
    )
    state = trainer.network.state_dict()
    for name, value in average.items():
        if name in state:
            assert torch.equal(state[name], value), name
    assert any(not torch.equal(state[name], value) for name, value in hints.items())
    assert torch.equal(
        trainer.checkpoint().average["depth_head.output.weight"], state["depth_head.output.weight"]
    )


def test_weights_of_which_none_fits_are_refused(pool: FramePool, tmp_path: Path) -> None:
    path = tmp_path / "foreign.pt"
    torch.save({"average": {"layer.weight": torch.zeros(3)}}, path)
    with pytest.raises(CheckpointError, match=r"foreign\.pt: none of its 1 weights fits"):
        Trainer(settings(), pool, pretrained=False).start_from(path)


def test_a_file_without_averaged_weights_starts_nothing(pool: FramePool, tmp_path: Path) -> None:
    path = tmp_path / "bare.pt"
    torch.save({"network": {}}, path)
    with pytest.raises(CheckpointError, match="no averaged weights"):
        Trainer(settings(), pool, pretrained=False).start_from(path)


def test_a_missing_checkpoint_is_named(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"none\.pt"):
        Checkpoint.load(tmp_path / "none.pt")


@pytest.mark.parametrize("content", [b"", b"not a checkpoint"])
def test_a_broken_checkpoint_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "broken.pt"
    path.write_bytes(content)
    with pytest.raises(CheckpointError, match=r"broken\.pt") as raised:
        Checkpoint.load(path)
    assert "weights_only" not in str(raised.value)


def test_a_file_of_something_else_is_not_a_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "other.pt"
    torch.save({"weights": torch.zeros(2)}, path)
    with pytest.raises(CheckpointError, match=r"other\.pt"):
        Checkpoint.load(path)
