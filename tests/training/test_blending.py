"""Means of the weights of several runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from frames import make_store
from small_runs import SMALL, one_size

from training.blend_command import blend as blend_command
from training.blending import blend
from training.checkpoint import Checkpoint
from training.data.batches import FramePool
from training.errors import CheckpointError
from training.trainer import Trainer


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Checkpoint, Checkpoint]:
    """A run, and one that began with its weights."""
    folder = tmp_path_factory.mktemp("runs")
    pool = FramePool(make_store(folder / "frames"))
    settings = one_size()
    first = Trainer(settings, pool, pretrained=False)
    list(first.run())
    first.save(folder / "first.pt")
    second = Trainer(replace(settings, images=6, seed=1), pool, pretrained=False)
    second.start_from(folder / "first.pt")
    list(second.run())
    return first.checkpoint(), second.checkpoint()


def test_the_weights_lie_between_and_the_effort_is_both(runs: tuple[Checkpoint, Checkpoint]) -> None:
    first, second = runs
    found = blend(runs, (0.25, 0.75))
    moved = 0
    for name, weight in found.average.items():
        if not weight.is_floating_point():
            assert torch.equal(weight, second.average[name])
            continue
        between = 0.25 * first.average[name] + 0.75 * second.average[name]
        assert torch.allclose(weight, between, atol=1e-6)
        assert weight.dtype == second.average[name].dtype
        moved += not torch.equal(first.average[name], second.average[name])
    assert moved > 20
    assert (found.images, found.step) == (first.images + second.images, first.step + second.step)
    assert found.settings == second.settings
    picture = torch.zeros(1, 3, 64, 96)
    assert torch.isfinite(found.averaged_network()(picture).log_inverse_depth).all()


@pytest.mark.parametrize(
    ("shares", "words"),
    [
        ((1.0,), "2 checkpoints with 1 shares"),
        ((0.5, 0.6), "together 1"),
        ((-0.5, 1.5), "above 0"),
        ((float("nan"), 1.0), "above 0"),
    ],
)
def test_shares_that_make_no_mean_are_refused(
    runs: tuple[Checkpoint, Checkpoint], shares: tuple[float, ...], words: str
) -> None:
    with pytest.raises(CheckpointError, match=words):
        blend(runs, shares)


def test_runs_with_other_frozen_stages_have_a_mean(runs: tuple[Checkpoint, Checkpoint]) -> None:
    first, second = runs
    tuned = replace(second, settings=replace(second.settings, shape=replace(SMALL, frozen_stages=0)))
    assert blend((first, tuned), (0.5, 0.5)).settings == tuned.settings


def test_networks_of_different_shapes_are_refused(runs: tuple[Checkpoint, Checkpoint]) -> None:
    first, second = runs
    other = replace(second, settings=replace(second.settings, shape=replace(SMALL, head_channels=8)))
    with pytest.raises(CheckpointError, match="different shapes"):
        blend((first, other), (0.5, 0.5))


def test_the_command_writes_a_checkpoint_that_trains_on(
    runs: tuple[Checkpoint, Checkpoint], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [tmp_path / "a.pt", tmp_path / "b.pt"]
    for run, path in zip(runs, paths, strict=True):
        run.save(path)
    blend_command(tmp_path / "mean.pt", paths)
    assert "10 pictures together" in capsys.readouterr().out
    wanted = blend(runs, (0.5, 0.5)).average
    read = Checkpoint.load(tmp_path / "mean.pt").average
    assert all(torch.equal(read[name], wanted[name]) for name in wanted)
    with pytest.raises(CheckpointError, match="numbers by commas"):
        blend_command(tmp_path / "mean.pt", paths, shares="half")
