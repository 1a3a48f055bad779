"""`uavdepth benchmark-stream`."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from service.benchmark.stream import StreamFigures, TopicFigures


def benchmark_stream(
    kbit_per_s: Annotated[
        float, typer.Option("--kbit", min=32.0, help="Rate of the radio, kbit/s.")
    ] = 2000.0,
    queue_kib: Annotated[float, typer.Option(min=4.0, help="What the radio holds, KiB.")] = 64.0,
    seconds: Annotated[float, typer.Option(min=1.0, help="How long it is measured.")] = 30.0,
    settling_s: Annotated[float, typer.Option("--settling", min=0.0, help="Seconds before that.")] = 5.0,
    profile: Annotated[str, typer.Option(help="full, thin or scan-only.")] = "full",
    limit: Annotated[float, typer.Option(min=32.0, help="\\[zenoh] max_kbit_per_s of the vehicle.")] = 8000.0,
    depth_rate_hz: Annotated[float, typer.Option(min=0.1, max=60.0, help="Depth pictures offered.")] = 15.0,
    camera_rate_hz: Annotated[float, typer.Option(min=0.1, max=60.0, help="Camera pictures offered.")] = 15.0,
    one_session: Annotated[
        bool,
        typer.Option(
            "--one-session", help="A viewer with one session that reports nothing, as foreign ones do."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure how late scans and pictures arrive over a slow radio (a shaped relay on loopback)."""
    from service.benchmark.machine import machine_name
    from service.benchmark.stream import measure_stream
    from service.benchmark.stream_link import LinkSettings
    from service.errors import ConfigError

    if profile not in ("full", "thin", "scan-only"):
        raise ConfigError(f"--profile {profile!r} is none of full, thin, scan-only")
    overrides: dict[str, Any] = {
        "profile": profile,
        "max_kbit_per_s": limit,
        "depth_rate_hz": depth_rate_hz,
        "camera_rate_hz": camera_rate_hz,
    }
    link = LinkSettings(1e3 * kbit_per_s, round(1024 * queue_kib))
    figures = measure_stream(link, seconds, settling_s, overrides, one_session=one_session)
    if as_json:
        date = datetime.now(UTC).date().isoformat()
        typer.echo(json.dumps({"machine": machine_name(), "date": date, **figures.as_json()}))
        return
    typer.echo(f"{machine_name()}\n{_text(figures)}")


def _text(figures: StreamFigures) -> str:
    lines = [
        f"profile {figures.profile}: {figures.offered_kbit_per_s:g} kbit/s offered to a link of "
        f"{figures.link_kbit_per_s:g}, {figures.carried_kbit_per_s:g} carried; "
        f"longest wait in the radio {figures.longest_queue_ms:g} ms",
        f"{'':<18}{'per s':>8}{'kbit/s':>9}{'p50 ms':>9}{'p95 ms':>9}{'max ms':>9}{'width':>7}",
    ]
    lines += [_row(topic, value) for topic, value in figures.topics.items()]
    lines += [_row(f"{topic}, settling", value) for topic, value in figures.settling.items()]
    return "\n".join(lines)


def _row(name: str, value: TopicFigures) -> str:
    cells = (value.latency_ms_p50, value.latency_ms_p95, value.latency_ms_max)
    late = "".join(f"{'-' if cell is None else f'{cell:g}':>9}" for cell in cells)
    return f"{name:<18}{value.per_s:>8g}{value.kbit_per_s:>9g}{late}{value.width or '-':>7}"
