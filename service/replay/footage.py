"""What a replay plays: pictures and telemetry on one clock, wherever they come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from service.recorder.perception_note import PerceptionNote
from uavdepth.depth.depth_map import DepthMap


@dataclass(frozen=True)
class Packets:
    """Bytes of a MAVLink line.

    Args:
        at_ns: when they passed, on the record's clock.
        data: any part of the stream.
        outgoing: the service sent them.
        sender: whose they are, on a line with many ends.
    """

    at_ns: int
    data: bytes
    outgoing: bool = False
    sender: str | None = None


@dataclass(frozen=True)
class RecordedPicture:
    """A picture, or its depth, and when it was measured.

    Args:
        note: index and times; what it became, where that was recorded.
        image_bgr: (H, W, 3) uint8, or None where the camera was not recorded.
        depth: metres, NaN where unknown, with its uncertainty where that was recorded; or None where depth
            was not.
        camera: name of a further camera; "" for the main one.
    """

    note: PerceptionNote
    image_bgr: NDArray[np.uint8] | None = None
    depth: DepthMap | None = None
    camera: str = ""


class Footage(Protocol):
    """Pictures and telemetry of one flight."""

    @property
    def name(self) -> str:
        """What it is called in messages."""

    @property
    def packets(self) -> Sequence[Packets]:
        """The line's bytes in the order of their times."""

    @property
    def warnings(self) -> Sequence[str]:
        """What is wrong and does not keep it from being played."""

    def pictures(self) -> Iterator[RecordedPicture]:
        """The pictures of each camera in the order of their capture; may be called again."""
