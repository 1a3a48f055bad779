"""Folders whose files are numbered by frame."""

from __future__ import annotations

from pathlib import Path


def numbered_files(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """Files whose stem is a number, by that number, in its order."""
    files = (path for path in folder.iterdir() if path.suffix.lower() in suffixes and path.stem.isdigit())
    return dict(sorted((int(path.stem), path) for path in files))


def without_gaps(files: dict[int, Path]) -> tuple[Path, ...]:
    """The files from the first number to the last; where a number is missing, the path it would have."""
    if not files:
        return ()
    first, last = min(files), max(files)
    pattern = files[first]
    digits = len(pattern.stem)
    return tuple(
        files.get(number, pattern.with_name(f"{number:0{digits}d}{pattern.suffix}"))
        for number in range(first, last + 1)
    )
