"""`uavdepth config`: the reference, an example, and a check of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

config_app = typer.Typer(no_args_is_help=True, help="Describe and check the configuration.")


@config_app.command()
def reference() -> None:
    """Print the documentation of every key as Markdown."""
    from service.settings.reference import reference_markdown

    typer.echo(reference_markdown())


@config_app.command()
def example() -> None:
    """Print a commented TOML file with every key at its default."""
    from service.settings.reference import example_toml

    typer.echo(example_toml())


@config_app.command()
def check(
    file: Annotated[Path, typer.Argument(help="TOML file to check.")],
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Try an override as well.")
    ] = None,
) -> None:
    """Check a configuration without starting anything."""
    from service.settings.load import load_settings

    settings = load_settings(file, overrides or ())
    typer.echo(f"{file}: valid, for vehicle {settings.vehicle.name}")
