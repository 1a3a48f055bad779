"""`uavdepth train`."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import typer
from frames import make_store
from small_runs import PHASES, SMALL, settings
from typer.testing import CliRunner

import training.data.rendering
import training.settings
import training.train_command
from training.checkpoint import Checkpoint
from training.data.batches import FramePool
from training.data.rendering import RenderPlan
from training.errors import CheckpointError, TrainingSettingsError
from training.settings import TrainingSettings, for_fine_tuning
from training.train_command import train
from training.trainer import Trainer


def test_a_run_goes_on_while_the_disk_is_full(
    pool: FramePool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(self: Checkpoint, path: Path) -> None:
        raise CheckpointError(f"{path} cannot be written: No space left on device")

    trainer = Trainer(settings(), pool, pretrained=False)
    monkeypatch.setattr(Checkpoint, "save", refuse)
    monkeypatch.setattr(training.train_command, "_SAVE_EVERY_S", 0.0)
    with pytest.raises(CheckpointError, match="No space left"):
        training.train_command._run(trainer, tmp_path)
    assert trainer.progress == 1.0
    assert capsys.readouterr().err.count("No space left") > 1


def test_the_command_trains_and_refuses_to_overwrite(
    pool: FramePool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def small(**arguments: object) -> TrainingSettings:
        return TrainingSettings(**arguments, phases=PHASES, large=None, shape=SMALL)  # type: ignore[arg-type]

    monkeypatch.setattr(training.settings, "TrainingSettings", small)
    app = typer.Typer()
    app.command()(train)
    words = ["--data", str(tmp_path / "frames"), "--output", str(tmp_path / "run"), "--images", "8"]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0
    assert Checkpoint.load(tmp_path / "run" / "checkpoint.pt").images == 8
    assert json.loads((tmp_path / "run" / "log.jsonl").read_text())["images"] == 8
    with pytest.raises(TrainingSettingsError, match="--resume"):
        CliRunner().invoke(app, words, catch_exceptions=False)
    with pytest.raises(TrainingSettingsError, match="--seed is 5, but the run was started with 0"):
        CliRunner().invoke(app, [*words, "--resume", "--seed", "5"], catch_exceptions=False)
    with pytest.raises(TrainingSettingsError, match="--thin-weight is 3, but the run was started with 8"):
        CliRunner().invoke(app, [*words, "--resume", "--thin-weight", "3"], catch_exceptions=False)
    longer = [*words[:-1], "12", "--resume"]
    assert CliRunner().invoke(app, longer, catch_exceptions=False).exit_code == 0

    with pytest.raises(TrainingSettingsError, match="--fine-tune needs --init"):
        CliRunner().invoke(app, [*words, "--fine-tune"], catch_exceptions=False)
    begun = Checkpoint.load(tmp_path / "run" / "checkpoint.pt").settings
    finer = [*words, "--output", str(tmp_path / "finer"), "--fine-tune"]
    finer += ["--init", str(tmp_path / "run" / "checkpoint.pt"), "--thin-weight", "4"]
    assert CliRunner().invoke(app, finer, catch_exceptions=False).exit_code == 0
    tuned = Checkpoint.load(tmp_path / "finer" / "checkpoint.pt").settings
    assert tuned == for_fine_tuning(replace(begun, images=8, loss=replace(begun.loss, thin=4.0)))
    assert tuned.decoder_rate < 0.5 * begun.decoder_rate
    assert tuned.encoder_rate < 0.5 * begun.encoder_rate
    assert tuned.appearance.photos == 0.5 * begun.appearance.photos
    assert tuned.phases == begun.phases[-1:]
    before, after = (
        Checkpoint.load(tmp_path / folder / "checkpoint.pt").averaged_network().encoder.stem
        for folder in ("run", "finer")
    )
    assert not torch.equal(next(before.parameters()), next(after.parameters()))
    assert Checkpoint.load(tmp_path / "run" / "checkpoint.pt").images == 12


def test_a_run_either_starts_or_goes_on(tmp_path: Path) -> None:
    with pytest.raises(TrainingSettingsError, match="--resume"):
        train(data=tmp_path, output=tmp_path, init=tmp_path / "old.pt", resume=True)


def test_a_run_has_one_length(tmp_path: Path) -> None:
    with pytest.raises(TrainingSettingsError, match="one length"):
        train(data=tmp_path, output=tmp_path, minutes=1.0, images=5)


def test_the_command_renders_training_worlds_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plans: list[RenderPlan] = []

    def remember(plan: RenderPlan, done: object, left_out: Callable[[str, int, str], None]) -> int:
        plans.append(plan)
        make_store(plan.root, (("wall", 0),))
        left_out("city", 7, "no room")
        return 3

    monkeypatch.setattr(training.data.rendering, "render_plan", remember)
    monkeypatch.setattr(training.train_command, "_run", lambda trainer, output: None)
    app = typer.Typer()
    app.command()(train)
    words = ["--data", str(tmp_path / "frames"), "--render", "--scenes", "wall,city", "--seeds", "2"]
    words += ["--first-seed", "6", "--thin-share", "0.5"]
    done = CliRunner().invoke(app, [*words, "--output", str(tmp_path / "run")], catch_exceptions=False)
    assert done.exit_code == 0
    assert "left out city:7: no room" in done.stderr
    assert list(plans[0].worlds()) == [("wall", 6), ("city", 6), ("wall", 7), ("city", 7)]
    assert plans[0].thin_share == 0.5
