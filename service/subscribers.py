"""Who gets every result: slots that a program embeds the service for."""

from __future__ import annotations

import threading

from service.latest_slot import LatestSlot
from service.perception_result import PerceptionResult


class Subscribers:
    """Hands each result to every slot that is still open; a slow taker delays nobody."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._slots: list[LatestSlot[PerceptionResult]] = []

    def add(self) -> LatestSlot[PerceptionResult]:
        """A slot that gets every result from now on, until it is closed."""
        slot: LatestSlot[PerceptionResult] = LatestSlot()
        with self._lock:
            self._slots.append(slot)
        return slot

    def put(self, result: PerceptionResult) -> None:
        """Hand a result to all."""
        with self._lock:
            self._slots = [slot for slot in self._slots if not slot.closed]
            for slot in self._slots:
                slot.put(result)

    def close(self) -> None:
        """Close every slot: nothing comes any more."""
        with self._lock:
            for slot in self._slots:
                slot.close()
