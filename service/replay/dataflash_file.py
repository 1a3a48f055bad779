"""ArduPilot's dataflash logs (.BIN) as telemetry."""

from __future__ import annotations

import io
import math
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.errors import RecordError
from service.replay.footage import Packets
from service.replay.telemetry_writer import TelemetryWriter

_HEARTBEAT_US = 1_000_000
_DOWNWARD = 25
_MAGIC = b"\xa3\x95"


def read_dataflash(path: Path) -> list[Packets]:
    """ATT, XKF1, RFND, MODE and ARM rows as ATTITUDE, LOCAL_POSITION_NED, DISTANCE_SENSOR, HEARTBEAT.

    Times are nanoseconds since boot.

    Raises:
        RecordError: it cannot be read, is no dataflash log, or holds no attitude.
    """
    from pymavlink import DFReader

    try:
        with path.open("rb") as file:
            head = file.read(2)
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from error
    if head != _MAGIC:
        raise RecordError(f"{path}: is no dataflash log (it begins with {head!r}, a log with {_MAGIC!r})")
    rows = _Rows()
    try:
        # What it has to say of damaged rows it prints.
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            log = DFReader.DFReader_binary(str(path))
            while (row := log.recv_match(type=["ATT", "XKF1", "RFND", "MODE", "ARM"])) is not None:
                rows.take(row)
    except Exception as error:  # pymavlink raises Exception itself, and all kinds of others
        if not rows.attitudes:
            raise RecordError(f"{path}: is no dataflash log that can be read ({error})") from error
    if not rows.attitudes:
        raise RecordError(f"{path}: holds no ATT rows: log attitude (LOG_BITMASK) to replay with it")
    return rows.writer.packets()


class _Rows:
    """Turns rows into packets."""

    def __init__(self) -> None:
        self.writer = TelemetryWriter(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
        self.attitudes = 0
        self._mode, self._armed = 0, False
        self._heartbeat_due_us = 0

    def take(self, row: Any) -> None:
        kind, at_us = row.get_type(), int(row.TimeUS)
        if kind == "ATT":
            angles = (math.radians(row.Roll), math.radians(row.Pitch), math.radians(_wrapped(row.Yaw)))
            self.writer.attitude(at_us, angles)
            self.attitudes += 1
        elif kind == "XKF1" and getattr(row, "C", 0) == 0:
            self.writer.position(at_us, (row.PN, row.PE, row.PD), (row.VN, row.VE, row.VD))
        elif kind == "RFND" and row.Orient == _DOWNWARD:
            self.writer.height(at_us, float(row.Dist), valid=row.Stat == 4)
        elif kind == "MODE":
            self._mode = int(row.ModeNum)
        elif kind == "ARM":
            self._armed = bool(row.ArmState)
        if at_us >= self._heartbeat_due_us:
            self._heartbeat_due_us = at_us + _HEARTBEAT_US
            self.writer.heartbeat(at_us, self._mode, armed=self._armed)


def _wrapped(degrees: float) -> float:
    return (degrees + 180.0) % 360.0 - 180.0
