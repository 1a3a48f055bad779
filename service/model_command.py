"""`uavdepth model`: what a network's file and its card are worth before it flies."""

from __future__ import annotations

import re
import time
import warnings
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.depth.depth_map import DepthMap
from uavdepth.errors import ModelCardError, ModelFileError, ProviderFallbackWarning
from uavdepth.model.card import CARD_METADATA_KEY, ModelCard
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hints import GroundHint, Hints
from uavdepth.model.inference import InferenceSession, open_session
from uavdepth.model.network_file import Problem, card_beside, find_network, network_problems, read_card
from uavdepth.model.providers import runtime_errors

model_app = typer.Typer(no_args_is_help=True)

_CAMERA = CameraModel.from_fov(640, 320, 90.0)
_GROUND = GroundHint(CameraMount(), Attitude(0.0, 0.0, 0.0), 5.0)
_RUNS = 7
_KEY = re.compile(r"key '([a-z_]+)")


@model_app.callback()
def _model() -> None:
    """Look into networks."""


@model_app.command()
def check(
    file: Annotated[str, typer.Argument(help="Network: an ONNX file, or the name of one that ships.")],
    card: Annotated[
        Path | None, typer.Option(help="TOML card, instead of the one in the file or beside it.")
    ] = None,
    provider: Annotated[str, typer.Option(help="auto, tensorrt, cuda, openvino or cpu.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the network.")] = None,
    precision: Annotated[str, typer.Option(help="auto, float, or int8 for the 8-bit file.")] = "auto",
) -> None:
    """Say what is wrong with a network or its card, or what it is and how fast it answers.

    Exit code 1 if anything is wrong; each problem stands on a line, what to do about it on the next.
    """
    try:
        path = find_network(file)
        # Which provider it fell back to stands in the summary.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ProviderFallbackWarning)
            inference = open_session(path, provider, threads, precision)
    except ModelFileError as error:
        _end_with([Problem(str(error), "give an ONNX file that this version of ONNX Runtime can load")])
    try:
        read = read_card(inference.session, path, card)
    except ModelCardError as error:
        _end_with([Problem(text, _fix_of(text, path)) for text in error.complaints])
    problems = network_problems(inference.session, read)
    if problems:
        _end_with(problems)
    model = DepthModel(inference, read, str(path))
    _print_summary(path, model, inference)
    problems = _try(model)
    if problems:
        _end_with(problems)
    typer.echo("OK")


def _end_with(problems: list[Problem]) -> None:
    for problem in problems:
        typer.echo(f"PROBLEM {problem.text}\n    fix: {problem.fix}")
    raise typer.Exit(1)


def _fix_of(complaint: str, path: Path) -> str:
    """What to do about a complaint of a card."""
    if CARD_METADATA_KEY in complaint:
        required = [key for key, item in ModelCard.model_fields.items() if item.is_required()]
        return f"describe the network in {card_beside(path).name}; at least {', '.join(required)}, metric"
    match = _KEY.search(complaint)
    known = ModelCard.model_fields
    if match is None:
        return "correct the card's text"
    if match[1] not in known:
        return f"take it out; the card's keys are {', '.join(known)}"
    return f"{match[1]}: {known[match[1]].description}"


def _print_summary(path: Path, model: DepthModel, inference: InferenceSession) -> None:
    card = model.card
    size = f"{card.input_width}x{card.input_height}"
    if card.multiple_of is not None:
        size = f"about {size}, multiples of {card.multiple_of}"
    lines = {
        "file": f"{path} ({path.stat().st_size / 1e6:.1f} MB)",
        "card": f"{card.name}, version {card.card_version}, {card.created}",
        "input": f"{size}, {card.channel_order}, {card.layout}",
        "hints": ", ".join(card.hints) or "none",
        "output": f"{card.output}, {'metric' if card.metric else 'not metric'}, "
        f"{'with' if card.uncertainty else 'without'} uncertainty",
        "trained on": card.training_data,
        "effort": card.effort,
        "made for": card.intended_use,
        "limits": card.limits,
        "licence": card.licence,
        "runs on": f"{model.provider} ({model.precision})",
    }
    if inference.fallback_reason is not None:
        lines["not on"] = inference.fallback_reason
    for name, text in lines.items():
        typer.echo(f"{name:<12}{text}")


def _try(model: DepthModel) -> list[Problem]:
    """Run pictures through, say what came out, and what is wrong with that."""
    pictures = [_picture(seed) for seed in (0, 1)]
    hints = Hints(_GROUND) if "ground" in model.card.hints else None
    times_ms = []
    try:
        answers = [model.infer(picture, _CAMERA, hints) for picture in pictures]
        for _ in range(_RUNS):
            begun_ns = time.perf_counter_ns()
            model.infer(pictures[0], _CAMERA, hints)
            times_ms.append((time.perf_counter_ns() - begun_ns) / 1e6)
    except ModelFileError as error:
        return [Problem(str(error), "name another output in the card, or export the network anew")]
    except runtime_errors() as error:
        return [
            Problem(f"the network fails on a picture: {error}", "compare the card's sizes with the graph's")
        ]
    values = [_values(answer) for answer in answers]
    finite = values[0][np.isfinite(values[0])]
    typer.echo(f"{'time':<12}{np.median(times_ms):.1f} ms for a picture of {_CAMERA.width}x{_CAMERA.height}")
    typer.echo(f"{'finite':<12}{finite.size / values[0].size:.1%} of the pixels")
    if finite.size == 0:
        return [
            Problem(
                "no pixel of the answer is a usable number",
                "check output, mean and std in the card: does the network give what they say?",
            )
        ]
    unit = "m" if model.card.metric else "units of its own"
    what = "values" if answers[0].affine_inverse_depth is not None else "depth"
    low, middle, high = np.percentile(finite, (0, 50, 100))
    typer.echo(f"{what:<12}{low:.3g} to {high:.3g} {unit}, half below {middle:.3g}")
    if np.array_equal(values[0], values[1], equal_nan=True):
        return [
            Problem(
                "two different pictures get the same answer",
                "check input_name, output_name, mean and std in the card",
            )
        ]
    return []


def _values(depth: DepthMap) -> NDArray[np.float32]:
    return depth.depth_m if depth.affine_inverse_depth is None else depth.affine_inverse_depth


def _picture(seed: int) -> NDArray[np.uint8]:
    """Blurred patches over a slope of brightness: no scene, but all values that a picture has."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(0, 256, (_CAMERA.height // 32, _CAMERA.width // 32, 3))
    slope = np.linspace(0.3, 1.0, _CAMERA.height)[:, None, None]
    return np.asarray(np.kron(patches, np.ones((32, 32, 1))) * slope, dtype=np.uint8)
