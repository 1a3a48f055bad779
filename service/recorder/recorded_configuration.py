"""What a record holds of the configuration."""

from __future__ import annotations

from typing import Any

from service.settings import Settings

_RECORDED_SECTIONS = (
    "vehicle",
    "camera",
    "extra_camera",
    "mount",
    "model",
    "scan",
    "motion",
    "scale",
    "autopilot",
)
"""What decides what a picture becomes. Never `[zenoh]`: it may hold a password."""


def recorded_configuration(settings: Settings) -> dict[str, Any]:
    """The sections that a replay needs, without passwords and key files."""
    from service.cameras.rtsp import without_password

    dumped = settings.model_dump(mode="json")
    kept = {name: dumped[name] for name in _RECORDED_SECTIONS if name in dumped}
    for one in (kept, *kept["extra_camera"]):
        one["camera"]["source"] = without_password(one["camera"]["source"])
    kept["autopilot"].pop("signing_key_file", None)
    return kept
