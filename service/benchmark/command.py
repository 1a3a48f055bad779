"""`uavdepth benchmark`."""

from __future__ import annotations

import json
import platform
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

_PICTURES = 20


def benchmark(
    model: Annotated[str, typer.Option(help="Network: a file, or the name of one that ships.")] = "default",
    seconds: Annotated[float, typer.Option(min=1.0, help="How long the program is watched.")] = 15.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure speed and memory on this machine: each step on one core, then the whole program."""
    from service.benchmark.pictures import render_pictures
    from service.benchmark.program import measure_program
    from service.benchmark.rendering import measure_rendering
    from service.benchmark.stages import measure_stages

    pictures = render_pictures(_PICTURES)
    result: dict[str, Any] = {
        "machine": _machine(),
        "date": datetime.now(UTC).date().isoformat(),
        "size": "640x320",
        "stages_ms": asdict(measure_stages(model, pictures)),
        "program": asdict(measure_program(model, pictures[: _PICTURES // 2], seconds)),
        "rendering_384x192_ms": measure_rendering(),
    }
    if as_json:
        typer.echo(json.dumps(result))
        return
    typer.echo(f"{result['machine']}, {result['date']}, {result['size']}")
    for part in ("stages_ms", "program", "rendering_384x192_ms"):
        typer.echo(part)
        for name, value in result[part].items():
            typer.echo(f"  {name:<18} {value}")


def _machine() -> str:
    import os

    parts = (
        platform.machine(),
        f"{os.cpu_count()} cores",
        platform.system(),
        f"Python {platform.python_version()}",
    )
    return ", ".join(parts)
