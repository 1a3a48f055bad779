"""`uavdepth keys`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from service.security.fleet import FleetFolder, Member

keys_app = typer.Typer(no_args_is_help=True, help="Certificates, passwords and access lists of a fleet.")

_Folder = Annotated[Path, typer.Argument(metavar="DIR", help="The fleet's folder; keep it off the vehicles.")]
_Vehicles = Annotated[
    list[str] | None,
    typer.Option(
        "--vehicle",
        metavar="NAME[=HOST,...]",
        help="A vehicle; with hosts where viewers connect to it directly. May be given many times.",
    ),
]
_Viewers = Annotated[
    list[str] | None,
    typer.Option("--viewer", metavar="NAME", help="A ground station. May be given many times."),
]
_Routers = Annotated[
    list[str] | None,
    typer.Option(
        "--router",
        metavar="[NAME=]HOST[,...]",
        help="A router, and all names and addresses at which it is reached. May be given many times.",
    ),
]
_Days = Annotated[int, typer.Option(min=1, max=3650, help="How long certificates hold, days.")]
_Target = Annotated[
    Path | None,
    typer.Option(
        help="Folder that the configurations name, e.g. /etc/uavdepth; without it, where the files are now."
    ),
]


@keys_app.command("new")
def new(
    folder: _Folder,
    vehicle: _Vehicles = None,
    viewer: _Viewers = None,
    router: _Routers = None,
    days: _Days = 825,
    passwords: Annotated[bool, typer.Option(help="Users and passwords on top of certificates.")] = True,
    target: _Target = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a fleet: its certificates are worthless then.")
    ] = False,
) -> None:
    """Make a fleet: an authority, and for each member a key, a certificate and a configuration."""
    from service.security.fleet import FleetFolder

    members = _members(vehicle, viewer, router)
    fleet = FleetFolder(folder, members, days, passwords=passwords, target=target)
    fleet.make(force=force)
    _tell(folder, fleet)


@keys_app.command("add")
def add(
    folder: _Folder,
    vehicle: _Vehicles = None,
    viewer: _Viewers = None,
    router: _Routers = None,
    days: _Days = 825,
    target: _Target = None,
) -> None:
    """Add members to a fleet; the others keep their keys and get a new configuration."""
    from service.security.fleet import FleetFolder, read_fleet

    known, passwords = read_fleet(folder)
    fleet = FleetFolder(
        folder, (*known, *_members(vehicle, viewer, router)), days, passwords=passwords, target=target
    )
    fleet.extend()
    _tell(folder, fleet)


def _members(
    vehicles: list[str] | None, viewers: list[str] | None, routers: list[str] | None
) -> tuple[Member, ...]:
    from service.security.fleet import Member

    return (
        *(Member.parse(text, "router") for text in routers or ()),
        *(Member.parse(text, "vehicle") for text in vehicles or ()),
        *(Member.parse(text, "viewer") for text in viewers or ()),
    )


_USES = {
    "router": "uavdepth router --config {file}",
    "vehicle": "its sections go into the vehicle's configuration: uavdepth run --config ...",
    "viewer": "uavdepth watch --config {file}, uavdepth ground --config {file}",
}


def _tell(folder: Path, fleet: FleetFolder) -> None:
    typer.echo(f"{folder / 'ca'}: the authority. Its key signs new members: keep it off every vehicle.")
    for member in fleet.members:
        use = _USES[member.role].format(file="zenoh.toml")
        typer.echo(f"{folder / member.name}: copy to {member.role} {member.name}. {use}")
    typer.echo("Keys and passwords have mode 0600: keep it (cp -p, scp -p, rsync -a).")
