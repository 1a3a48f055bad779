"""MAVLink over a serial port."""

from __future__ import annotations

import os
from collections.abc import Hashable

import serial

from service.autopilot.stalled_write import StalledWrite
from service.clock import Clock

_READ_BYTES = 4096


class SerialTransport:
    """A port at 8N1 without flow control, held exclusively."""

    def __init__(self, device: str, baud: int, clock: Clock) -> None:
        try:
            self._port = serial.Serial(device, baud, timeout=0, exclusive=True)
        except ValueError as error:  # a rate that the driver does not have
            raise OSError(f"{device} does not take {baud} baud: {error}") from error
        self._out = StalledWrite(self._write, clock)

    def fileno(self) -> int:
        return int(self._port.fileno())

    def receive(self) -> list[tuple[bytes, Hashable]]:
        data = bytes(self._port.read(_READ_BYTES))
        return [(data, None)] if data else []

    def send(self, frame: bytes, destination: Hashable) -> None:
        del destination
        self._out.push(frame)

    def flush(self) -> None:
        self._out.push()

    @property
    def pending_bytes(self) -> int:
        return len(self._out)

    def close(self) -> None:
        self._port.close()

    def _write(self, data: bytes) -> int:
        return os.write(self._port.fileno(), data)  # pyserial's own write spins when the port is full
