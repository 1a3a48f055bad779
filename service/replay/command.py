"""`uavdepth replay`."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.errors import ConfigError, RecordError
from service.options import ConfigOption, OverridesOption

if TYPE_CHECKING:
    from service.replay.golden import Golden
    from service.replay.open_footage import Flight
    from service.replay.player import Replayed

GOLDEN_SUFFIX = ".golden.json"


def replay(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORD|FOLDER|VIDEO TELEMETRY",
            help="Records (.mcap), folders of them, or a video or folder of pictures "
            "and its telemetry log (.tlog, .BIN, .ulg).",
        ),
    ],
    config: ConfigOption = None,
    from_depth: Annotated[
        bool, typer.Option("--from-depth", help="Take recorded depth instead of asking the network.")
    ] = False,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="At the record's pace; otherwise as fast as it goes.")
    ] = False,
    check: Annotated[
        Path | None,
        typer.Option(metavar="GOLDEN", help="Compare with a golden file, or with those in a folder."),
    ] = None,
    update: Annotated[
        bool, typer.Option("--update", help="Write the golden file: at --check, or beside the record.")
    ] = False,
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With --check: draw what differs (.png).")
    ] = None,
    autopilot: Annotated[
        str | None, typer.Option(help="Send the scans to this live autopilot, e.g. tcp:127.0.0.1:5760.")
    ] = None,
    zenoh: Annotated[
        bool, typer.Option("--zenoh", help="Publish for ground stations, as \\[zenoh] says.")
    ] = False,
    fps: Annotated[
        float | None, typer.Option(min=0.1, max=240, help="Pictures a second, for videos that do not tell.")
    ] = None,
    offset: Annotated[
        float, typer.Option(help="When the first picture was taken, seconds after the telemetry log begins.")
    ] = 0.0,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are no golden files.")] = False,
    overrides: OverridesOption = None,
) -> None:
    """Measure recorded flights again, by the same pipeline on the record's clock.

    Exit code 1 if a flight cannot be played or differs from its golden scans.
    """
    from service.log_setup import set_up_logging
    from service.replay.open_footage import flights_in, open_flight
    from service.replay.player import play
    from service.settings.log import LogSettings

    set_up_logging(LogSettings(level="warning"))
    if picture is not None and check is None:
        raise ConfigError("replay: --picture draws what --check finds; give --check too")
    if picture is not None and picture.exists() and not force:
        raise ConfigError(f"replay: picture {picture}: exists; --force replaces it")
    given = list(overrides or ())
    if autopilot is not None:
        given.append(f"autopilot.endpoint={autopilot}")
    if zenoh:
        given.append("zenoh.enabled=true")
    flights = flights_in(paths)
    if picture is not None and len(flights) > 1:
        raise ConfigError(f"replay: --picture draws one flight, not {len(flights)}")

    def play_one(files: Sequence[Path]) -> bool:
        flight = open_flight(files, config, given, fps=fps, offset_s=offset)
        goldens = _golden_path(flight, check) if check is not None or update else None
        old = _old_golden(goldens, update=update, force=force) if goldens is not None else None
        begun_s = time.monotonic()
        played = play(flight.settings, flight.footage, from_depth=from_depth)
        if realtime or autopilot is not None or zenoh:
            played = _shown(flight, played, autopilot=autopilot is not None, zenoh=zenoh)
        results = [_slim(one) for one in played]
        for warning in flight.footage.warnings:
            typer.echo(f"warning: {warning}", err=True)
        _tell(flight, results, time.monotonic() - begun_s)
        if goldens is None:
            return True
        return _hold_against(goldens, old, flight, results, update=update, picture=picture)

    passed, broken = True, 0
    for files in flights:
        try:
            passed &= play_one(files)
        except RecordError as error:
            broken += 1
            typer.echo(f"uavdepth: {error}", err=True)
    if broken and len(flights) > 1:
        typer.echo(f"{broken} of {len(flights)} flights could not be played", err=True)
    if broken or not passed:
        raise typer.Exit(1)


def _shown(flight: Flight, played: Iterator[Replayed], *, autopilot: bool, zenoh: bool) -> Iterator[Replayed]:
    """The same at the record's pace, told to whoever listens."""
    from service.replay.live_outputs import LiveOutputs

    with LiveOutputs(flight.settings, autopilot=autopilot, zenoh=zenoh) as outputs:
        for one in played:
            outputs.show(one.result, one.note.done_ns)
            yield one


def _slim(one: Replayed) -> Replayed:
    """Without picture and depth: an hour's results fit into memory."""
    from dataclasses import replace

    import numpy as np

    frame = replace(one.result.frame, image_bgr=np.zeros((0, 0, 3), np.uint8))
    return replace(one, result=replace(one.result, frame=frame, depth=None))


def _tell(flight: Flight, results: list[Replayed], took_s: float) -> None:
    trusted = sum(one.result.trusted for one in results)
    first_ns, last_ns = results[0].note.captured_ns, results[-1].note.captured_ns
    distances = [one.result.scan.nearest_m for one in results if one.result.scan.nearest_m is not None]
    nearest = f"nearest obstacle {min(distances):.2f} m" if distances else "no obstacle"
    typer.echo(
        f"{flight.footage.name}: {len(results)} pictures, {(last_ns - first_ns) / 1e9:.1f} s, "
        f"{trusted} trusted, {nearest}; replayed in {took_s:.1f} s"
    )
    troubles = Counter(one.result.trouble.value for one in results if one.result.trouble is not None)
    for words, count in troubles.most_common():
        typer.echo(f"  {count} pictures: {words}")


def _golden_path(flight: Flight, check: Path | None) -> Path:
    beside = flight.stem.with_name(flight.stem.name + GOLDEN_SUFFIX)
    if check is None:
        return beside
    return check / beside.name if check.is_dir() else check


def _old_golden(path: Path, *, update: bool, force: bool) -> Golden | None:
    """The golden scans as they are; None where `update` makes the first."""
    from service.replay.golden import load_golden

    if not update:
        return load_golden(path)
    if not path.exists():
        return None
    try:
        return load_golden(path)
    except RecordError as error:
        if force:
            return None
        raise RecordError(f"{error}; --force replaces it") from error


def _hold_against(
    path: Path,
    old: Golden | None,
    flight: Flight,
    results: list[Replayed],
    *,
    update: bool,
    picture: Path | None,
) -> bool:
    """Compare, and with `update` write; whether all is well."""
    from service.replay.comparison import compare
    from service.replay.comparison_picture import save_comparison
    from service.replay.golden import Golden, Tolerances, golden_scans, save_golden

    now = golden_scans(results)
    comparison = None if old is None else compare(old, now)
    if comparison is not None and old is not None:
        for line in comparison.lines():
            typer.echo(f"  {line}")
        if picture is not None:
            save_comparison(picture, old, now, comparison)
            typer.echo(f"  drawn: {picture}")
    if update:
        network = flight.settings.model.path
        tolerances = Tolerances() if old is None else old.tolerances
        save_golden(
            path,
            Golden(record=flight.footage.name, network=network, tolerances=tolerances, scans=now),
        )
        typer.echo(f"  written: {path}")
        return True
    return comparison is not None and comparison.passed
