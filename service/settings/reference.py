"""The documentation of the configuration, made from the models that check it."""

from __future__ import annotations

import textwrap
import types
from collections.abc import Iterator
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from service.settings import Settings
from service.settings.load import section_model, table_model

EXAMPLE_VALUES = {("camera", "source"): "0", ("camera", "horizontal_fov_deg"): 78.0}
"""What the example says where a key has no default or is needed for the example to be valid."""


def reference_markdown() -> str:
    """Markdown that describes every section and key: type, bounds, default and meaning."""
    lines = [
        "# Configuration of uavdepth",
        "",
        "One TOML file. Unknown keys, wrong types and values out of bounds stop the program at once.",
        "",
    ]
    for title, model in [*((f"[{name}]", model) for name, model in _sections()), *_lists_of_tables()]:
        lines += [f"## {title}", "", _sentence(model), ""]
        lines += ["| key | type and bounds | default | meaning |", "|---|---|---|---|"]
        for key, field in model.model_fields.items():
            meaning = f"{field.title}. {field.description or ''}".strip()
            lines.append(
                f"| `{key}` | {_cell(_type_words(field))} | {_default_words(field)} | {_cell(meaning)} |"
            )
        lines.append("")
    return "\n".join(lines)


def example_toml() -> str:
    """A TOML file with every key, its meaning as a comment, and its default; a valid configuration."""
    lines = [
        "# Configuration of uavdepth. Keys that are commented out have no value unless you give one.",
        "",
    ]
    for name, model in _sections():
        lines += [f"[{name}]", f"# {_sentence(model)}", ""]
        for key, field in model.model_fields.items():
            comment = f"{field.title}: {_type_words(field)}. {field.description or ''}"
            lines += textwrap.wrap(comment, 100, initial_indent="# ", subsequent_indent="# ")
            value = EXAMPLE_VALUES.get((name, key), _default(field))
            lines.append(f"# {key} =" if value is None else f"{key} = {_toml(value)}")
            lines.append("")
    for title, model in _lists_of_tables():
        lines += [f"# {title}", f"# {_sentence(model)}", ""]
    return "\n".join(lines)


def _sections() -> Iterator[tuple[str, type[BaseModel]]]:
    for name in Settings.model_fields:
        model = section_model(name)
        if model is not None:
            yield name, model


def _lists_of_tables() -> Iterator[tuple[str, type[BaseModel]]]:
    for name in Settings.model_fields:
        model = table_model(name)
        if model is not None:
            yield f"[[{name}]]", model


def _sentence(model: type[BaseModel]) -> str:
    return (model.__doc__ or "").strip().split("\n")[0]


def _default(field: FieldInfo) -> Any:
    value = field.get_default(call_default_factory=True, validated_data={})
    return None if value is PydanticUndefined else value


def _default_words(field: FieldInfo) -> str:
    if field.is_required():
        return "**required**"
    value = _default(field)
    if isinstance(value, BaseModel):
        return "its defaults"
    return "none" if value is None else f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return str(value)


def _type_words(field: FieldInfo) -> str:
    words = _annotation_words(field.annotation)
    low, high = "", ""
    for bound in field.metadata:
        if isinstance(bound, annotated_types.Ge):
            low = f"from {bound.ge}"
        elif isinstance(bound, annotated_types.Gt):
            low = f"above {bound.gt}"
        elif isinstance(bound, annotated_types.Le):
            high = f"to {bound.le}" if low.startswith("from") else f"at most {bound.le}"
        elif isinstance(bound, annotated_types.Lt):
            high = f"below {bound.lt}"
    bounds = (" " if high.startswith("to") else ", ").join(part for part in (low, high) if part)
    return f"{words}, {bounds}" if bounds else words


def _annotation_words(annotation: Any) -> str:
    origin = get_origin(annotation)
    if origin is Literal:
        return "one of " + ", ".join(_toml(value) for value in get_args(annotation))
    if origin is Annotated:
        return _annotation_words(get_args(annotation)[0])
    if origin in (Union, types.UnionType):
        return " or ".join(_annotation_words(part) for part in get_args(annotation) if part is not type(None))
    if origin is tuple:
        return f"list of {_annotation_words(get_args(annotation)[0])}"
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "table"
    names: dict[Any, str] = {bool: "true or false", int: "whole number", float: "number", str: "text"}
    return names.get(annotation, str(annotation))


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
