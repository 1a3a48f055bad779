"""Binary WebSocket frames to the browser: 24 bytes of header, then JSON or a picture as it came."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Final

HEADER: Final = struct.Struct("<BBHfdff")
"""Version, kind, selection, age in ms, gateway's time in ms, near and far in m; `page/frames.js` reads it."""

FRAME_VERSION: Final = 1


class FrameKind(IntEnum):
    """What follows the header."""

    FLEET = 1
    """JSON: all vehicles in short."""
    DETAIL = 2
    """JSON: scan and status of the selected vehicle."""
    HISTORY = 3
    """JSON: its nearest distances of the last minutes."""
    CAMERA = 4
    """Its forward picture, JPEG."""
    DEPTH = 5
    """Its depth picture, PNG of logarithmic codes between near and far."""


def encode_frame(
    kind: FrameKind,
    payload: bytes,
    *,
    selection: int,
    now_ns: int,
    age_ns: int = 0,
    near_m: float = 0.0,
    far_m: float = 0.0,
) -> bytes:
    """One frame.

    Args:
        kind: what the payload is.
        payload: JSON or a picture.
        selection: number of the browser's choice of vehicle that this answers, modulo 2**16.
        now_ns: the gateway's clock when it is sent.
        age_ns: age of a picture at that time.
        near_m, far_m: span of a depth picture.
    """
    header = HEADER.pack(
        FRAME_VERSION, kind, selection % 2**16, min(age_ns / 1e6, 1e12), now_ns / 1e6, near_m, far_m
    )
    return header + payload
