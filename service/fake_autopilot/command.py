"""`uavdepth fake-autopilot`: fly a companion without a vehicle."""

from __future__ import annotations

import signal
import threading
from enum import StrEnum
from typing import Annotated

import typer
from rich.console import Console

from service.errors import LinkError
from service.fake_autopilot.fake_autopilot import FakeAutopilot, Truth
from service.fake_autopilot.faults import FaultError, parse_fault
from service.fake_autopilot.parameters import UnknownParameterError
from service.fake_autopilot.world import World
from uavdepth.errors import SceneError

EXIT_CANNOT_RUN = 1
EXIT_BAD_USE = 2
REPORT_S = 1.0


class FlavorName(StrEnum):
    """Which autopilot is imitated."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


def fake_autopilot(
    flavor: Annotated[FlavorName, typer.Option(help="The autopilot to imitate.")] = FlavorName.ARDUPILOT,
    endpoint: Annotated[
        list[str] | None,
        typer.Option(
            "--endpoint",
            "--listen",
            help="tcp:HOST:PORT or udp:HOST:PORT to listen, udpout:HOST:PORT to send there; may be repeated. "
            "Default: tcp:127.0.0.1:5760.",
        ),
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Rendered world to fly in, as city:3; flat ground without one.")
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="reboot@SECOND, pause@SECOND:DURATION, burst@SECOND:DURATION, clock@SECOND:STEP, "
            "streams@SECOND; may be repeated."
        ),
    ] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option("--parameter", "-p", help="A parameter as NAME=VALUE, say PRX_FILT=5; may be repeated."),
    ] = None,
    system_id: Annotated[int, typer.Option(min=1, max=255, help="MAVLink system id.")] = 1,
    cold_start: Annotated[
        bool,
        typer.Option("--cold-start", help="Begin at boot: requests are lost, position comes after 42 s."),
    ] = False,
    mavlink1: Annotated[bool, typer.Option("--mavlink1", help="Speak MAVLink 1 only.")] = False,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after so many seconds.")] = None,
) -> None:
    """Run a simulated ArduPilot or PX4 multirotor that treats obstacle messages as the real ones were
    measured to."""
    console = Console()
    errors = Console(stderr=True)
    try:
        autopilot = FakeAutopilot(
            flavor.value,
            endpoint or ["tcp:127.0.0.1:5760"],
            scene=_load(scene),
            system_id=system_id,
            parameters=_assignments(parameter or []),
            faults=[parse_fault(text) for text in fault or []],
            boot_s=0.0 if cold_start else 60.0,
            mavlink1=mavlink1,
        )
    except (FaultError, UnknownParameterError, SceneError, typer.BadParameter) as error:
        errors.print(f"[red]error:[/red] {error}", highlight=False)
        raise typer.Exit(EXIT_BAD_USE) from None
    try:
        autopilot.start()
    except LinkError as error:
        errors.print(f"[red]error:[/red] {error}", highlight=False)
        raise typer.Exit(EXIT_CANNOT_RUN) from None
    console.print(
        f"{flavor.value} {system_id}/1 on {', '.join(autopilot.addresses)}; Ctrl-C ends", highlight=False
    )
    try:
        _watch(autopilot, console, seconds)
    finally:
        autopilot.close()


def _watch(autopilot: FakeAutopilot, console: Console, seconds: float | None) -> None:
    """Report once a second until Ctrl-C, SIGTERM, or the time is over."""
    stop = threading.Event()
    before = {
        number: signal.signal(number, lambda *_: stop.set()) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        while not stop.wait(REPORT_S if seconds is None else min(REPORT_S, seconds)):
            truth = autopilot.truth()
            console.print(_line(truth), highlight=False)
            if not autopilot.is_running:
                raise typer.Exit(EXIT_CANNOT_RUN)
            if seconds is not None and truth.time_s >= seconds:
                return
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _line(truth: Truth) -> str:
    north, east, down = truth.position_ned_m
    nearest = "-" if truth.nearest_m is None else f"{truth.nearest_m:.2f} m"
    states = [truth.mode, "armed" if truth.armed else "disarmed", *(["COLLIDED"] if truth.collided else [])]
    obstacles = f"{truth.obstacle_messages} obstacle messages, {truth.obstacle_rate_hz:.1f} Hz"
    return (
        f"{truth.time_s:7.1f} s  {' '.join(states):<24} north {north:7.2f}  east {east:7.2f}  "
        f"height {-down:6.2f} m  nearest {nearest:>8}  {obstacles}"
    )


def _load(spec: str | None) -> World | None:
    if spec is None:
        return None
    from uavdepth.scenes import load_scene, parse_scene  # the extra `sim` is only needed here

    return load_scene(*parse_scene(spec))


def _assignments(texts: list[str]) -> dict[str, float]:
    values: dict[str, float] = {}
    for text in texts:
        name, found, value = text.partition("=")
        try:
            values[name] = float(value)
        except ValueError:
            found = ""
        if not found:
            raise typer.BadParameter(f"parameter {text!r} is not NAME=VALUE, as in PRX_FILT=5")
    return values
