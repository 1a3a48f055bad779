"""`[zenoh]`: what leaves towards the ground station."""

from __future__ import annotations

import re
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from service.settings.section import Section

_ENDPOINT = re.compile(r"^(tcp|udp)/(\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]]+):(\d{1,5})([?#].*)?$")
_ENDPOINT_FORM = "tcp/HOST:PORT or udp/HOST:PORT"


def check_endpoint(endpoint: str) -> str:
    """`endpoint` unchanged. Raises ValueError if it is not of Zenoh's form, `tcp/host:port`."""
    match = _ENDPOINT.match(endpoint)
    if match is None:
        raise ValueError(f"{endpoint!r} is no endpoint: {_ENDPOINT_FORM} is needed")
    if not 1 <= int(match[3]) <= 65535:
        raise ValueError(f"{endpoint!r} has port {match[3]}: 1 to 65535 is needed")
    return endpoint


Endpoint = Annotated[str, AfterValidator(check_endpoint)]


class ZenohSettings(Section):
    """What leaves towards the ground station."""

    enabled: bool = Field(
        default=True, title="Publish", description="Off: nothing is published and no port is listened on."
    )
    listen: tuple[Endpoint, ...] = Field(
        default=("tcp/127.0.0.1:7447",),
        strict=False,
        title="Endpoints to listen on",
        description="Where ground stations connect. Append `#so_sndbuf=16384` on slow radios.",
    )
    connect: tuple[Endpoint, ...] = Field(
        default=(),
        strict=False,
        title="Endpoints to connect to",
        description="Ground stations or routers to reach; tried again for as long as they are away.",
    )
    depth_rate_hz: float = Field(
        default=10.0,
        ge=0.1,
        le=60.0,
        title="Depth pictures per second",
        description="Upper limit of the rate of `uavdepth/<vehicle>/depth`.",
    )
    depth_near_m: float = Field(
        default=0.5,
        ge=0.05,
        le=50.0,
        title="Nearest depth of the picture, metres",
        description="First value of the 8-bit logarithmic depth picture.",
    )
    depth_far_m: float = Field(
        default=60.0,
        ge=1.0,
        le=1000.0,
        title="Farthest depth of the picture, metres",
        description="Last value of the 8-bit logarithmic depth picture.",
    )
    scan_rate_hz: float = Field(
        default=15.0,
        ge=0.1,
        le=60.0,
        title="Scans per second",
        description="Upper limit of the rate of `uavdepth/<vehicle>/scan`.",
    )
    status_rate_hz: float = Field(
        default=2.0,
        ge=0.1,
        le=20.0,
        title="Status messages per second",
        description="Rate of `uavdepth/<vehicle>/status`.",
    )
    camera: bool = Field(
        default=True,
        title="Publish the camera picture",
        description="Off: no pictures on `uavdepth/<vehicle>/camera`.",
    )
    camera_rate_hz: float = Field(
        default=5.0,
        ge=0.1,
        le=60.0,
        title="Camera pictures per second",
        description="Upper limit of the rate of `uavdepth/<vehicle>/camera`.",
    )
    camera_quality: int = Field(
        default=75,
        ge=1,
        le=100,
        title="JPEG quality of the camera picture",
        description="1 (smallest) to 100 (best).",
    )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.depth_far_m <= self.depth_near_m:
            raise ValueError(
                f"depth_far_m: {self.depth_far_m:g} must be above depth_near_m {self.depth_near_m:g}"
            )
        if self.enabled and not self.listen and not self.connect:
            raise ValueError("listen and connect are both empty: nothing could be reached")
        return self
