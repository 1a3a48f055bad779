"""A slow radio between two programs: a TCP relay on loopback with a bit rate, a queue and a delay."""

from __future__ import annotations

import asyncio
import socket
import threading
from dataclasses import dataclass
from types import TracebackType
from typing import Self

_PACKET_BYTES = 1400
_SOCKET_BUFFER_BYTES = 8192
"""The relay's own sockets must hold little, or they would be the queue."""


@dataclass(frozen=True)
class LinkSettings:
    """What the radio is like, each way.

    Args:
        bits_per_s: its rate.
        queue_bytes: what it holds before it takes no more: one queue for all connections.
        delay_s: from its far end on.
    """

    bits_per_s: float
    queue_bytes: int = 65_536
    delay_s: float = 0.01


class _Way:
    """One direction of the radio, shared by all connections."""

    def __init__(self, settings: LinkSettings) -> None:
        self._settings = settings
        self._free_s = 0.0
        self.largest_queue_s = 0.0
        self.carried_bytes = 0

    async def room(self) -> None:
        """Wait until the queue has room for a packet."""
        loop = asyncio.get_running_loop()
        longest_s = 8 * self._settings.queue_bytes / self._settings.bits_per_s
        while (waiting_s := self._free_s - loop.time()) > longest_s:
            await asyncio.sleep(waiting_s - longest_s)

    def take(self, size_bytes: int) -> float:
        """When a packet that comes now arrives at the far end."""
        now_s = asyncio.get_running_loop().time()
        self._free_s = max(now_s, self._free_s) + 8 * size_bytes / self._settings.bits_per_s
        self.largest_queue_s = max(self.largest_queue_s, self._free_s - now_s)
        self.carried_bytes += size_bytes
        return self._free_s + self._settings.delay_s


class SlowLink:
    """A relay to a port of the loopback. A context manager.

    Args:
        port: where the vehicle listens.
        settings: what the radio is like.
    """

    def __init__(self, port: int, settings: LinkSettings) -> None:
        self._target = port
        self._settings = settings
        self._to_ground, self._to_vehicle = _Way(settings), _Way(settings)
        self._loop: asyncio.AbstractEventLoop
        self._stop: asyncio.Event
        self._up = threading.Event()
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SOCKET_BUFFER_BYTES)
        self._socket.bind(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]
        """Where to connect."""
        self._thread = threading.Thread(target=self._run, name="slow-link", daemon=True)

    @property
    def largest_queue_s(self) -> float:
        """Longest that a byte for the ground waited in the radio so far."""
        return self._to_ground.largest_queue_s

    @property
    def carried_bytes(self) -> int:
        """Bytes for the ground so far."""
        return self._to_ground.carried_bytes

    def forget_queue(self) -> None:
        """Start to measure the longest wait anew."""
        self._to_ground.largest_queue_s = 0.0

    def __enter__(self) -> Self:
        self._thread.start()
        self._up.wait()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    def _run(self) -> None:
        asyncio.run(self._relay())

    async def _relay(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_server(self._serve, sock=self._socket, limit=_PACKET_BYTES)
        self._up.set()
        await self._stop.wait()
        server.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        upstream = socket.socket()
        upstream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SOCKET_BUFFER_BYTES)
        upstream.setblocking(False)
        try:
            await asyncio.get_running_loop().sock_connect(upstream, ("127.0.0.1", self._target))
            far_reader, far_writer = await asyncio.open_connection(sock=upstream, limit=_PACKET_BYTES)
        except OSError:
            upstream.close()
            writer.close()
            return
        try:
            await asyncio.gather(
                self._pump(far_reader, writer, self._to_ground),
                self._pump(reader, far_writer, self._to_vehicle),
            )
        except (OSError, asyncio.CancelledError):
            # A connection that ends, or the radio that is switched off.
            return
        finally:
            writer.close()
            far_writer.close()

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, way: _Way) -> None:
        arrivals: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()
        deliver = asyncio.create_task(_deliver(arrivals, writer))
        try:
            while True:
                await way.room()
                data = await reader.read(_PACKET_BYTES)
                if not data:
                    break
                arrivals.put_nowait((way.take(len(data)), data))
            # What is still on the air arrives before the end does.
            arrivals.put_nowait((0.0, b""))
            await deliver
        finally:
            deliver.cancel()
            writer.close()


async def _deliver(arrivals: asyncio.Queue[tuple[float, bytes]], writer: asyncio.StreamWriter) -> None:
    loop = asyncio.get_running_loop()
    while True:
        at_s, data = await arrivals.get()
        if not data:
            return
        await asyncio.sleep(at_s - loop.time())
        writer.write(data)
        await writer.drain()
