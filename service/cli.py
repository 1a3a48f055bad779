"""The command `uavdepth`.

Only the command that runs is imported, so that help is fast and extras stay optional.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NoReturn

import typer

from service.errors import ConfigError
from service.process_end import end_process
from uavdepth.errors import UavDepthError

EXIT_FAILURE = 1
EXIT_CONFIG = 2


@dataclass(frozen=True)
class Command:
    """A command and where it lives.

    Args:
        module, name: the typer function, or for groups the `Typer`.
        summary: its line in the help.
        extra: the extra that it needs, if any.
        is_group: it has commands of its own.
    """

    module: str
    name: str
    summary: str
    extra: str | None = None
    is_group: bool = False


COMMANDS = {
    "run": Command("service.run_command", "run", "Fly: camera to depth to OBSTACLE_DISTANCE and Zenoh."),
    "record": Command("service.recorder.command", "record", "Fly, and record the flight."),
    "recover": Command("service.recorder.recover_command", "recover", "Rescue a record that was cut off."),
    "replay": Command(
        "service.replay.command", "replay", "Measure a recorded flight again, check its scans."
    ),
    "fly-record": Command(
        "service.replay.fly_record_command", "fly_record", "Make the flights that the tests replay.", "sim"
    ),
    "watch": Command("service.watch.command", "watch", "Show scan and status of vehicles live."),
    "ground": Command("service.ground.command", "ground", "Serve a page that shows every vehicle live."),
    "doctor": Command(
        "service.doctor.command", "doctor", "Say why obstacles would not show or not stop the vehicle."
    ),
    "calibrate": Command(
        "service.calibrate_command", "calibrate", "Intrinsics of a camera from pictures of a board."
    ),
    "demo": Command(
        "service.demo.command", "demo", "Fly a simulated vehicle at a wall that only the network sees."
    ),
    "config": Command(
        "service.settings.command", "config_app", "Describe and check the configuration.", is_group=True
    ),
    "fake-autopilot": Command(
        "service.fake_autopilot.command", "fake_autopilot", "Speak MAVLink like ArduPilot or PX4.", "sim"
    ),
    "benchmark": Command("service.benchmark.command", "benchmark", "Measure speed and memory."),
    "benchmark-stream": Command(
        "service.benchmark.stream_command",
        "benchmark_stream",
        "Measure scans and pictures over a slow radio.",
        "sim",
    ),
    "evaluate-motion": Command(
        "service.motion_evaluation.command", "evaluate_motion", "Measure metres from motion.", "sim"
    ),
    "keys": Command(
        "service.security.command", "keys_app", "Make certificates and passwords of a fleet.", is_group=True
    ),
    "router": Command("service.router_command", "router", "Hand on between vehicles and ground stations."),
    "benchmark-fleet": Command(
        "service.benchmark.stream_fleet_command", "benchmark_fleet", "Measure a fleet through one router."
    ),
    "model": Command(
        "service.model_command", "model_app", "Check a depth network and its card.", is_group=True
    ),
    "train": Command("training.commands", "train", "Train a depth network.", "train"),
    "train-video": Command(
        "training.selfsupervised.command", "train_video", "Train depth from video alone.", "train"
    ),
    "evaluate-video": Command(
        "training.selfsupervised.evaluate_command",
        "evaluate_video",
        "Measure what video has taught.",
        "train",
    ),
    "networks": Command(
        "training.networks_command", "networks", "Parameters and operations of every network.", "train"
    ),
    "compare": Command(
        "training.comparison.command", "compare_app", "Repeat the paper's comparison.", "train", is_group=True
    ),
    "evaluate-flight": Command(
        "service.flight_evaluation.command",
        "evaluate_flight",
        "Measure distances, stops and free ways in rendered flights.",
        "sim",
    ),
    "evaluate": Command("training.commands", "evaluate", "Measure a depth network's errors.", "train"),
    "export": Command(
        "training.commands", "export", "Write a trained network as ONNX with its card.", "train"
    ),
    "card": Command("training.card_command", "card", "Write a network's errors into its card.", "train"),
    "blend": Command("training.blend_command", "blend", "Take the mean of several runs' weights.", "train"),
    "quantize": Command("training.quantize_command", "quantize", "Write a network's 8-bit file.", "train"),
}


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Entry point of the console script. Errors become one message on standard error and an exit code.

    Exit codes: 0 done, 1 a failure at run time, 2 a wrong configuration or command line.
    """
    try:
        _run(list(sys.argv[1:] if arguments is None else arguments))
    except SystemExit as end:
        if arguments is not None:
            raise
        end_process(end.code if isinstance(end.code, int) else EXIT_FAILURE)


def _run(words: list[str]) -> NoReturn:
    wanted = next((word for word in words if not word.startswith("-")), None)
    try:
        build_app(wanted)(words, prog_name="uavdepth")
    except ConfigError as error:
        fail(error, EXIT_CONFIG)
    except UavDepthError as error:
        fail(error, EXIT_FAILURE)
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(0)


def build_app(wanted: str | None) -> typer.Typer:
    """The application in which `wanted` is the real command and all others are lines of the help."""
    app = typer.Typer(
        name="uavdepth",
        help="Obstacle awareness for drones from one camera.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )
    app.callback()(_options)
    for name, command in COMMANDS.items():
        target: Any = _load(name, command) if name == wanted else _line_of_help(command)
        if command.is_group:
            app.add_typer(target, name=name, help=command.summary)
        else:
            app.command(name, help=None if name == wanted else command.summary)(target)
    return app


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"uavdepth {version('uavdepth')}")
        raise typer.Exit


def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and end.", is_eager=True, callback=_show_version),
    ] = False,
) -> None:
    """Options of the program itself."""


def _line_of_help(command: Command) -> Callable[[], None] | typer.Typer:
    if command.is_group:
        group = typer.Typer()
        group.callback()(_nothing)
        return group
    return lambda: None


def _nothing() -> None:
    """Stand in for a command that is not imported."""


def _load(name: str, command: Command) -> Any:
    """The real command.

    Raises:
        UavDepthError: a package of an extra is not installed; the text names the extra.
    """
    try:
        return getattr(importlib.import_module(command.module), command.name)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if command.extra is None or missing in ("uavdepth", "service", "training", ""):
            raise UavDepthError(f"uavdepth {name}: this installation lacks {error.name}") from error
        raise UavDepthError(
            f"uavdepth {name} needs {missing}: pip install 'uavdepth[{command.extra}]'"
        ) from error


def fail(error: UavDepthError, code: int) -> NoReturn:
    """Say what went wrong and end."""
    typer.echo(f"uavdepth: {error}", err=True)
    sys.exit(code)
