"""Everything that is read from the network, fed with damaged and hostile samples.

`python tests/service/fuzz_decoders.py --inputs 200000` is the long run; the tests take a short one.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from service.clock import ManualClock
from service.publisher import keys
from service.publisher.budget import PictureBudget
from service.publisher.picture_receiver import PictureReceiver
from service.publisher.received import ReceivedReport
from service.publisher.status_wire import StatusSample
from service.publisher.video import VideoEncoder, VideoHeader
from service.publisher.wire import CameraHeader, DepthHeader, Intrinsics, ScanSample
from service.watch.board import Board
from uavdepth.depth.codec import decode_depth_png, encode_codes_png
from uavdepth.errors import UavDepthError
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg

CAMERA = Intrinsics(width=64, height=48, fx=50.0, fy=50.0, cx=31.5, cy=23.5)
TOKENS = (
    b"null", b"true", b"-1", b"0", b"1e308", b"1e999", b"-0.0", b"NaN", b"Infinity", b'""', b"[]", b"{}",
    b"9" * 400, b"[" * 500, b'"\\ud800"', b'"' + b"A" * 2000 + b'"', b"18446744073709551616", b"0.1e-400",
)  # fmt: skip
"""What stands in place of a number, a word or a list."""


@dataclass
class Tally:
    """What came of the inputs: how many of each decoder were read, and how many refused by name."""

    read: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0

    @property
    def inputs(self) -> int:
        return self.read.total() + self.refused.total()


class SilentSession:
    """A Zenoh session that nobody hears."""

    def declare_subscriber(self, _key: str, _take: Callable[[Any], None]) -> None:
        return None

    def put(self, _key: str, _payload: bytes) -> None:
        return None


def fuzz(inputs: int, seed: int) -> Tally:
    """Feed `inputs` samples, made from `seed`, to every decoder in turn; only named errors are caught."""
    rng = np.random.default_rng(seed)
    tally = Tally()
    decoders = list(_decoders().items())
    for number in range(inputs):
        name, (samples, decode) = decoders[number % len(decoders)]
        sample = samples[int(rng.integers(len(samples)))]
        damaged = tuple(mutated(part, rng) if rng.random() < 0.7 else part for part in sample)
        begun_s = time.perf_counter()
        try:
            decode(*damaged)
            tally.read[name] += 1
        except UavDepthError:
            tally.refused[name] += 1
        tally.slowest_s = max(tally.slowest_s, time.perf_counter() - begun_s)
    return tally


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` with one to four damages."""
    for _ in range(int(rng.integers(1, 5))):
        kind = int(rng.integers(7))
        at = int(rng.integers(len(data) + 1))
        if kind == 0:
            data = data[:at]
        elif kind == 1 and data:
            changed = bytearray(data)
            changed[at % len(data)] ^= 1 << int(rng.integers(8))
            data = bytes(changed)
        elif kind == 2:
            data = data[:at] + rng.bytes(int(rng.integers(1, 40))) + data[at:]
        elif kind == 3:
            data = data[:at] + data[at + int(rng.integers(1, 20)) :]
        elif kind == 4:
            length = int(rng.integers(1, 200))
            data = data[:at] + data[at : at + length] + data[at:]
        elif kind == 5:
            data = _with_token(data, rng)
        else:
            data = rng.bytes(int(rng.integers(0, 100)))
    return data


def _with_token(data: bytes, rng: np.random.Generator) -> bytes:
    """One value of JSON text replaced."""
    colons = [at for at, byte in enumerate(data) if byte in b":,["]
    if not colons:
        return data
    at = colons[int(rng.integers(len(colons)))] + 1
    end = next((i for i in range(at, len(data)) if data[i] in b",}]"), len(data))
    return data[:at] + TOKENS[int(rng.integers(len(TOKENS)))] + data[end:]


def _decoders() -> dict[str, tuple[list[tuple[bytes, ...]], Callable[..., object]]]:
    state = np.full(72, SectorState.CLEAR, np.uint8)
    scan = ObstacleScan(np.full(72, np.nan, np.float32), state, sector_bearings_deg(), 0.2, 20.0)
    stamp = {"index": 1, "captured_ns": 5, "age_ms": 3.0}
    scan_sample = ScanSample.of(scan, index=1, captured_ns=5, age_ms=3.0, trouble=None).encode()
    status = StatusSample(
        vehicle="kite", state="ACTIVE", uptime_s=1.0, frames_per_s=15.0, obstacle_messages=3,
        camera="delivering", link_connected=True, memory_mib=100.0,
    ).encode()  # fmt: skip
    depth = DepthHeader(**stamp, near_m=0.5, far_m=60.0, camera=CAMERA).encode()
    camera = CameraHeader(**stamp, camera=CAMERA).encode()
    report = ReceivedReport(
        **stamp, station="a", topic="depth", interval_ms=200.0, pictures=3, size_bytes=9000
    ).encode()
    codes = np.random.default_rng(0).integers(0, 256, (48, 64), dtype=np.uint8)
    png = encode_codes_png(codes)
    jpeg = cv2.imencode(".jpg", codes)[1].tobytes()
    encoder = VideoEncoder(64, 48, 10.0)
    videos = []
    for number in range(4):
        packet, is_key = encoder.encode(np.roll(codes, number, 1), number * 10**8, 20_000.0)
        header = VideoHeader(
            **stamp, stream="1", sequence=number, is_key=is_key, near_m=0.5, far_m=60.0, camera=CAMERA
        )
        videos.append((packet, header.encode()))

    board, budget, clock = Board(), PictureBudget(1e6), ManualClock(0)
    budget.sent("depth", 1, 9000, 0)
    session: Any = SilentSession()
    receiver = PictureReceiver(session, "kite", lambda _key, _payload, _attachment: None, clock)

    def receive(topic: str) -> Callable[[bytes, bytes], None]:
        return lambda payload, attachment: receiver.receive(keys.key("kite", topic), payload, attachment)

    def read_depth(payload: bytes, attachment: bytes) -> None:
        header = DepthHeader.decode(attachment)
        decode_depth_png(payload, header.near_m, header.far_m)

    def hear_report(payload: bytes) -> None:
        clock.advance_s(0.01)
        budget.hear(ReceivedReport.decode(payload), clock.now_ns())
        assert 0 < budget.bytes_per_s <= 1e6

    return {
        "scan": ([(scan_sample,)], lambda data: ScanSample.decode(data).scan),
        "status": ([(status,)], StatusSample.decode),
        "received": ([(report,)], hear_report),
        "board": ([(scan_sample,), (status,)], lambda data: board.hear(keys.key("kite", "scan"), data, 0)),
        "depth picture": ([(png, depth), (jpeg, depth)], read_depth),
        "depth received": ([(png, depth)], receive(keys.DEPTH)),
        "camera received": ([(jpeg, camera)], receive(keys.CAMERA)),
        "video received": (videos, receive(keys.VIDEO)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description="Damaged and hostile samples for every decoder.")
    parser.add_argument("--inputs", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    tally = fuzz(given.inputs, given.seed)
    for name in sorted(tally.read | tally.refused):
        print(f"{name:<16} {tally.read[name]:>8} read, {tally.refused[name]:>8} refused by name")
    print(f"{tally.inputs} inputs, slowest {1e3 * tally.slowest_s:.1f} ms, nothing else came out")


if __name__ == "__main__":
    main()
