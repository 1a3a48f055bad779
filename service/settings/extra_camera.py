"""`[[extra_camera]]`: further cameras whose sight is added to that of `[camera]`."""

from __future__ import annotations

from pydantic import Field

from service.settings.camera import CameraSettings
from service.settings.mount import MountSettings
from service.settings.section import Section


class ExtraCameraSettings(Section):
    """One more camera; `[extra_camera.camera]` is like `[camera]`, `[extra_camera.mount]` like `[mount]`."""

    name: str = Field(
        min_length=1,
        max_length=16,
        pattern="^[A-Za-z0-9_-]+$",
        title="Name",
        description="Read by the pilot when this camera fails.",
    )
    camera: CameraSettings = Field(
        title="Camera", description="The keys of `[camera]`, below `[extra_camera.camera]`."
    )
    mount: MountSettings = Field(
        default_factory=MountSettings,
        title="Mount",
        description="The keys of `[mount]`, below `[extra_camera.mount]`.",
    )
