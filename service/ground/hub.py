"""Between the fleet, which is fed by Zenoh's threads, and the browsers, which live in the event loop."""

from __future__ import annotations

import asyncio
import threading
from typing import Final, Protocol

import structlog

from service.clock import Clock
from service.ground.documents import ZenohView, fleet_document
from service.ground.fleet import Fleet

log = structlog.get_logger()

MAX_BROWSERS: Final = 32
FLEET_PERIOD_S: Final = 0.25
_PEERS_PERIOD_S = 1.0


class PictureSource(Protocol):
    """The part of the listener that the hub steers."""

    def watch(self, vehicles: set[str]) -> None:
        """Receive the pictures of these vehicles and of no others."""

    def peer_count(self) -> int:
        """Peers and routers that are connected now."""


class Viewer(Protocol):
    """A browser as the hub sees it."""

    @property
    def vehicle(self) -> str | None:
        """Name of the vehicle it looks at."""

    @property
    def wants_pictures(self) -> bool:
        """Whether it shows pictures now."""

    def wake(self) -> None:
        """There may be something to send."""


class Hub:
    """Wakes browsers when there is news for them, and asks for the pictures that any of them shows.

    It keeps nothing for a browser: each takes what is newest when it has room for it.

    Args:
        fleet: what is known.
        source: where pictures come from.
        endpoints: of the Zenoh session, to be shown.
        clock: the viewer's.
    """

    def __init__(self, fleet: Fleet, source: PictureSource, endpoints: tuple[str, ...], clock: Clock) -> None:
        self.fleet = fleet
        self.clock = clock
        self._source = source
        self._endpoints = endpoints
        self._viewers: set[Viewer] = set()
        self._watched: frozenset[str] = frozenset()
        self._steering = asyncio.Lock()
        self._news: set[str] = set()
        self._news_lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._peers = -1
        self.fleet_number = 0
        """Grows with every new fleet document."""
        self.fleet_json = b""
        """All vehicles in short, as of `fleet_ns`."""
        self.fleet_ns = 0

    @property
    def peers(self) -> int:
        """Peers and routers that were connected at the last look."""
        return max(0, self._peers)

    @property
    def is_full(self) -> bool:
        """Whether there is no room for another browser."""
        return len(self._viewers) >= MAX_BROWSERS

    async def run(self) -> None:
        """Serve for ever."""
        self._loop = asyncio.get_running_loop()
        self.fleet.notify(self._hear)
        peers_due_s = 0.0
        while True:
            try:
                if self._loop.time() >= peers_due_s:
                    peers_due_s = self._loop.time() + _PEERS_PERIOD_S
                    await self._count_peers()
                if self._viewers:
                    self._tell_fleet()
            except Exception:
                # The next look may succeed; the page sees ages grow meanwhile.
                log.exception("ground station hub broke")
            await asyncio.sleep(FLEET_PERIOD_S)

    def add(self, viewer: Viewer) -> None:
        """A browser came."""
        self._viewers.add(viewer)

    async def remove(self, viewer: Viewer) -> None:
        """A browser went."""
        self._viewers.discard(viewer)
        await self.steer()

    async def steer(self) -> None:
        """Ask for the pictures of the vehicles that browsers look at now."""
        async with self._steering:
            watched = {
                viewer.vehicle
                for viewer in self._viewers
                if viewer.wants_pictures and viewer.vehicle is not None
            }
            self._watched = frozenset(
                viewer.vehicle for viewer in self._viewers if viewer.vehicle is not None
            )
            # Declaring speaks with the network.
            await asyncio.to_thread(self._source.watch, watched)

    def _tell_fleet(self) -> None:
        self.fleet_ns = self.clock.now_ns()
        zenoh = ZenohView(self.peers, self._endpoints)
        self.fleet_json = fleet_document(self.fleet, zenoh, self.fleet_ns)
        self.fleet_number += 1
        for viewer in self._viewers:
            viewer.wake()

    async def _count_peers(self) -> None:
        peers = await asyncio.to_thread(self._source.peer_count)
        if self._peers < 0 or (peers == 0) != (self._peers == 0):
            if peers:
                log.info("zenoh: connected", peers=peers)
            else:
                log.warning(
                    "zenoh: no vehicle or router is connected; tried again", at=", ".join(self._endpoints)
                )
        self._peers = peers

    def _hear(self, vehicle: str) -> None:
        """From any thread: a sample came. One call into the loop is under way at most."""
        if self._loop is None or vehicle not in self._watched:
            return
        with self._news_lock:
            is_first = not self._news
            self._news.add(vehicle)
        if is_first:
            try:
                self._loop.call_soon_threadsafe(self._spread)
            except RuntimeError:  # the loop is closed: the station is ending
                return

    def _spread(self) -> None:
        with self._news_lock:
            news, self._news = self._news, set()
        for viewer in self._viewers:
            if viewer.vehicle in news:
                viewer.wake()
