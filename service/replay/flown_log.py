"""A simulated flight of ArduPilot: where it truly was, and what its autopilot said."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.errors import RecordError
from service.replay.footage import Packets
from service.replay.tlog_file import read_tlog
from uavdepth.attitude import Attitude

_MS_NS = 1_000_000
_REBOOT_MS = 2_000
"""`time_boot_ms` that goes back by more begins a new boot."""


@dataclass(frozen=True)
class Truth:
    """Where the vehicle is at a moment: NED metres from the log's home, and its attitude."""

    position_ned_m: NDArray[np.float64]
    attitude: Attitude


@dataclass(frozen=True, eq=False)
class _Boot:
    """From one start of the autopilot to the next.

    Args:
        offset_ns: host clock minus time since boot.
        begins_ns: host time of its first ATTITUDE.
        attitudes: (N, 4) seconds since boot, roll, pitch, yaw in radians, unwrapped.
        positions: (M, 4) seconds since boot, NED metres.
    """

    offset_ns: int
    begins_ns: int
    attitudes: NDArray[np.float64]
    positions: NDArray[np.float64]


class FlownLog:
    """`NAME.tlog` and the `.BIN` of each boot in it.

    Args:
        tlog: what arrived, with host times.
        logs: dataflash logs with SIM and SIM2 rows, one for each boot, in order.

    Raises:
        RecordError: files that cannot be read or do not belong together.
    """

    def __init__(self, tlog: Path, logs: Sequence[Path]) -> None:
        self.packets = read_tlog(tlog)
        """What arrived."""
        starts = _boots(self.packets)
        if len(starts) != len(logs):
            raise RecordError(f"{tlog}: {len(starts)} boots of the autopilot, {len(logs)} logs are given")
        self._boots = [
            _Boot(offset_ns, begins_ns, *_truth_rows(log))
            for (begins_ns, offset_ns), log in zip(starts, logs, strict=True)
        ]

    def truth(self, host_ns: int) -> Truth:
        """The truth at a moment of the host's clock; between rows linear, outside them the nearest row."""
        boot = next((b for b in reversed(self._boots) if b.begins_ns <= host_ns), self._boots[0])
        return _truth(boot, (host_ns - boot.offset_ns) / 1e9)

    def truth_at_boot(self, host_ns: int, boot_ms: int) -> Truth:
        """The truth at a stamp of the autopilot in a packet that arrived at `host_ns`."""
        boot = next((b for b in reversed(self._boots) if b.begins_ns <= host_ns), self._boots[0])
        return _truth(boot, boot_ms / 1000)


def decoded(packet: Packets) -> mavlink.MAVLink_message | None:
    """The message in a packet, or None where it cannot be decoded."""
    try:
        return mavlink.MAVLink(None).decode(bytearray(packet.data))
    except mavlink.MAVError:
        return None


def _boots(packets: Sequence[Packets]) -> list[tuple[int, int]]:
    """(host time of its first ATTITUDE, host clock minus boot time) for each boot."""
    found: list[tuple[int, int]] = []
    last_ms: int | None = None
    for packet in packets:
        if packet.data[7:10] != mavlink.MAVLINK_MSG_ID_ATTITUDE.to_bytes(3, "little"):
            continue
        message = decoded(packet)
        if message is None:
            continue
        offset_ns = packet.at_ns - message.time_boot_ms * _MS_NS
        if last_ms is None or message.time_boot_ms < last_ms - _REBOOT_MS:
            found.append((packet.at_ns, offset_ns))
        # Nothing arrives before it was stamped: the least delay seen is that of the loopback.
        found[-1] = (found[-1][0], min(found[-1][1], offset_ns))
        last_ms = message.time_boot_ms
    return found


def _truth_rows(log: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    from pymavlink import DFReader

    if not log.is_file():
        raise RecordError(f"{log}: no such file")
    attitudes: list[tuple[float, ...]] = []
    positions: list[tuple[float, ...]] = []
    try:
        # What it has to say of damaged rows it prints.
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            reader = DFReader.DFReader_binary(str(log))
            while (row := reader.recv_match(type=["SIM", "SIM2"])) is not None:
                at_s = row.TimeUS * 1e-6
                if row.get_type() == "SIM":
                    angles = (math.radians(angle) for angle in (row.Roll, row.Pitch, row.Yaw))
                    attitudes.append((at_s, *angles))
                else:
                    positions.append((at_s, row.PN, row.PE, row.PD))
    except Exception as error:  # pymavlink raises Exception itself, and all kinds of others
        raise RecordError(f"{log}: is no dataflash log that can be read ({error})") from error
    if min(len(attitudes), len(positions)) < 2:
        raise RecordError(f"{log}: holds no SIM and SIM2 rows: it is no log of a simulated flight")
    turned = np.array(attitudes)
    turned[:, 1:] = np.unwrap(turned[:, 1:], axis=0)
    return turned, np.array(positions)


def _truth(boot: _Boot, boot_s: float) -> Truth:
    angles = [float(np.interp(boot_s, boot.attitudes[:, 0], boot.attitudes[:, k])) for k in (1, 2, 3)]
    place = [float(np.interp(boot_s, boot.positions[:, 0], boot.positions[:, k])) for k in (1, 2, 3)]
    roll, pitch, yaw = angles
    return Truth(np.array(place), Attitude(roll, pitch, math.remainder(yaw, 2 * math.pi)))
