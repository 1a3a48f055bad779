"""From what the user names to footage and the settings to play it with."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from service.errors import ConfigError
from service.replay.footage import Footage
from service.replay.recorded_settings import settings_of
from service.replay.recording import Recording
from service.settings import Settings
from service.settings.load import load_settings

RECORD_SUFFIX = ".mcap"
TELEMETRY_SUFFIXES = (".tlog", ".bin", ".ulg")
_PART = re.compile(r"^(.+)-(\d{3})\.mcap$")


@dataclass(frozen=True)
class Flight:
    """Something to replay.

    Args:
        stem: path of its first file without the ending; its golden scans lie at `<stem>.golden.json`.
        footage: pictures and telemetry.
        settings: what to play it with.
    """

    stem: Path
    footage: Footage
    settings: Settings


def flights_in(paths: Sequence[Path]) -> list[list[Path]]:
    """The files of each flight that `paths` name, in order.

    A record stands for itself, a folder for the records in it (the parts of one recording together), and
    a video or a folder of pictures goes with a telemetry log.

    Raises:
        ConfigError: paths that make no footage.
    """
    if not paths:
        raise ConfigError("replay: a record, a folder, or a video and its telemetry log are needed")
    for path in paths:
        if not path.exists():
            raise ConfigError(f"replay: {path}: no such file or folder")
    if any(path.suffix.lower() in TELEMETRY_SUFFIXES for path in paths):
        if len(paths) != 2:
            raise ConfigError("replay: one video or folder of pictures, and one telemetry log are needed")
        return [list(paths)]
    found: list[list[Path]] = []
    for path in paths:
        if path.is_dir():
            records = sorted(path.glob(f"*{RECORD_SUFFIX}"))
            if not records:
                raise ConfigError(
                    f"replay: {path}: no {RECORD_SUFFIX} records in it; pictures need a telemetry log "
                    f"({', '.join(TELEMETRY_SUFFIXES)}) beside them on the command line"
                )
            found += _parts_together(records)
        elif path.suffix.lower() == RECORD_SUFFIX:
            found.append([path])
        else:
            raise ConfigError(
                f"replay: {path}: not a {RECORD_SUFFIX} record; a video needs a telemetry log "
                f"({', '.join(TELEMETRY_SUFFIXES)}) beside it on the command line"
            )
    return found


def open_flight(
    files: Sequence[Path],
    config: Path | None,
    overrides: Sequence[str],
    *,
    fps: float | None = None,
    offset_s: float = 0.0,
) -> Flight:
    """One flight of `flights_in`.

    Args:
        files: its files.
        config: configuration; what it holds counts more than what a record holds.
        overrides: `section.key=value` that count most.
        fps: pictures a second, for videos that do not tell.
        offset_s: when the first picture was taken, seconds after the telemetry log begins.

    Raises:
        ConfigError: a configuration that is wrong or does not fit.
        RecordError: files that cannot be played.
    """
    if files[0].suffix.lower() == RECORD_SUFFIX:
        recording = Recording(files)
        settings = settings_of(recording.configuration, recording.name, config, overrides, recording.warnings)
        return Flight(_stem(files[0]), recording, settings)
    from service.replay.loose_footage import LooseFootage

    if config is None:
        raise ConfigError("replay: a video or pictures need --config with [camera] and [mount]")
    pictures, telemetry = files
    if pictures.suffix.lower() in TELEMETRY_SUFFIXES:
        pictures, telemetry = telemetry, pictures
    settings = load_settings(config, [f"camera.source={pictures}", *overrides])
    footage = LooseFootage(pictures, telemetry, settings.camera, fps=fps, offset_s=offset_s)
    return Flight(pictures.with_suffix(""), footage, settings)


def _stem(path: Path) -> Path:
    match = _PART.match(path.name)
    return path.with_name(match[1]) if match else path.with_suffix("")


def _parts_together(records: Sequence[Path]) -> list[list[Path]]:
    groups: dict[Path, list[Path]] = {}
    for path in records:
        groups.setdefault(_stem(path), []).append(path)
    return list(groups.values())
