"""The training run: its average, its log, and that it goes on from a checkpoint as if never stopped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from small_runs import PHASES, SMALL, run_to_end, settings
from torch import nn

from training.averaging import AverageWeights
from training.checkpoint import Checkpoint
from training.data.batches import FramePool
from training.data.surface_patterns import AppearanceShares
from training.run_log import RunLog, RunSummary, read_log
from training.settings import TrainingSettings
from training.trainer import Trainer


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


def test_a_run_from_before_surfaces_were_changed_goes_on_without(pool: FramePool, tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.pt"
    Trainer(settings(), pool, pretrained=False).save(path)
    content = torch.load(path, weights_only=True)
    del content["settings"]["appearance"]
    torch.save(content, path)
    assert Checkpoint.load(path).settings.appearance == AppearanceShares(0.0, 0.0, 0.0)


def test_training_learns_the_painted_ground(pool: FramePool) -> None:
    as_painted = replace(settings(images=80), appearance=AppearanceShares(0.0, 0.0))
    trainer = Trainer(as_painted, pool, pretrained=False)
    losses = run_to_end(trainer)
    assert sum(losses[-5:]) < 0.9 * sum(losses[:5])


def test_a_run_in_minutes_ends_by_its_clock(pool: FramePool) -> None:
    seconds = iter(range(0, 10_000, 20))
    run = TrainingSettings(minutes=1.0, phases=PHASES, large=None, shape=SMALL, precision="fp32")
    trainer = Trainer(run, pool, pretrained=False, seconds=lambda: float(next(seconds)))
    assert len(run_to_end(trainer)) == 3


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
