"""One browser: it gets what is newest whenever it has room, and nothing is kept for it meanwhile."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Final

from service.ground.documents import detail_document, history_document
from service.ground.errors import GroundError
from service.ground.frames import FrameKind, encode_frame
from service.ground.hub import FLEET_PERIOD_S, Hub
from service.publisher import keys

WINDOW: Final = 2
"""Frames on their way that the browser has not shown yet. With one it would wait a round
trip for each; with many a slow one would show old ones first."""

STALL_S: Final = 20.0
"""A browser that shows nothing for so long is let go; its page comes back by itself."""

MAX_MESSAGE_BYTES: Final = 1024

_PICTURES = {FrameKind.CAMERA: keys.CAMERA, FrameKind.DEPTH: keys.DEPTH}
_ORDER = (FrameKind.HISTORY, FrameKind.DETAIL, FrameKind.FLEET, FrameKind.CAMERA, FrameKind.DEPTH)
_MAX_NAME = 64
_HISTORY_TICKS = round(5.0 / FLEET_PERIOD_S)


class BrowserStalledError(GroundError):
    """A browser that takes nothing any more."""


class BadMessageError(GroundError):
    """A message from a browser that no page of ours sends."""


class Browser:
    """What one browser looks at, and what it was sent last.

    Args:
        hub: where the news come from.
        send: sends one binary frame; may wait.
        stall_s: longest time without a sign that a frame was shown.
    """

    def __init__(self, hub: Hub, send: Callable[[bytes], Awaitable[None]], stall_s: float = STALL_S) -> None:
        self._hub = hub
        self._send = send
        self._stall_s = stall_s
        self._changed = asyncio.Event()
        self._room = asyncio.Semaphore(WINDOW)
        self._unshown = 0
        self._selection = 0
        self._sent: dict[FrameKind, int] = {}
        self.vehicle: str | None = None
        self.wants_pictures = True

    def wake(self) -> None:
        """There may be something to send."""
        self._changed.set()

    async def hear(self, text: str) -> None:
        """Take a message of the page: `{"shown": 1}` or `{"watch": NAME, "selection": N, "pictures": true}`.

        Raises:
            BadMessageError: anything else.
        """
        try:
            message = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise BadMessageError(f"{text[:60]!r} is no JSON") from error
        if not isinstance(message, dict):
            raise BadMessageError(f"{text[:60]!r} is no object")
        if "shown" in message:
            self._note_shown(message["shown"])
        if "watch" in message:
            await self._watch(message)

    async def feed(self) -> None:
        """Send for ever.

        Raises:
            BrowserStalledError: the browser shows nothing any more.
        """
        while True:
            await self._changed.wait()
            self._changed.clear()
            while due := [kind for kind in _ORDER if self._is_due(kind)]:
                for kind in due:
                    await self._send_next(kind)

    def _note_shown(self, count: object) -> None:
        if type(count) is not int or not 1 <= count <= self._unshown:
            raise BadMessageError(f"shown {count!r}: {self._unshown} frames are under way")
        for _ in range(count):
            self._unshown -= 1
            self._room.release()

    async def _watch(self, message: dict[str, object]) -> None:
        name, selection = message["watch"], message.get("selection")
        if name is not None and (not isinstance(name, str) or not 1 <= len(name) <= _MAX_NAME):
            raise BadMessageError("watch is no name of a vehicle")
        if type(selection) is not int or not 0 <= selection < 2**16:
            raise BadMessageError("selection is no number from 0 to 65535")
        if (name, selection) != (self.vehicle, self._selection):
            fleet_number = self._sent.get(FrameKind.FLEET, 0)
            self._sent = {FrameKind.FLEET: fleet_number}
        self.vehicle, self._selection = name, selection
        self.wants_pictures = message.get("pictures") is not False
        await self._hub.steer()
        self.wake()

    async def _send_next(self, kind: FrameKind) -> None:
        try:
            async with asyncio.timeout(self._stall_s):
                await self._room.acquire()
                self._unshown += 1
                # Made only now, so that it is the newest however long there was no room.
                await self._send(self._frame(kind))
        except TimeoutError as error:
            raise BrowserStalledError(f"nothing was shown for {self._stall_s:g} s") from error

    def _is_due(self, kind: FrameKind) -> bool:
        newest = self._newest(kind)
        return newest is not None and newest != self._sent.get(kind, 0)

    def _newest(self, kind: FrameKind) -> int | None:
        """Running number of what could be sent now, None if there is nothing."""
        if kind is FrameKind.FLEET:
            return self._hub.fleet_number
        if self.vehicle is None:
            return None
        if kind is FrameKind.HISTORY:
            # Again from time to time, so that what a slow browser left out does not stay a gap.
            return 1 + self._hub.fleet_number // _HISTORY_TICKS
        if kind is FrameKind.DETAIL:
            return self._hub.fleet.changes(self.vehicle)
        picture = self._hub.fleet.picture(self.vehicle, _PICTURES[kind])
        return None if picture is None or not self.wants_pictures else picture.number

    def _frame(self, kind: FrameKind) -> bytes:
        self._sent[kind] = self._newest(kind) or 0
        now_ns = self._hub.clock.now_ns()
        fleet, name = self._hub.fleet, self.vehicle or ""
        if kind is FrameKind.FLEET:
            return self._encode(kind, self._hub.fleet_json, self._hub.fleet_ns)
        if kind is FrameKind.HISTORY:
            return self._encode(kind, history_document(fleet.history(name), now_ns), now_ns)
        if kind is FrameKind.DETAIL:
            view = fleet.view(name)
            camera = fleet.picture(name, keys.CAMERA) or fleet.picture(name, keys.DEPTH)
            return self._encode(
                kind, b"null" if view is None else detail_document(view, camera, now_ns), now_ns
            )
        picture = fleet.picture(name, _PICTURES[kind])
        if picture is None:  # let go of since it was due
            return self._encode(kind, b"", now_ns)
        return encode_frame(
            kind,
            picture.data,
            selection=self._selection,
            now_ns=now_ns,
            age_ns=max(0, now_ns - picture.born_ns),
            near_m=getattr(picture.header, "near_m", 0.0),
            far_m=getattr(picture.header, "far_m", 0.0),
        )

    def _encode(self, kind: FrameKind, payload: bytes, now_ns: int) -> bytes:
        return encode_frame(kind, payload, selection=self._selection, now_ns=now_ns)
