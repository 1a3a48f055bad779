"""What waits for the recorder's thread."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from service.perception_result import PerceptionResult

_ITEM_BYTES = 200
"""What an item costs besides its data."""


@dataclass(frozen=True)
class PictureItem:
    """A picture and what became of it; see `PerceptionNote`.

    Args:
        camera: name of a further camera; "" for the main one.
    """

    result: PerceptionResult
    begun_ns: int
    done_ns: int
    camera: str = ""

    @property
    def at_ns(self) -> int:
        """When it was handed over."""
        return self.done_ns

    @property
    def size_bytes(self) -> int:
        """Memory that it holds."""
        depth = self.result.depth
        planes = () if depth is None else (depth.depth_m, depth.relative_sigma)
        held = sum(plane.nbytes for plane in planes if plane is not None)
        return self.result.frame.image_bgr.nbytes + held + _ITEM_BYTES


@dataclass(frozen=True)
class PacketsItem:
    """Bytes of the MAVLink line, and whose they are."""

    data: bytes
    at_ns: int
    outgoing: bool
    source: Hashable

    @property
    def size_bytes(self) -> int:
        """Memory that it holds."""
        return len(self.data) + _ITEM_BYTES


@dataclass(frozen=True)
class StatusItem:
    """The service's status as JSON text."""

    text: bytes
    at_ns: int

    @property
    def size_bytes(self) -> int:
        """Memory that it holds."""
        return len(self.text) + _ITEM_BYTES


Item = PictureItem | PacketsItem | StatusItem
