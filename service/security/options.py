"""What commands that are no vehicle (watch, ground, router) share: endpoints and security from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.settings.zenoh import ZenohSettings

SecurityConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config",
        "-c",
        help="TOML file whose \\[zenoh] section says where to connect and with which certificates; "
        "`uavdepth keys new` writes one for each viewer and router.",
    ),
]


def load_zenoh_settings(path: Path | None, overrides: tuple[str, ...] = ()) -> ZenohSettings:
    """The `[zenoh]` section of a configuration file, which need not hold any other section.

    Args:
        path: TOML file; None starts from the defaults.
        overrides: `zenoh.key=value`.

    Raises:
        ConfigError: a file that cannot be read, an unknown key or a wrong value.
        SecurityError: certificates, keys or passwords that cannot be used.
    """
    from service.settings.load import load_settings

    settings = load_settings(path, overrides, needs_camera=False).zenoh
    settings.security.check(settings.listen, settings.connect)
    return settings
