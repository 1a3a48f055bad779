"""The configuration: one TOML file, one strict model a section, one root."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from service.settings.autopilot import AutopilotSettings
from service.settings.camera import CameraSettings
from service.settings.extra_camera import ExtraCameraSettings
from service.settings.log import LogSettings
from service.settings.model import ModelSettings
from service.settings.motion import MotionSettings
from service.settings.mount import MountSettings
from service.settings.record import RecordSettings
from service.settings.scale import ScaleSettings
from service.settings.scan import ScanSettings
from service.settings.section import Section
from service.settings.vehicle import VehicleSettings
from service.settings.zenoh import ZenohSettings

__all__ = [
    "AutopilotSettings",
    "CameraSettings",
    "ExtraCameraSettings",
    "LogSettings",
    "ModelSettings",
    "MotionSettings",
    "MountSettings",
    "RecordSettings",
    "ScaleSettings",
    "ScanSettings",
    "Settings",
    "VehicleSettings",
    "ZenohSettings",
]


class Settings(Section):
    """The whole configuration. Only `[camera] source` has no default."""

    camera: CameraSettings
    extra_camera: tuple[ExtraCameraSettings, ...] = Field(default=(), strict=False, max_length=8)
    vehicle: VehicleSettings = Field(default_factory=VehicleSettings)
    mount: MountSettings = Field(default_factory=MountSettings)
    model: ModelSettings = Field(default_factory=ModelSettings)
    motion: MotionSettings = Field(default_factory=MotionSettings)
    scale: ScaleSettings = Field(default_factory=ScaleSettings)
    scan: ScanSettings = Field(default_factory=ScanSettings)
    autopilot: AutopilotSettings = Field(default_factory=AutopilotSettings)
    zenoh: ZenohSettings = Field(default_factory=ZenohSettings)
    record: RecordSettings = Field(default_factory=RecordSettings)
    log: LogSettings = Field(default_factory=LogSettings)

    @model_validator(mode="after")
    def _names_each_camera_once(self) -> Self:
        names = [extra.name for extra in self.extra_camera]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two of [[extra_camera]] have the name {twice}: give each its own")
        return self
