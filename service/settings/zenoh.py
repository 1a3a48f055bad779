"""`[zenoh]`: what leaves towards the ground station."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from service.publisher.keys import VEHICLE_NAME_PATTERN
from service.security.access import Access
from service.security.security import Certificates, Security
from service.settings.section import Section

_ENDPOINT = re.compile(r"^(tcp|udp|tls)/(\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]]+):(\d{1,5})([?#].*)?$")
_ENDPOINT_FORM = "tcp/HOST:PORT, tls/HOST:PORT or udp/HOST:PORT"


def check_endpoint(endpoint: str) -> str:
    """`endpoint` unchanged. Raises ValueError if it is not of Zenoh's form, `tcp/host:port`."""
    match = _ENDPOINT.fullmatch(endpoint)
    if match is None:
        raise ValueError(f"{endpoint!r} is no endpoint: {_ENDPOINT_FORM} is needed")
    if not 1 <= int(match[3]) <= 65535:
        raise ValueError(f"{endpoint!r} has port {match[3]}: 1 to 65535 is needed")
    return endpoint


def check_name(name: str) -> str:
    """`name` unchanged. Raises ValueError if no vehicle, viewer or router can be called so."""
    if not re.fullmatch(VEHICLE_NAME_PATTERN, name) or len(name) > 64:
        raise ValueError(f"{name!r} is no name: 1 to 64 letters, digits, `_` and `-` are needed")
    return name


Endpoint = Annotated[str, AfterValidator(check_endpoint)]
Name = Annotated[str, AfterValidator(check_name)]


class ZenohSettings(Section):
    """What leaves towards the ground station."""

    enabled: bool = Field(
        default=True, title="Publish", description="Off: nothing is published and no port is listened on."
    )
    listen: tuple[Endpoint, ...] = Field(
        default=("tcp/127.0.0.1:7447",),
        strict=False,
        title="Endpoints to listen on",
        description="Where ground stations connect, `tcp/HOST:PORT` or, with certificates, `tls/HOST:PORT`.",
    )
    connect: tuple[Endpoint, ...] = Field(
        default=(),
        strict=False,
        title="Endpoints to connect to",
        description="Ground stations or routers to reach; tried again for as long as they are away.",
    )
    profile: Literal["full", "thin", "scan-only"] = Field(
        default="full",
        title="What is sent",
        description="`full`: depth as lossless log-depth PNG, and the camera. `thin`: depth as H.264, for "
        "links below 1 Mbit/s and for eyes only, and the camera; it needs the extra `video`. `scan-only`: "
        "no pictures.",
    )
    max_kbit_per_s: float = Field(
        default=8000.0,
        ge=32.0,
        le=1_000_000.0,
        title="Most that pictures may take, kbit/s",
        description="Pictures get fewer and smaller so that they stay below it, and below what ground "
        "stations report as received. Viewers of other makers report nothing: for them this must be what the "
        "link takes.",
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

    ca: str = Field(
        default="",
        title="Certificate authority",
        description="PEM file of the authority that signed every certificate of the fleet; with "
        "`certificate` and `key` it switches TLS on: all endpoints are `tls/HOST:PORT` then.",
    )
    certificate: str = Field(
        default="", title="Certificate", description="PEM file with this program's own certificate."
    )
    key: str = Field(
        default="",
        title="Private key",
        description="PEM file with the certificate's key; only its owner may read it (mode 0600).",
    )
    user: str = Field(
        default="",
        title="User",
        description="Name given to whoever asks for a password, with `password_file`.",
    )
    password_file: str = Field(
        default="",
        title="Password file",
        description="File whose first line is the user's password (mode 0600).",
    )
    users_file: str = Field(
        default="",
        title="Users file",
        description="File of `name:password` lines (mode 0600): who connects here must know one of them.",
    )
    vehicles: tuple[Name, ...] = Field(
        default=(),
        strict=False,
        title="Vehicles of the fleet",
        description="Names that may publish, each below its own `uavdepth/<name>/` only. One name in "
        "`vehicles`, `viewers` or `routers` switches the access list on: others may do nothing then. "
        "The names are those of the certificates, and of `users_file` where there is one.",
    )
    viewers: tuple[Name, ...] = Field(
        default=(),
        strict=False,
        title="Viewers of the fleet",
        description="Names that may read everything, and write nothing but what they have received.",
    )
    routers: tuple[Name, ...] = Field(
        default=(),
        strict=False,
        title="Routers of the fleet",
        description="Names of routers, which hand on what they have checked themselves.",
    )

    @property
    def security(self) -> Security:
        """With what sessions show who they are, and what they let others do. The files are not read yet."""
        named = bool(self.vehicles or self.viewers or self.routers)
        return Security(
            certificates=Certificates(Path(self.ca), Path(self.certificate), Path(self.key))
            if self.ca
            else None,
            user=self.user or None,
            password_file=Path(self.password_file) if self.password_file else None,
            users_file=Path(self.users_file) if self.users_file else None,
            access=Access(self.vehicles, self.viewers, self.routers) if named else None,
        )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.depth_far_m <= self.depth_near_m:
            raise ValueError(
                f"depth_far_m: {self.depth_far_m:g} must be above depth_near_m {self.depth_near_m:g}"
            )
        if self.enabled and not self.listen and not self.connect:
            raise ValueError("listen and connect are both empty: nothing could be reached")
        given = {name: bool(getattr(self, name)) for name in ("ca", "certificate", "key")}
        if any(given.values()) and not all(given.values()):
            missing = ", ".join(name for name, is_given in given.items() if not is_given)
            raise ValueError(f"{missing}: missing; TLS needs ca, certificate and key")
        if bool(self.user) != bool(self.password_file):
            raise ValueError("user and password_file belong together: one of them is missing")
        names = (*self.vehicles, *self.viewers, *self.routers)
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{twice[0]!r} is named twice in vehicles, viewers and routers")
        return self
