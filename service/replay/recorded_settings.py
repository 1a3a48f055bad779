"""The configuration that a record was flown with, as settings of this version."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from service.errors import ConfigError, RecordError
from service.settings import Settings
from service.settings.load import describe_problem, load_settings, parse_override, table_model


def settings_of(
    configuration: Mapping[str, Any],
    name: str,
    config: Path | None = None,
    overrides: Iterable[str] = (),
    warnings: list[str] | None = None,
) -> Settings:
    """The settings to replay with.

    Keys that this version does not know any more are left out.

    Args:
        configuration: sections as they lie in the record.
        name: the record's, for messages.
        config: a file whose keys count more than the record's.
        overrides: `section.key=value` that count most.
        warnings: gets the keys that were left out, in words.

    Raises:
        ConfigError: the file or the overrides are wrong.
        RecordError: the recorded configuration cannot be used.
    """
    table: dict[str, Any] = {
        section: dict(keys) if isinstance(keys, Mapping) else keys
        for section, keys in configuration.items()
        if isinstance(keys, Mapping if table_model(section) is None else list)
    }
    left_out = _without_unknown(table)
    if warnings is not None:
        warnings += [f"{name}: recorded key {key} is not known any more: left out" for key in left_out]
    given: dict[str, Any] = {}
    if config is not None:
        given = load_settings(config).model_dump(mode="json", exclude_unset=True)
    for section, keys in given.items():
        if isinstance(keys, Mapping):
            table.setdefault(section, {}).update(keys)
        else:
            table[section] = keys  # a list of tables counts as a whole
    for section, key, value in map(parse_override, overrides):
        if table_model(section) is not None:
            raise ConfigError(f"--set {section}.{key}: [[{section}]] is a list of tables: give it in a file")
        table.setdefault(section, {})[key] = value
        given.setdefault(section, {})[key] = value
    # A replay listens to nobody and tells nobody unless it is asked to.
    table.setdefault("zenoh", {}).setdefault("enabled", False)
    try:
        return _validated(table)
    except ValidationError as error:
        lines = [describe_problem(detail) for detail in error.errors()]
        text = "\n".join(f"  {line}" for line in lines)
        if given:
            raise ConfigError(f"configuration of {name} and the command line:\n{text}") from error
        raise RecordError(f"configuration in {name}:\n{text}") from error


def _validated(table: dict[str, Any]) -> Settings:
    # By way of JSON, which has lists where settings have tuples.
    return Settings.model_validate_json(json.dumps(table))


def _without_unknown(table: dict[str, Any]) -> list[str]:
    """Leave out what this version does not know; returns its keys."""
    left_out: list[str] = []
    try:
        _validated(table)
    except ValidationError as error:
        for detail in error.errors():
            where = [str(part) for part in detail["loc"]]
            if detail["type"] != "extra_forbidden":
                continue
            _pop(table, detail["loc"])
            left_out.append(".".join(where))
    return left_out


def _pop(table: Any, where: Sequence[int | str]) -> None:
    """Take one key out of tables and lists of tables."""
    for part in where[:-1]:
        table = table[part]
    del table[where[-1]]
