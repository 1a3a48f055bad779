"""`uavdepth networks`: size and cost of every network."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from training.extras import needs_extra

if TYPE_CHECKING:
    from rich.table import Table

    from training.networks.counting import NetworkCost

_PIPE_WIDTH = 120
_MILLION, _BILLION = 1e6, 1e9


def networks(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Count parameters and operations of every network: baselines, ablation, pose and flight.

    G multiply-adds counts a multiplication with its addition once, GFLOP counts both.
    """
    with needs_extra("networks", "train"):
        from training.networks.counting import count_networks

    costs = count_networks()
    if as_json:
        typer.echo(json.dumps({"networks": [as_object(cost) for cost in costs]}, indent=2))
        return
    from rich.console import Console

    Console(width=None if sys.stdout.isatty() else _PIPE_WIDTH).print(table(costs))


def as_object(cost: NetworkCost) -> dict[str, Any]:
    """A network's cost as JSON."""
    return {
        "name": cost.name,
        "encoder": cost.encoder,
        "parameters": cost.parameters,
        "pictures": [
            {
                "width": picture.width,
                "height": picture.height,
                "multiply_adds": picture.multiply_adds,
                "operations": picture.operations,
            }
            for picture in cost.pictures
        ],
    }


def table(costs: list[NetworkCost]) -> Table:
    """The costs as one table, a network a row."""
    from rich.table import Table

    result = Table(caption="One picture; for pose one pair. GFLOP: multiplications and additions.")
    for heading in ("network", "encoder"):
        result.add_column(heading)
    result.add_column("parameters, M", justify="right")
    for picture in costs[0].pictures:
        size = f"{picture.width}x{picture.height}"
        result.add_column(f"G multiply-adds\n{size}", justify="right")
        result.add_column(f"GFLOP\n{size}", justify="right")
    for cost in costs:
        row = [cost.name, cost.encoder or "-", f"{cost.parameters / _MILLION:.2f}"]
        for picture in cost.pictures:
            row += [f"{picture.multiply_adds / _BILLION:.2f}", f"{picture.operations / _BILLION:.2f}"]
        result.add_row(*row)
    return result
