"""`uavdepth benchmark`."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

_PICTURES = 20


def benchmark(
    model: Annotated[str, typer.Option(help="Network: a file, or the name of one that ships.")] = "default",
    seconds: Annotated[float, typer.Option(min=1.0, help="How long the program is watched.")] = 15.0,
    rounds: Annotated[int, typer.Option(min=1, help="Runs of each network on each provider.")] = 20,
    networks_only: Annotated[
        bool, typer.Option("--networks-only", help="Leave out the steps, the program and the renderer.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure speed and memory on this machine: the networks in turns, each step, then the whole program."""
    from service.benchmark.machine import machine_name
    from service.benchmark.networks import measure_networks
    from service.benchmark.pictures import render_pictures

    pictures = render_pictures(_PICTURES)
    result: dict[str, Any] = {
        "machine": machine_name(),
        "date": datetime.now(UTC).date().isoformat(),
        "size": "640x320",
        **measure_networks(pictures, rounds, note=_note).as_json(),
    }
    if not networks_only:
        from service.benchmark.program import measure_program
        from service.benchmark.rendering import measure_rendering
        from service.benchmark.stages import measure_stages

        result["stages_ms"] = asdict(measure_stages(model, pictures))
        result["program"] = asdict(measure_program(model, pictures[: _PICTURES // 2], seconds))
        result["rendering_384x192_ms"] = measure_rendering()
    typer.echo(json.dumps(result) if as_json else _table(result))


def _note(text: str) -> None:
    """What is going on, for who waits; standard output holds the result alone."""
    typer.echo(text, err=True)


def _table(result: dict[str, Any]) -> str:
    lines = [f"{result['machine']}, {result['date']}, {result['size']}"]
    lines.append(f"{'network':<24}{'size':<10}{'provider':<18}{'frames/s':>9}{'before':>10}{'after':>10}")
    for row in (*result["models"], *(result["baseline"] or ())):
        size, provider = f"{row['width']}x{row['height']}", f"{row['provider']} {row['precision']}"
        times = f"{row['preprocess_ms']:>7.2f} ms{row['postprocess_ms']:>7.2f} ms"
        lines.append(f"{row['name']:<24}{size:<10}{provider:<18}{row['fps_median']:>9.1f}{times}")
    if result["baseline"] is None:
        lines.append(f"no baseline: {result['baseline_reason']}")
    for size, ratio in (result["ratio_to_baseline"] or {}).items():
        lines.append(f"fastest shipped network over the baseline, {size}: {ratio:.1f}")
    for part in ("stages_ms", "program", "rendering_384x192_ms"):
        if part in result:
            lines += [part, *(f"  {name:<18} {value}" for name, value in result[part].items())]
    return "\n".join(lines)
