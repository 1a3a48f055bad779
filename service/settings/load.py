"""From a TOML file and command-line overrides to `Settings`, with errors that name file and key."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from service.errors import ConfigError
from service.settings import Settings

_TYPE_WORDS = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "string_type": 'text in "quotes"',
    "bool_type": "true or false",
    "tuple_type": "a list in [brackets]",
    "finite_number": "a finite number",
}
_COMPARISON_WORDS = {
    "greater_than_equal": ("ge", "below"),
    "greater_than": ("gt", "not above"),
    "less_than_equal": ("le", "above"),
    "less_than": ("lt", "not below"),
}


_NO_CAMERA = {"source": "none", "horizontal_fov_deg": 90.0}


def load_settings(path: Path | None, overrides: Iterable[str] = (), *, needs_camera: bool = True) -> Settings:
    """Read the configuration.

    Args:
        path: TOML file, or None to start from the defaults.
        overrides: `section.key=value`, applied over the file in order.
        needs_camera: False for programs on the ground, whose file need not have `[camera]`.

    Raises:
        ConfigError: a file that cannot be read, broken TOML, an unknown key, a value of the wrong type
            or out of bounds; the text names the file and each key.
    """
    table = _read_toml(path) if path is not None else {}
    table.setdefault(
        "camera", {} if needs_camera else dict(_NO_CAMERA)
    )  # so that an empty file is told "[camera] source: is missing"
    given = [parse_override(text) for text in overrides]
    for section, key, value in given:
        inside = table.setdefault(section, {})
        if isinstance(inside, dict):
            inside[key] = value
    where = f" {path}" if path is not None else ""
    if path is None or given:
        where += " and the command line" if where else " from the command line"
    try:
        return Settings.model_validate(table)
    except ValidationError as error:
        problems = [describe_problem(detail) for detail in error.errors()]
        raise ConfigError(f"configuration{where}:\n" + "\n".join(f"  {line}" for line in problems)) from error


def parse_override(text: str) -> tuple[str, str, Any]:
    """("section", "key", value) of `section.key=value`.

    The value is TOML; where it is none (an URL, a path), or where the key holds text, it is text as it
    stands, so that `camera.source=0` needs no quotes inside quotes.

    Raises:
        ConfigError: text of another form.
    """
    name, equals, value = text.partition("=")
    section, dot, key = name.strip().partition(".")
    if not (equals and dot and section and key) or "." in key:
        raise ConfigError(f"--set {text!r}: section.key=value is needed, for example camera.fps=15")
    parsed = _toml_value(value.strip())
    if _holds_text(section, key) and not isinstance(parsed, str):
        parsed = value.strip()
    return section, key, parsed


def _holds_text(section: str, key: str) -> bool:
    model = section_model(section)
    return model is not None and key in model.model_fields and model.model_fields[key].annotation is str


def section_model(section: str) -> type[BaseModel] | None:
    """The model of a section by its name in the file, or None if there is no such section."""
    annotation = Settings.model_fields[section].annotation if section in Settings.model_fields else None
    return annotation if isinstance(annotation, type) and issubclass(annotation, BaseModel) else None


def table_model(name: str) -> type[BaseModel] | None:
    """The model of one table of a list of tables (`[[name]]`), or None if there is no such list."""
    annotation = Settings.model_fields[name].annotation if name in Settings.model_fields else None
    inner = get_args(annotation)[0] if get_origin(annotation) is tuple else None
    return inner if isinstance(inner, type) and issubclass(inner, BaseModel) else None


def _toml_value(text: str) -> Any:
    """`text` read as TOML; what is no TOML value (an URL, a path, a name) is text as it stands."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return parsed["value"] if set(parsed) == {"value"} else text


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except FileNotFoundError as error:
        raise ConfigError(f"configuration {path}: no such file") from error
    except OSError as error:
        raise ConfigError(f"configuration {path}: cannot be read: {error.strerror}") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"configuration {path}: not TOML: {error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"configuration {path}: not UTF-8 text at byte {error.start}") from error


def describe_problem(detail: ErrorDetails) -> str:
    """One validation problem in words: `[camera] fps: 500 is above 240`."""
    location = [part for part in detail["loc"] if isinstance(part, str)]
    name = f"[{location[0]}]" + "".join(f" {part}" for part in location[1:]) if location else "the file"
    return f"{name}: {_reason(detail, location)}"


def _reason(detail: ErrorDetails, location: list[str]) -> str:
    kind, value = detail["type"], detail["input"]
    limits: Mapping[str, Any] = detail.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(location)
    if kind == "missing":
        return "is missing"
    if kind in _COMPARISON_WORDS:
        limit, word = _COMPARISON_WORDS[kind]
        return f"{value} is {word} {limits[limit]:g}"
    if kind in _TYPE_WORDS:
        return f"{_shown(value)} is not {_TYPE_WORDS[kind]}"
    if kind == "literal_error":
        return f"{_shown(value)} is none of {limits['expected']}"
    if kind == "string_pattern_mismatch":
        return f"{_shown(value)} does not match {limits['pattern']}"
    if kind == "value_error":
        return str(limits["error"])
    if kind in ("model_type", "model_attributes_type"):
        return f"{_shown(value)} is not a table: write [{location[0]}] and its keys below it"
    return f"{_shown(value)}: {detail['msg']}"


def _unknown_key(location: list[str]) -> str:
    known = _known_names(location[:-1])
    near = difflib.get_close_matches(location[-1], known, n=1, cutoff=0.5)
    noun = "section" if len(location) == 1 else "key"
    if near:
        return f"unknown {noun}; did you mean {near[0]}?"
    return f"unknown {noun}; known are {', '.join(sorted(known))}"


def _known_names(path: list[str]) -> list[str]:
    if not path:
        return list(Settings.model_fields)
    model = section_model(path[0]) or table_model(path[0])
    for name in path[1:]:
        inner = model.model_fields[name].annotation if model and name in model.model_fields else None
        model = inner if isinstance(inner, type) and issubclass(inner, BaseModel) else None
    return list(model.model_fields) if model is not None else []


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
