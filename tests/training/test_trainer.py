"""The training run: its schedule, its average, and that it goes on from a checkpoint as if never stopped."""

from __future__ import annotations

import json
import resource
from dataclasses import replace
from pathlib import Path

import pytest
import torch
import typer
from frames import make_store
from torch import nn
from typer.testing import CliRunner

import training.data.rendering
import training.settings
import training.train_command
from training.averaging import AverageWeights
from training.checkpoint import Checkpoint
from training.data.batches import FramePool
from training.data.rendering import RenderPlan
from training.errors import CheckpointError, TrainingSettingsError
from training.networks.depth_network import NetworkShape
from training.precision import autocast, resolve_precision
from training.run_log import RunLog, RunSummary, read_log
from training.settings import LargePictures, SizePhase, TrainingSettings
from training.train_command import train
from training.trainer import Trainer

SMALL = NetworkShape(
    channels=(4, 4, 4, 4, 4),
    head_channels=4,
    frozen_stages=6,
    hint_channels=(4, 4, 4, 4, 4),
    correction_channels=4,
)
PHASES = (SizePhase(0.5, 64, 64, 2), SizePhase(1.0, 96, 64, 2))


def settings(images: int = 12) -> TrainingSettings:
    return TrainingSettings(images=images, phases=PHASES, large=None, shape=SMALL, precision="fp32")


@pytest.fixture
def pool(tmp_path: Path) -> FramePool:
    return FramePool(make_store(tmp_path / "frames"))


def run_to_end(trainer: Trainer) -> list[float]:
    return [float(report.terms.total) for report in trainer.run()]


def test_a_run_ends_after_the_pictures_it_was_given(pool: FramePool) -> None:
    trainer = Trainer(settings(), pool, pretrained=False)
    assert len(run_to_end(trainer)) == 6
    assert (trainer.step, trainer.images, trainer.progress) == (6, 12, 1.0)


def test_a_resumed_run_continues_exactly(pool: FramePool, tmp_path: Path) -> None:
    whole = Trainer(settings(), pool, pretrained=False)
    wanted = run_to_end(whole)

    stopped = Trainer(settings(), pool, pretrained=False)
    steps = stopped.run()
    first = [float(next(steps).terms.total) for _ in range(2)]
    stopped.save(tmp_path / "checkpoint.pt")
    steps.close()  # type: ignore[attr-defined]

    resumed = Trainer.resume(Checkpoint.load(tmp_path / "checkpoint.pt"), pool)
    assert first + run_to_end(resumed) == wanted
    for name, value in whole.network.state_dict().items():
        assert torch.equal(value, resumed.network.state_dict()[name]), name
    for name, value in whole.checkpoint().average.items():
        assert torch.equal(value, resumed.checkpoint().average[name]), name


def test_training_learns_the_painted_ground(pool: FramePool) -> None:
    trainer = Trainer(settings(images=40), pool, pretrained=False)
    losses = run_to_end(trainer)
    assert sum(losses[-5:]) < 0.9 * sum(losses[:5])


def test_a_run_in_minutes_ends_by_its_clock(pool: FramePool) -> None:
    seconds = iter(range(0, 10_000, 20))
    run = TrainingSettings(minutes=1.0, phases=PHASES, large=None, shape=SMALL, precision="fp32")
    trainer = Trainer(run, pool, pretrained=False, seconds=lambda: float(next(seconds)))
    assert len(run_to_end(trainer)) == 3


def test_rates_rise_then_fall() -> None:
    run = settings()
    rates = [run.rate_factor(progress / 100) for progress in range(101)]
    top = rates.index(max(rates))
    assert max(rates) == pytest.approx(1.0)
    assert rates[: top + 1] == sorted(rates[: top + 1])
    assert rates[top:] == sorted(rates[top:], reverse=True)
    assert rates[-1] == pytest.approx(run.final_rate)


def test_some_pictures_of_the_last_phase_are_large() -> None:
    run = TrainingSettings(images=12, phases=PHASES, large=LargePictures(3, 128, 64, 2), shape=SMALL)
    assert [run.size_of(number, 0.2).width for number in range(6)] == [64] * 6
    assert [run.size_of(number, 0.7).width for number in range(6)] == [128, 96, 96, 128, 96, 96]


def test_large_pictures_have_sizes_that_the_network_takes() -> None:
    with pytest.raises(TrainingSettingsError, match="130x64"):
        LargePictures(3, 130, 64, 2)
    with pytest.raises(TrainingSettingsError, match="one of 0"):
        LargePictures(0, 128, 64, 2)


