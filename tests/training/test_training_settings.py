"""What a training run is asked for: its length, rates, sizes and precision."""

from __future__ import annotations

import pytest
import torch
from small_runs import PHASES, SMALL, settings

from training.errors import TrainingSettingsError
from training.precision import autocast, resolve_precision
from training.settings import LargePictures, SizePhase, TrainingSettings


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
