"""What scans and pictures say: versioned JSON, the same models for writing and reading."""

from __future__ import annotations

from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from service.errors import PublisherError
from uavdepth.camera import CameraModel
from uavdepth.scan.obstacle_scan import (
    FIRST_BEARING_DEG,
    SECTOR_COUNT,
    SECTOR_WIDTH_DEG,
    ObstacleScan,
    SectorState,
    sector_bearings_deg,
)

WIRE_VERSION: Final = 1
"""Grows when a reader of the older version would misunderstand a sample."""

MAX_SAMPLE_BYTES: Final = 65_536
"""No scan, header or status is near it: larger text from the network is not even parsed."""

_MAX_WORDS = 500
_MAX_SIDE = 16_384
_MAX_AGE_MS = 1e9
_MAX_DISTANCE_M = 10_000.0


def _shown(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text[:_MAX_WORDS])


Words = Annotated[str, AfterValidator(_shown)]
"""Text for people: cut at both ends of the way, so that none is refused, none floods a viewer, and none tells
a terminal what to do."""

Nanoseconds = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Count = Annotated[int, Field(ge=0, lt=2**63)]


class WireError(PublisherError):
    """A sample that is not what its key says."""


class Message(BaseModel):
    """A sample or its attachment."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    version: Literal[1] = WIRE_VERSION

    def encode(self) -> bytes:
        """UTF-8 JSON, compact."""
        return self.model_dump_json().encode()

    @classmethod
    def decode(cls, data: bytes) -> Self:
        """Read what `encode` wrote, from a peer that need not be trusted.

        Raises:
            WireError: anything else, another version included.
        """
        if len(data) > MAX_SAMPLE_BYTES:
            raise WireError(f"{cls.__name__} of {len(data)} bytes: at most {MAX_SAMPLE_BYTES} are read")
        try:
            return cls.model_validate_json(data)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(str(part) for part in first["loc"]) or "the text"
            raise WireError(f"{cls.__name__}: {where}: {first['msg']}") from error


class Stamp(Message):
    """When a sample's picture was taken.

    Args:
        index: running number of the frame.
        captured_ns: capture time on the vehicle's monotonic clock, nanoseconds.
        age_ms: time from capture to publishing, milliseconds.
    """

    index: Count
    captured_ns: Nanoseconds
    age_ms: float = Field(ge=0.0, le=_MAX_AGE_MS)


class Intrinsics(BaseModel):
    """The camera that a picture's pixels belong to; names and units as in `CameraModel`."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    width: int = Field(ge=1, le=_MAX_SIDE)
    height: int = Field(ge=1, le=_MAX_SIDE)
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = Field(default=(), max_length=16)

    @classmethod
    def of(cls, camera: CameraModel) -> Intrinsics:
        """The wire's form of `camera`."""
        return cls(
            width=camera.width,
            height=camera.height,
            fx=camera.fx,
            fy=camera.fy,
            cx=camera.cx,
            cy=camera.cy,
            distortion=camera.distortion,
        )


class DepthHeader(Stamp):
    """Attachment of a depth sample, whose payload is the 8-bit logarithmic PNG.

    Args:
        encoding: the codec, `uavdepth.depth.codec`.
        near_m, far_m: ends of the logarithmic scale in metres.
        camera: the depth picture's camera.
        scale_factor: network units to metres.
        scale_relative_sigma: its relative standard deviation.
    """

    encoding: Literal["log8-png"] = "log8-png"
    near_m: float = Field(gt=0.0)
    far_m: float = Field(gt=0.0)
    camera: Intrinsics
    scale_factor: float | None = None
    scale_relative_sigma: float | None = None


class CameraHeader(Stamp):
    """Attachment of a camera sample, whose payload is a JPEG."""

    camera: Intrinsics


class ScanSample(Stamp):
    """One scan round the nose.

    Args:
        trusted: whether these distances went to the autopilot; if not, every element is unknown.
        trouble: why not, in words.
        min_distance_m, max_distance_m: what the scan covers.
        first_bearing_deg, step_deg: bearing of the first element, clockwise from the nose, and the step.
        state: one digit an element: 0 unknown, 1 clear, 2 obstacle.
        distance_cm: one whole number an element, -1 where the state is not obstacle.
    """

    trusted: bool
    trouble: Words | None = None
    min_distance_m: float = Field(ge=0.0, le=_MAX_DISTANCE_M)
    max_distance_m: float = Field(gt=0.0, le=_MAX_DISTANCE_M)
    first_bearing_deg: float = Field(default=FIRST_BEARING_DEG, ge=-360.0, le=360.0)
    step_deg: float = Field(default=SECTOR_WIDTH_DEG, gt=0.0, le=360.0)
    state: str = Field(pattern=rf"^[012]{{{SECTOR_COUNT}}}$")
    distance_cm: tuple[Annotated[int, Field(ge=-1, le=10_000_000)], ...] = Field(
        min_length=SECTOR_COUNT, max_length=SECTOR_COUNT
    )

    @model_validator(mode="after")
    def _obstacles_have_distances(self) -> Self:
        for state, distance in zip(self.state, self.distance_cm, strict=True):
            if (state == "2") != (distance >= 0):
                raise ValueError(f"state {state} with distance {distance} cm")
        return self

    @classmethod
    def of(
        cls, scan: ObstacleScan, *, index: int, captured_ns: int, age_ms: float, trouble: str | None
    ) -> ScanSample:
        """The wire's form of a scan; `trouble` is None if it is trusted."""
        # Floor, as a shown distance must never exceed the true one.
        centimetres = np.where(
            scan.state == SectorState.OBSTACLE, np.floor(np.nan_to_num(scan.distance_m, nan=0.0) * 100), -1
        ).astype(int)
        return cls(
            index=index,
            captured_ns=captured_ns,
            age_ms=age_ms,
            trusted=trouble is None,
            trouble=trouble,
            min_distance_m=scan.min_distance_m,
            max_distance_m=scan.max_distance_m,
            state="".join(str(int(state)) for state in scan.state),
            distance_cm=tuple(centimetres.tolist()),
        )

    @property
    def scan(self) -> ObstacleScan:
        """The library's form."""
        distance_cm = np.array(self.distance_cm, np.float32)
        return ObstacleScan(
            np.where(distance_cm >= 0, distance_cm / 100, np.nan).astype(np.float32),
            np.array([int(digit) for digit in self.state], np.uint8),
            sector_bearings_deg(),
            self.min_distance_m,
            self.max_distance_m,
        )
