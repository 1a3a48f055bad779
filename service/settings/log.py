"""`[log]`: what the service writes to standard error."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.settings.section import Section


class LogSettings(Section):
    """What the service writes to standard error."""

    level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", title="Least level", description="Messages below it are not written."
    )
    format: Literal["console", "json"] = Field(
        default="console",
        title="Form of a line",
        description="`console` for people, `json` for machines: one object a line.",
    )
