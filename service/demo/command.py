"""`uavdepth demo`."""

from __future__ import annotations

import json
import threading
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from service.demo.flight import DemoFlight
    from service.demo.report import DemoReport

DEFAULT_SCENE = "city:1001"
"""The first city kept from training (`training.data.split`: seeds from 1000 on) whose street is wider than
the margin all the way. In 1003 a house 3.8 m beside the way is nearer, and ArduPilot may rest there."""

_REFRESH_S = 0.2
_PICTURE_NEAR_M, _PICTURE_FAR_M = 1.5, 50.0


class DemoFlavor(StrEnum):
    """Which autopilot is imitated."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


def demo(
    scene: Annotated[str, typer.Option(help="Rendered world, NAME[:SEED].")] = DEFAULT_SCENE,
    flavor: Annotated[DemoFlavor, typer.Option(help="Autopilot to imitate.")] = DemoFlavor.ARDUPILOT,
    seconds: Annotated[float, typer.Option(min=1.0, help="Longest flight after take-off.")] = 60.0,
    speed: Annotated[float, typer.Option(min=0.5, max=5.0, help="Speed in m/s.")] = 3.0,
    height: Annotated[float, typer.Option(min=1.0, max=20.0, help="Flight height in metres.")] = 3.0,
    model: Annotated[str, typer.Option(help="Network: a file, or the name of one that ships.")] = "default",
    blind: Annotated[bool, typer.Option("--blind", help="Fly without the service, and collide.")] = False,
    headless: Annotated[bool, typer.Option("--headless", help="No live view.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")] = False,
    output: Annotated[Path, typer.Option(help="Folder for the picture and the service's log.")] = Path(
        "demo_out"
    ),
) -> None:
    """Fly a simulated vehicle at a facade that only the network sees.

    Exit code 0 only if it flew, stopped and touched nothing.
    """
    from service.demo.flight import DemoFlight
    from service.demo.plan import DemoPlan

    plan = DemoPlan(scene, flavor.value, blind, speed, height, seconds, model)
    flight = DemoFlight(plan)
    try:
        report = _run(flight, live=not (headless or as_json))
    finally:
        picture = _save(flight, output)
    if as_json:
        typer.echo(json.dumps(asdict(report)))
    else:
        _print(report, picture)
    raise typer.Exit(0 if report.passed else 1)


def _run(flight: DemoFlight, *, live: bool) -> DemoReport:
    """Fly in a thread of its own, so that Ctrl-C and the live view stay with this one."""
    reports: list[DemoReport] = []
    failures: list[Exception] = []

    def fly() -> None:
        try:
            reports.append(flight.run())
        except Exception as error:  # noqa: BLE001 - handed to the main thread, which raises it
            failures.append(error)

    thread = threading.Thread(target=fly, name="demo-flight")
    thread.start()
    try:
        if live:
            _show(flight, thread)
        else:
            thread.join()
    except KeyboardInterrupt:
        flight.abandon()
        thread.join()
        raise
    thread.join()
    if failures:
        raise failures[0]
    return reports[0]


def _show(flight: DemoFlight, thread: threading.Thread) -> None:
    from rich.live import Live

    from service.clock import MonotonicClock
    from service.demo.view import render_flight

    clock = MonotonicClock()
    with Live(render_flight(flight, clock), refresh_per_second=1 / _REFRESH_S, transient=True) as shown:
        while thread.is_alive():
            thread.join(_REFRESH_S)
            shown.update(render_flight(flight, clock))


def _save(flight: DemoFlight, output: Path) -> Path | None:
    """Write picture and log; the path of the picture, or None when there is none to draw."""
    output.mkdir(parents=True, exist_ok=True)
    if flight.service_log:
        (output / "service.log").write_text(flight.service_log, encoding="utf-8")
    moments = [
        (moment, caption)
        for moment, caption in (
            (flight.on_the_way, "camera, on the way"),
            (flight.at_the_end, "camera, at the end"),
        )
        if moment is not None
    ]
    if not moments:
        return None
    import cv2
    import numpy as np

    from service.demo.picture import draw_side_by_side

    rows = [
        draw_side_by_side(
            moment.pictures.image_bgr,
            moment.pictures.depth_m,
            moment.scan.scan,
            _PICTURE_NEAR_M,
            _PICTURE_FAR_M,
            caption,
        )
        for moment, caption in moments
    ]
    picture = np.vstack(rows)
    path = output / "demo.png"
    path.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    return path


def _print(report: DemoReport, picture: Path | None) -> None:
    verdict = "stopped in time" if report.passed else "FAILED"
    typer.echo(f"{verdict}: {report.reason} ({report.scene}, {report.flavor}, {report.flown_s:.0f} s)")
    if not report.blind:
        latency = report.latency_ms
        lines = [
            f"distance ahead: scan {_metres(report.stop_distance_m)}, true {_metres(report.true_distance_m)}",
            f"{report.frames} frames, {_number(report.fps)} frames/s",
            f"{report.obstacle_messages} OBSTACLE_DISTANCE, {report.obstacle_rate_hz:.1f} Hz, "
            f"latency p50 / p95 {_number(latency.p50)} / {_number(latency.p95)} ms",
            f"{report.zenoh_samples} Zenoh samples",
        ]
        for line in lines:
            typer.echo(f"  {line}")
    if picture is not None:
        typer.echo(f"  picture: {picture}")


def _metres(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f} m"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
