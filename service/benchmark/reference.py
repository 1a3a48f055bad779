"""The networks that ours are measured against: the paper's and Monodepth2, with fresh weights."""

from __future__ import annotations

import importlib
from pathlib import Path

from uavdepth.model.card import ModelCard

PAPER_NETWORK = "bl+fan+eca"
BASELINE = "monodepth2"


class ReferenceUnavailableError(Exception):
    """The reference networks cannot be made here; the text says why."""


def write_reference(name: str, width: int, height: int, folder: Path) -> tuple[Path, ModelCard]:
    """An ONNX file of a reference network, with the card that makes a `DepthModel` of it.

    Args:
        name: `PAPER_NETWORK` or `BASELINE`.
        width, height: of its input.
        folder: where the file goes.

    Raises:
        ReferenceUnavailableError: torch is not installed.
    """
    try:
        # The workshop is not part of the service: it is reached only where somebody asks for it.
        export = importlib.import_module("training.fresh_network").export_fresh_network
    except ModuleNotFoundError as error:
        raise ReferenceUnavailableError(
            f"{error.name} is not installed: pip install 'uavdepth[train]'"
        ) from error
    path = folder / f"{name}-{width}x{height}.onnx"
    export(name, width, height, path)
    card = ModelCard(
        card_version=2,
        name=name,
        input_width=width,
        input_height=height,
        mean=(0.0, 0.0, 0.0),
        std=(1.0, 1.0, 1.0),
        output="relative_inverse_depth",
        output_name="disparity",
    )
    return path, card
