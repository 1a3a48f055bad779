"""What became of one picture, exactly, as JSON: for replays, goldens and plots."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from service.errors import RecordError
from service.perception_result import PerceptionResult
from service.scale_status import ScaleStatus
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg

_MAX_NOTE_BYTES = 65_536
"""Many times what a note takes: a longer one is not even parsed."""

Nanoseconds = Annotated[int, Field(ge=-(2**62), lt=2**62)]
Metres = Annotated[float, Field(ge=0.0, le=10_000.0)]
Vector = tuple[float, float, float]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)


class ScanNote(_Part):
    """A scan: `distance_m` is None where no obstacle is, `state` is `SectorState`; from -155 degrees on."""

    distance_m: Annotated[tuple[Metres | None, ...], Field(min_length=SECTOR_COUNT, max_length=SECTOR_COUNT)]
    state: Annotated[
        tuple[Annotated[int, Field(ge=0, le=2)], ...], Field(min_length=SECTOR_COUNT, max_length=SECTOR_COUNT)
    ]
    min_distance_m: Metres
    max_distance_m: Metres
    nearest_m: Metres | None = None

    @classmethod
    def of(cls, scan: ObstacleScan) -> Self:
        """The note of a scan."""
        return cls(
            distance_m=tuple(None if np.isnan(value) else float(value) for value in scan.distance_m),
            state=tuple(int(value) for value in scan.state),
            min_distance_m=scan.min_distance_m,
            max_distance_m=scan.max_distance_m,
            nearest_m=scan.nearest_m,
        )

    def scan(self) -> ObstacleScan:
        """The scan again."""
        distance_m = np.array([np.nan if d is None else d for d in self.distance_m], np.float32)
        state = np.array(self.state, np.uint8)
        distance_m[state != SectorState.OBSTACLE] = np.nan
        return ObstacleScan(
            distance_m, state, sector_bearings_deg(), self.min_distance_m, self.max_distance_m
        )


class TelemetryNote(_Part):
    """The vehicle at the picture's capture time; see `Telemetry`."""

    roll_rad: float | None = None
    pitch_rad: float | None = None
    yaw_rad: float | None = None
    height_m: float | None = None
    position_ned_m: Vector | None = None
    velocity_ned_mps: Vector | None = None
    armed: bool | None = None
    mode: str | None = None

    @classmethod
    def of(cls, telemetry: Telemetry) -> Self:
        """The note of a vehicle's state."""
        attitude = telemetry.attitude
        return cls(
            roll_rad=None if attitude is None else attitude.roll_rad,
            pitch_rad=None if attitude is None else attitude.pitch_rad,
            yaw_rad=None if attitude is None else attitude.yaw_rad,
            height_m=telemetry.height_m,
            position_ned_m=telemetry.position_ned_m,
            velocity_ned_mps=telemetry.velocity_ned_mps,
            armed=telemetry.armed,
            mode=telemetry.mode,
        )

    def telemetry(self, at_ns: int) -> Telemetry:
        """The vehicle's state again."""
        attitude = None
        if self.roll_rad is not None and self.pitch_rad is not None and self.yaw_rad is not None:
            attitude = Attitude(self.roll_rad, self.pitch_rad, self.yaw_rad)
        return Telemetry(
            at_ns=at_ns,
            attitude=attitude,
            height_m=self.height_m,
            position_ned_m=self.position_ned_m,
            velocity_ned_mps=self.velocity_ned_mps,
            armed=self.armed,
            mode=self.mode,
        )


class ScaleNote(_Part):
    """The metric scale; see `ScaleStatus`."""

    factor: float
    relative_sigma: float
    age_s: float


class PerceptionNote(_Part):
    """What became of one picture.

    Args:
        index: running number of the picture.
        captured_ns: its capture time on the service's clock.
        begun_ns, done_ns: when it was measured: what was known of the vehicle by then decided the scan.
        trouble, detail: why the scan was not trusted.
        telemetry, scale, scan: what was used and found; no scan in records of pictures alone.
    """

    index: Annotated[int, Field(ge=0, lt=2**53)]
    captured_ns: Nanoseconds
    begun_ns: Nanoseconds
    done_ns: Nanoseconds
    trouble: str | None = None
    detail: str = ""
    telemetry: TelemetryNote = TelemetryNote()
    scale: ScaleNote | None = None
    scan: ScanNote | None = None

    @classmethod
    def of(cls, result: PerceptionResult, begun_ns: int, done_ns: int) -> Self:
        """The note of a result."""
        return cls(
            index=result.frame.index,
            captured_ns=result.captured_ns,
            begun_ns=begun_ns,
            done_ns=done_ns,
            trouble=None if result.trouble is None else result.trouble.value,
            detail=result.detail[:500],
            telemetry=TelemetryNote.of(result.telemetry),
            scale=_scale_note(result.scale),
            scan=ScanNote.of(result.scan),
        )

    def encode(self) -> bytes:
        """UTF-8 JSON, compact."""
        return self.model_dump_json().encode()

    @classmethod
    def decode(cls, data: bytes) -> Self:
        """Read what `encode` wrote.

        Raises:
            RecordError: anything else.
        """
        if len(data) > _MAX_NOTE_BYTES:
            raise RecordError(f"a perception note of {len(data)} bytes: at most {_MAX_NOTE_BYTES} are read")
        try:
            return cls.model_validate_json(data)
        except ValidationError as error:
            problem = error.errors()[0]
            where = ".".join(str(part) for part in problem["loc"]) or "note"
            raise RecordError(f"a perception note: {where}: {problem['msg']}") from error


def _scale_note(scale: ScaleStatus | None) -> ScaleNote | None:
    if scale is None or not all(map(np.isfinite, (scale.factor, scale.relative_sigma, scale.age_s))):
        return None
    return ScaleNote(factor=scale.factor, relative_sigma=scale.relative_sigma, age_s=scale.age_s)
