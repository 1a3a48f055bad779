"""What the recorder says of itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RecorderStatus:
    """The recorder at one moment.

    Args:
        recording: a file is open and takes what comes.
        path: the newest file, or None.
        pictures, packets: written since the start.
        dropped_pictures, dropped_packets: not written, because the disk was too slow or full.
        bytes: written since the start.
        problem: what is wrong, fit to show a user; empty if nothing.
    """

    recording: bool = False
    path: str | None = None
    pictures: int = 0
    packets: int = 0
    dropped_pictures: int = 0
    dropped_packets: int = 0
    bytes: int = 0
    problem: str = ""
