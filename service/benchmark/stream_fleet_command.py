"""`uavdepth benchmark-fleet`."""

from __future__ import annotations

import json
from typing import Annotated

import typer


def benchmark_fleet(
    vehicles: Annotated[int, typer.Option(min=1, max=200, help="Simulated vehicles.")] = 20,
    stations: Annotated[int, typer.Option(min=1, max=20, help="Ground stations.")] = 2,
    seconds: Annotated[float, typer.Option(min=1.0, help="How long it is measured.")] = 20.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure a fleet through one router: each vehicle sends 15 scans and 5 pictures of 8 kB a second."""
    from service.benchmark.machine import machine_name
    from service.benchmark.stream_fleet import measure_fleet

    figures = measure_fleet(vehicles, stations, seconds)
    if as_json:
        typer.echo(json.dumps({"machine": machine_name(), **figures.as_json()}))
        return
    typer.echo(
        f"{machine_name()}\n"
        f"{figures.vehicles} vehicles through one router to {figures.stations} stations\n"
        f"scans     {figures.sent_scans} sent, {100 * figures.scans_delivered:.1f} % delivered, "
        f"p50 / p95 {figures.scan_ms_p50:g} / {figures.scan_ms_p95:g} ms\n"
        f"pictures  {figures.sent_pictures} sent, {100 * figures.pictures_delivered:.1f} % delivered, "
        f"p50 / p95 {figures.picture_ms_p50:g} / {figures.picture_ms_p95:g} ms\n"
        f"router    {figures.router_mib:g} MiB, {figures.router_mib_per_vehicle:g} MiB more a vehicle"
    )
