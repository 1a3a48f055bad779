"""`uavdepth card`.

Heavy packages are imported when the command runs, so that its help is fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from training.errors import ExportError
from training.extras import needs_extra


def card(
    network: Annotated[str, typer.Argument(help="Network: an ONNX file, or the name of one that ships.")],
    measured: Annotated[
        Path | None, typer.Option(help="Result of `uavdepth evaluate --json` whose errors go into the card.")
    ] = None,
    effort: Annotated[str | None, typer.Option(help="Pictures and hours of all runs together.")] = None,
) -> None:
    """Write errors and effort into the card of a network and of its 8-bit file.

    A network is measured as it flies, so its errors are known only when its file is there already.
    """
    with needs_extra("card", "train"):
        from training.card_update import measured_errors, update_card
        from uavdepth.model.network_file import find_network

    if measured is None and effort is None:
        raise ExportError("nothing to write: give --measured, --effort or both")
    errors = None if measured is None else measured_errors(measured)
    for path in update_card(find_network(network), errors, effort):
        typer.echo(f"{path}: card updated")