def test_pictures_grow_at_the_end_of_a_phase() -> None:
    run = settings()
    assert [run.phase_at(progress).width for progress in (0.0, 0.49, 0.5, 1.0)] == [64, 64, 96, 96]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({}, "give one of the two"),
        ({"images": 4, "minutes": 1.0}, "give one of the two"),
        ({"minutes": 0.0}, "above 0"),
        ({"minutes": float("nan")}, "above 0"),
        ({"images": 4, "phases": ()}, "rising numbers"),
        ({"images": 4, "phases": (SizePhase(0.5, 64, 64, 2),)}, "rising numbers"),
    ],
)
def test_settings_that_make_no_run_are_refused(arguments: dict[str, object], complaint: str) -> None:
    with pytest.raises(TrainingSettingsError, match=complaint):
        TrainingSettings(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(("size", "batch"), [((100, 64), 2), ((64, 33), 2), ((64, 64), 1)])
def test_sizes_that_the_network_cannot_take_are_refused(size: tuple[int, int], batch: int) -> None:
    with pytest.raises(TrainingSettingsError):
        SizePhase(1.0, *size, batch)


def test_the_average_lags_behind_the_weights_and_forgets_the_start() -> None:
    layer = nn.Linear(1, 1, bias=False)
    nn.init.zeros_(layer.weight)
    average = AverageWeights(layer, decay=0.5)
    nn.init.ones_(layer.weight)
    average.update(layer, step=1000)
    assert float(average.state["weight"]) == pytest.approx(0.5)
    for _ in range(20):
        average.update(layer, step=1000)
    assert float(average.state["weight"]) == pytest.approx(1.0, abs=1e-4)


def test_early_steps_count_more_in_the_average() -> None:
    layer = nn.Linear(1, 1, bias=False)
    nn.init.zeros_(layer.weight)
    average = AverageWeights(layer, decay=0.999)
    nn.init.ones_(layer.weight)
    average.update(layer, step=1)
    assert float(average.state["weight"]) > 0.8


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


@pytest.mark.parametrize(
    ("capabilities", "precision"),
    [
        ({"amx_bf16": True}, "bf16"),
        ({"avx512_bf16": True}, "bf16"),
        ({"avx512_bf16": False}, "fp32"),
        ({}, "fp32"),
    ],
)
def test_bf16_is_used_only_where_the_processor_computes_it(
    monkeypatch: pytest.MonkeyPatch, capabilities: dict[str, bool], precision: str
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities)
    assert resolve_precision("auto") == precision


def test_a_wanted_precision_is_taken_and_an_unknown_one_refused() -> None:
    assert resolve_precision("bf16") == "bf16"
    with autocast("bf16"):
        assert (torch.ones(2, 2) @ torch.ones(2, 2)).dtype is torch.bfloat16
    with pytest.raises(TrainingSettingsError, match="fp8"):
        resolve_precision("fp8")


def test_the_log_tells_means_and_can_be_read_back(pool: FramePool, tmp_path: Path) -> None:
    log = RunLog(tmp_path / "log.jsonl", every_s=1e9)
    reports = list(Trainer(settings(), pool, pretrained=False).run())
    summaries = [log.add(report, 2, 0.0, len(pool)) for report in reports]
    assert summaries[:-1] == [None] * (len(reports) - 1)
    last = summaries[-1]
    assert last is not None
    assert last.total == pytest.approx(sum(float(r.terms.total) for r in reports) / len(reports), rel=1e-5)
    assert read_log(tmp_path / "log.jsonl") == [last]
    assert "100.0 %" in last.line()


def test_the_time_left_follows_the_pace_so_far() -> None:
    summary = RunSummary(1, 8, 300.0, 0.25, 0.1, 1.0, 0.5, 0.2, 0.1, 0.0, 0.5, 0.6, 6)
    assert summary.left_s == pytest.approx(900.0)
    assert "15.0 min left" in summary.line()


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
    longer = [*words[:-1], "12", "--resume"]
    assert CliRunner().invoke(app, longer, catch_exceptions=False).exit_code == 0
    assert Checkpoint.load(tmp_path / "run" / "checkpoint.pt").images == 12


def test_a_run_either_starts_or_goes_on(tmp_path: Path) -> None:
    with pytest.raises(TrainingSettingsError, match="--resume"):
        train(data=tmp_path, output=tmp_path, init=tmp_path / "old.pt", resume=True)


def test_a_run_has_one_length(tmp_path: Path) -> None:
    with pytest.raises(TrainingSettingsError, match="one length"):
        train(data=tmp_path, output=tmp_path, minutes=1.0, images=5)


def test_the_command_renders_training_worlds_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    worlds: list[tuple[str, int]] = []

    def remember(plan: RenderPlan, tell: object) -> int:
        worlds.extend(plan.worlds())
        make_store(plan.root, (("wall", 0),))
        return 3

    monkeypatch.setattr(training.data.rendering, "render_plan", remember)
    monkeypatch.setattr(training.train_command, "_run", lambda trainer, output: None)
    app = typer.Typer()
    app.command()(train)
    words = ["--data", str(tmp_path / "frames"), "--render", "--scenes", "wall,city", "--seeds", "2"]
    done = CliRunner().invoke(app, [*words, "--output", str(tmp_path / "run")], catch_exceptions=False)
    assert done.exit_code == 0
    assert worlds == [("wall", 0), ("city", 0), ("wall", 1), ("city", 1)]
