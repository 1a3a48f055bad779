"""What becomes known of a network after its file was written: its errors, and what it cost.

The 8-bit file beside it names the digest of the file that it was made from, which a new card changes: both
get the new card, and the 8-bit file the new digest.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import onnx
from pydantic import JsonValue

from training.errors import EvaluationError, ExportError
from training.onnx_file import write_checked
from uavdepth.model.card import CARD_METADATA_KEY, ModelCard
from uavdepth.model.int8_file import SOURCE_METADATA_KEY, digest, int8_beside

OF_THE_FILE = ("sigma_calibration", "int8_against_float")
"""Entries among a card's measured errors that were found when the file itself was made."""


def update_card(
    path: Path, measured: Mapping[str, JsonValue] | None = None, effort: str | None = None
) -> tuple[Path, ...]:
    """Write newer errors and effort into the card of a network and of its 8-bit file.

    Args:
        path: ONNX file with its card inside.
        measured: errors on data that it was not trained on; they replace what stands there, `OF_THE_FILE`
            apart. None leaves all.
        effort: what its training cost. None leaves it.

    Returns:
        The files that were written.

    Raises:
        ExportError: a file without a card inside, an 8-bit file alone, or one of another network: nothing is
            written.
        ModelCardError: a card that cannot be read.
    """
    network, card = _read(path)
    if _property(network, SOURCE_METADATA_KEY) is not None:
        raise ExportError(f"{path} is an 8-bit file: name the network that it was made from")
    beside = int8_beside(path)
    second = _read(beside) if beside.is_file() else None
    if second is not None and _property(second[0], SOURCE_METADATA_KEY) != digest(path):
        raise ExportError(f"{beside} was made from another file than {path}: quantize it anew, or remove it")
    write_checked(network, _updated(card, measured, effort), path, _unchecked)
    if second is None:
        return (path,)
    # A failure between the two leaves an 8-bit file that names another digest: it is not flown with.
    write_checked(
        second[0],
        _updated(second[1], measured, effort),
        beside,
        _unchecked,
        {SOURCE_METADATA_KEY: digest(path)},
    )
    return path, beside


def measured_errors(path: Path) -> dict[str, Any]:
    """The part of an evaluation that belongs into a model card.

    Raises:
        EvaluationError: no result of `uavdepth evaluate --json`.
    """
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        return dict(result["summary"])
    except FileNotFoundError as error:
        raise EvaluationError(f"no result of an evaluation at {path}") from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise EvaluationError(f"{path} is not a result of `uavdepth evaluate --json`: {error!r}") from error


def _read(path: Path) -> tuple[onnx.ModelProto, ModelCard]:
    network = onnx.load(str(path))
    text = _property(network, CARD_METADATA_KEY)
    if text is None:
        raise ExportError(f"{path} has no card inside: only files of `uavdepth export` and `quantize` do")
    return network, ModelCard.from_json(text, str(path))


def _property(network: onnx.ModelProto, key: str) -> str | None:
    return next((str(entry.value) for entry in network.metadata_props if entry.key == key), None)


def _updated(card: ModelCard, measured: Mapping[str, JsonValue] | None, effort: str | None) -> ModelCard:
    changes: dict[str, object] = {}
    if measured is not None:
        kept = {name: card.measured[name] for name in OF_THE_FILE if name in card.measured}
        changes["measured"] = {**measured, **kept}
    if effort is not None:
        changes["effort"] = effort
    return ModelCard.model_validate({**card.model_dump(exclude_unset=True), **changes})


def _unchecked(_path: Path) -> None:
    """The graph is as it was."""
