"""A network's file: where it lies, which card belongs to it, and whether the two fit together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uavdepth.errors import ModelCardError, ModelFileError
from uavdepth.model.card import CARD_FILE_SUFFIX, CARD_METADATA_KEY, ModelCard
from uavdepth.model.hint_levels import hint_shapes
from uavdepth.model.int8_file import INT8_SUFFIX

WEIGHTS_FOLDER = Path(__file__).parent.parent / "weights"
"""Networks that ship with the package: `<name>.onnx`."""

_INPUT_TYPES = ("tensor(float)", "tensor(float16)")


@dataclass(frozen=True)
class Problem:
    """What is wrong with a network or its card, and what to do about it."""

    text: str
    fix: str


def shipped_networks() -> list[str]:
    """Names of the networks inside the package; their 8-bit files are no networks of their own."""
    names = (file.stem for file in WEIGHTS_FOLDER.glob("*.onnx"))
    return sorted(name for name in names if not name.endswith(INT8_SUFFIX))


def find_network(path_or_name: str | Path) -> Path:
    """The file of a network given by its path or, if it ships with the package, by its name.

    Raises:
        ModelFileError: a name without a suffix that belongs to no network.
    """
    text = str(path_or_name)
    if isinstance(path_or_name, Path) or not text or Path(text).name != text:
        return Path(path_or_name)
    shipped = WEIGHTS_FOLDER / f"{text}.onnx"
    if shipped.is_file():
        return shipped
    if Path(text).suffix or Path(text).is_file():
        return Path(text)
    raise ModelFileError(
        f"there is no network named {text!r}; named ones are: {', '.join(shipped_networks()) or 'none'}; "
        "give a file by its path, with its suffix"
    )


def card_beside(path: Path) -> Path:
    """Where the card of a foreign network is looked for: `FILE.onnx.toml`."""
    return Path(f"{path}{CARD_FILE_SUFFIX}")


def read_card(session: Any, path: Path, card: Path | None = None) -> ModelCard:
    """The network's card.

    Args:
        session: the loaded network.
        path: its file.
        card: a TOML card to use whatever the file says; None: the file's own, else the one beside it.

    Raises:
        ModelCardError: no card, or one that cannot be read.
    """
    if card is not None:
        return _card_of_file(card)
    text = session.get_modelmeta().custom_metadata_map.get(CARD_METADATA_KEY)
    if text is not None:
        return ModelCard.from_json(text, str(path))
    beside = card_beside(path)
    if not beside.is_file():
        raise ModelCardError(
            f"{path}: the metadata key '{CARD_METADATA_KEY}' is missing, "
            f"and there is no {beside.name} beside it"
        )
    return _card_of_file(beside)


def _card_of_file(path: Path) -> ModelCard:
    try:
        return ModelCard.from_toml(path.read_bytes(), str(path))
    except OSError as error:
        raise ModelCardError(f"{path}: the model card cannot be read: {error.strerror}") from error


def network_problems(session: Any, card: ModelCard) -> list[Problem]:
    """Where the network's inputs and outputs are not what its card says; empty if all fits.

    Args:
        session: the loaded network.
        card: its card.
    """
    inputs = {item.name: item for item in session.get_inputs()}
    outputs = {item.name: item for item in session.get_outputs()}
    return [
        *_names_that_are_missing(card, sorted(inputs), sorted(outputs)),
        *_inputs_that_do_not_fit(card, inputs),
        *_outputs_that_do_not_fit(card, outputs),
    ]


def _names_that_are_missing(card: ModelCard, inputs: list[str], outputs: list[str]) -> Iterator[Problem]:
    wanted = {card.input_name: "input_name", **_hint_inputs(card)}
    for name, key in wanted.items():
        if name in inputs:
            continue
        if key == "hint_layout":
            text, fix = "'levels', which needs an input " + repr(name), "set it to 'planes', or export anew"
        else:
            text = repr(name)
            fix = f"set {key} to the name of the input" + (", or take it from hints" if card.hints else "")
        yield Problem(f"the card's {key} is {text}, the network's inputs are {inputs}", fix)
    unknown = [name for name in inputs if name not in wanted]
    if unknown and len(inputs) > len(wanted):
        yield Problem(
            f"the network has inputs that the card does not explain: {unknown}",
            "name them as hints in the card, or export the network without them",
        )
    needed = {"output_name": card.output_name}
    if card.uncertainty:
        needed["uncertainty_name"] = card.uncertainty_name
    for key, name in needed.items():
        if name not in outputs:
            yield Problem(
                f"the card's {key} is '{name}', the network's outputs are {outputs}",
                f"set {key} to one of them",
            )


def _inputs_that_do_not_fit(card: ModelCard, inputs: dict[str, Any]) -> Iterator[Problem]:
    channels = {card.input_name: 3}
    if card.hint_layout == "levels":
        yield from _levels_that_do_not_fit(card, inputs)
    else:
        channels.update({_input_of(card, hint): {"ground": 1, "points": 2}[hint] for hint in card.hints})
    for name, count in channels.items():
        if name not in inputs:
            continue
        item = inputs[name]
        types = _INPUT_TYPES if name == card.input_name else _INPUT_TYPES[:1]
        if item.type not in types:
            yield Problem(
                f"the network's input '{name}' is {item.type}: float32 is needed",
                "export it with a float32 input",
            )
        shape = list(item.shape)
        is_free = card.multiple_of is not None
        height, width = ("height", "width") if is_free else (card.input_height, card.input_width)
        is_last = card.layout == "nhwc" and name == card.input_name
        wanted = [1, height, width, count] if is_last else [1, count, height, width]
        if len(shape) != 4 or any(
            isinstance(size, int) and isinstance(want, int) and size != want
            for size, want in zip(shape, wanted, strict=True)
        ):
            yield Problem(
                f"the card asks for an input '{name}' of {wanted}, the network's is {shape}",
                "set input_width, input_height and layout as the network has them",
            )
        elif is_free and any(
            isinstance(size, int) for size, want in zip(shape, wanted, strict=True) if isinstance(want, str)
        ):
            yield Problem(
                f"the card's multiple_of says that the size is free: {wanted}, the network's is {shape}",
                "take multiple_of out and set input_width and input_height to that size, or correct layout",
            )
    if card.multiple_of is not None:
        for key in ("input_width", "input_height"):
            if getattr(card, key) % card.multiple_of:
                yield Problem(
                    f"the card's {key} is {getattr(card, key)}, no multiple of {card.multiple_of}",
                    f"take a whole multiple of {card.multiple_of}",
                )


def _levels_that_do_not_fit(card: ModelCard, inputs: dict[str, Any]) -> Iterator[Problem]:
    for name, wanted in hint_shapes(card.input_width, card.input_height).items():
        if name in inputs and (tuple(inputs[name].shape), inputs[name].type) != (wanted, _INPUT_TYPES[0]):
            yield Problem(
                f"the network's input '{name}' is {inputs[name].type} {list(inputs[name].shape)}: "
                f"float32 {list(wanted)} is needed",
                "export it anew with this version",
            )


def _outputs_that_do_not_fit(card: ModelCard, outputs: dict[str, Any]) -> Iterator[Problem]:
    for name in (card.output_name, card.uncertainty_name) if card.uncertainty else (card.output_name,):
        if name not in outputs:
            continue
        shape = list(outputs[name].shape or [])
        if len([size for size in shape if size != 1 and isinstance(size, int)]) > 2 or 0 < len(shape) < 2:
            yield Problem(
                f"the network's output '{name}' is {shape}: rows and columns, and axes of 1, are needed",
                "name another output, or export the network with one channel of depth",
            )
        if outputs[name].type not in _INPUT_TYPES:
            yield Problem(
                f"the network's output '{name}' is {outputs[name].type}: float32 is needed",
                "export it with a float32 output",
            )


def _hint_inputs(card: ModelCard) -> dict[str, str]:
    """Names of the inputs for hints, with the card's keys that ask for them."""
    if card.hint_layout == "levels":
        return dict.fromkeys(hint_shapes(card.input_width, card.input_height), "hint_layout")
    return {_input_of(card, hint): f"{hint}_name" for hint in card.hints}


def _input_of(card: ModelCard, hint: str) -> str:
    return card.ground_name if hint == "ground" else card.points_name
