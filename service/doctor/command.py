"""`uavdepth doctor`."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.options import AutopilotOption, ConfigOption, OverridesOption
from service.viewer_endpoints import check_endpoints

if TYPE_CHECKING:
    from service.doctor.finding import Finding
    from service.doctor.observation import Observation

EXIT_FAILURE = 1


def doctor(
    config: ConfigOption = None,
    autopilot: AutopilotOption = None,
    overrides: OverridesOption = None,
    seconds: Annotated[
        float, typer.Option(min=1.0, max=300.0, help="How long to listen once the autopilot is heard.")
    ] = 8.0,
    latency_s: Annotated[
        float | None,
        typer.Option(
            "--latency",
            min=0.0,
            max=5.0,
            help="Capture-to-wire latency, seconds, in place of the one that a running service measures.",
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option(help="Ask a running `uavdepth run` over Zenoh for the latency that it measures.")
    ] = True,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            help="Zenoh endpoint of that service or a router, in place of the configured ones; may be given "
            "many times."
        ),
    ] = None,
    range_m: Annotated[
        float | None,
        typer.Option(
            "--range", min=1.0, max=100.0, help="Range to trust, metres, if below the configured one."
        ),
    ] = None,
    probe: Annotated[
        bool,
        typer.Option(
            help="Send some empty obstacle messages to a disarmed ArduPilot, to see whether it takes them. "
            "An armed vehicle never gets any."
        ),
    ] = True,
    as_json: Annotated[bool, typer.Option("--json", help="JSON instead of a table.")] = False,
    fix: Annotated[
        Path | None,
        typer.Option(help="Write the recommended parameters to this new file; the vehicle is never changed."),
    ] = None,
) -> None:
    """Say why obstacles would not show or not stop the vehicle, each with the fix.

    It listens to the autopilot, asks for message rates as `run` does, and reads parameters; where a service
    runs for this vehicle, it takes the measured latency from its status. Exit codes: 0 no failure (there may
    be warnings), 1 a failure, 2 a wrong configuration or command line.
    """
    from service.autopilot.signing_key import load_signing_key
    from service.clock import MonotonicClock
    from service.doctor.checks import examine
    from service.doctor.examination import Examination, plan_of
    from service.doctor.finding import has_failure
    from service.doctor.listen import listen
    from service.doctor.live_latency import KnownLatency, ServiceEar, service_endpoints
    from service.doctor.report import report_json, report_table
    from service.errors import ConfigError
    from service.settings.load import load_settings

    given = list(overrides or ())
    if autopilot is not None:
        given.append(f"autopilot.endpoint={autopilot}")
    settings = load_settings(config, given, needs_camera=False)
    check_endpoints("--connect", connect or [])
    if fix is not None and fix.exists():
        raise ConfigError(f"--fix {fix}: exists already; give a new file")
    scan = settings.scan
    trusted_m = scan.max_distance_m if range_m is None else min(range_m, scan.max_distance_m)
    key_file = settings.autopilot.signing_key_file
    key = load_signing_key(Path(key_file).expanduser()) if key_file else None
    plan = plan_of(settings.autopilot, scan.min_distance_m, trusted_m, signs=key is not None)
    examination = Examination(settings.autopilot, plan, scan.max_distance_m, key, probe)
    clock = MonotonicClock()
    with ExitStack() as stack:
        stop = stack.enter_context(_set_by_signals())
        ear: ServiceEar | None = None
        if live and latency_s is None:
            name = settings.vehicle.name if "name" in settings.vehicle.model_fields_set else None
            places = connect or service_endpoints(settings.zenoh)
            ear = stack.enter_context(ServiceEar(places, settings.zenoh.security, name, clock))
        seen = listen(examination, settings.autopilot.endpoint, seconds, clock, stop)
        known = KnownLatency(latency_s, "--no-live" if latency_s is None else "given with --latency")
        if ear is not None:
            known = ear.latency(seen.system_id, stop)
    plan = replace(plan, latency_s=known.seconds, latency_source=known.source)
    findings = examine(seen, plan)

    if as_json:
        typer.echo(report_json(findings, seen, plan))
    else:
        from rich.console import Console

        Console().print(report_table(findings))
    if fix is not None:
        _write_fixes(fix, findings, seen)
    if has_failure(findings):
        raise typer.Exit(EXIT_FAILURE)


@contextmanager
def _set_by_signals() -> Iterator[threading.Event]:
    """An event that SIGINT and SIGTERM set instead of ending the program, for as long as the block lasts."""
    stop = threading.Event()
    before = {
        number: signal.signal(number, lambda _number, _frame: stop.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _write_fixes(path: Path, findings: list[Finding], seen: Observation) -> None:
    """Write the parameter file, or say why there is none.

    Raises:
        ConfigError: the file cannot be written.
    """
    from service.doctor.parameter_file import parameter_file
    from service.errors import ConfigError

    if not seen.parameters:
        typer.echo(f"{path}: not written, since no parameter could be read", err=True)
        return
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(parameter_file(findings, seen))
    except OSError as error:
        raise ConfigError(f"--fix {path}: cannot be written: {error.strerror}") from error
    typer.echo(f"{path}: written; load it with your ground station after reading it", err=True)
