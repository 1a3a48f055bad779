"""Intrinsics from a JSON or TOML file."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path
from typing import Any

from training.errors import TrainingDataError
from uavdepth.camera import CameraModel
from uavdepth.errors import CameraModelError

_PINHOLE = ("fx", "fy", "cx", "cy")
_KNOWN = {"width", "height", *_PINHOLE, "distortion", "horizontal_fov_deg"}


def read_camera(path: Path) -> CameraModel:
    """The camera that a file describes.

    Keys: `width`, `height` and either `fx`, `fy`, `cx`, `cy` (pixels; the centre of the first pixel is 0)
    with an optional `distortion` (OpenCV's order), or `horizontal_fov_deg`. A `camera` section, as in the
    program's own configuration, is read in place of the whole file; what else stands there is ignored.

    Raises:
        TrainingDataError: missing, unreadable, a key too few or unknown, or an impossible value.
    """
    values = _read_table(path)
    section = values.get("camera")
    if isinstance(section, dict):
        values = {key: value for key, value in section.items() if key in _KNOWN}
    unknown = sorted(set(values) - _KNOWN)
    if unknown:
        raise TrainingDataError(f"{path}: a camera has no {', '.join(unknown)}; it has {_listed(_KNOWN)}")
    by_angle = "horizontal_fov_deg" in values
    needed = ("width", "height", *(("horizontal_fov_deg",) if by_angle else _PINHOLE))
    missing = [key for key in needed if key not in values]
    if missing:
        raise TrainingDataError(f"{path} describes a camera without {', '.join(missing)}")
    if by_angle and any(key in values for key in (*_PINHOLE, "distortion")):
        raise TrainingDataError(f"{path} gives both a field of view and {_listed(_PINHOLE)}: choose one")
    numbers = {key: _number(path, key, values[key]) for key in needed}
    width, height = int(numbers["width"]), int(numbers["height"])
    if (width, height) != (numbers["width"], numbers["height"]):
        raise TrainingDataError(f"{path}: width and height are whole numbers of pixels")
    listed = values.get("distortion", [])
    if not isinstance(listed, list):
        raise TrainingDataError(f"{path}: distortion is {listed!r}: a list of numbers is needed")
    distortion = tuple(_number(path, "distortion", value) for value in listed)
    try:
        if by_angle:
            return CameraModel.from_fov(width, height, numbers["horizontal_fov_deg"])
        fx, fy, cx, cy = (numbers[key] for key in _PINHOLE)
        return CameraModel(width, height, fx, fy, cx, cy, distortion)
    except CameraModelError as error:
        raise TrainingDataError(f"{path}: {error}") from error


def _read_table(path: Path) -> dict[str, Any]:
    try:
        text = path.read_text(encoding="utf-8")
        table = tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except (OSError, ValueError) as error:
        raise TrainingDataError(f"cannot read the calibration {path}: {error}") from error
    if not isinstance(table, dict):
        raise TrainingDataError(f"{path} is not a table of camera values")
    return table


def _number(path: Path, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TrainingDataError(f"{path}: {key} is {value!r}: a finite number is needed")
    return float(value)


def _listed(names: set[str] | tuple[str, ...]) -> str:
    return ", ".join(sorted(names))
