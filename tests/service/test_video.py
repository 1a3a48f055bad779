"""The thin profile: H.264 there and back, gaps, hostile streams; small depth pictures lose nothing near."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from service.publisher.depth_picture import shrunk_camera, shrunk_codes
from service.publisher.video import MAX_PACKET_BYTES, VideoDecoder, VideoEncoder, VideoHeader
from service.publisher.wire import Intrinsics
from uavdepth.camera import CameraModel
from uavdepth.errors import DepthCodecError

CAMERA = Intrinsics(width=96, height=64, fx=50.0, fy=50.0, cx=47.5, cy=31.5)
MS = 1_000_000


def codes_at(number: int) -> np.ndarray:
    across = np.linspace(40, 220, CAMERA.width)[None, :] + np.zeros((CAMERA.height, 1))
    codes = across.astype(np.uint8)
    codes[20:40, 5 + 3 * number : 15 + 3 * number] = 90
    return codes


def header_of(encoder: VideoEncoder, is_key: bool) -> VideoHeader:
    return VideoHeader(
        index=encoder.sequence, captured_ns=0, age_ms=0.0, stream=str(encoder.stream),
        sequence=encoder.sequence, is_key=is_key, near_m=0.5, far_m=60.0, camera=CAMERA,
    )  # fmt: skip


def recorded(count: int, bytes_per_s: float = 20_000.0) -> list[tuple[VideoHeader, bytes]]:
    encoder, samples = VideoEncoder(CAMERA.width, CAMERA.height, 10.0), []
    for number in range(count):
        data, is_key = encoder.encode(codes_at(number), number * 100 * MS, bytes_per_s)
        samples.append((header_of(encoder, is_key), data))
    return samples


def test_a_video_shows_what_was_seen() -> None:
    decoder = VideoDecoder()
    for number, (header, data) in enumerate(recorded(8)):
        back = decoder.decode(header, data)
        assert back is not None
        assert back.shape == (CAMERA.height, CAMERA.width)
        assert np.abs(back.astype(int) - codes_at(number)).mean() < 3.0


def test_the_first_picture_and_one_every_two_seconds_are_readable_alone() -> None:
    keys = [header.is_key for header, _ in recorded(41)]
    assert [number for number, is_key in enumerate(keys) if is_key] == [0, 20, 40]


def test_after_a_gap_nothing_is_shown_before_the_next_key_frame() -> None:
    samples = recorded(24)
    decoder = VideoDecoder()
    shown = [decoder.decode(*sample) is not None for sample in samples[:5] + samples[8:]]
    assert shown == [True] * 5 + [False] * 12 + [True] * 4
    assert not decoder.wants_key_frame


def test_a_key_frame_comes_when_it_is_asked_for() -> None:
    encoder = VideoEncoder(CAMERA.width, CAMERA.height, 10.0)
    asked = [encoder.encode(codes_at(n), n * 100 * MS, 20_000.0, key_frame=n == 3)[1] for n in range(5)]
    assert asked == [True, False, False, True, False]


def test_another_bit_rate_begins_a_new_stream() -> None:
    encoder = VideoEncoder(CAMERA.width, CAMERA.height, 10.0)
    encoder.encode(codes_at(0), 0, 20_000.0)
    assert encoder.encode(codes_at(1), 100 * MS, 5_000.0)[1]
    assert (encoder.stream, encoder.sequence) == (2, 0)


@pytest.mark.parametrize("data", [b"", b"\x00" * 50, bytes(range(256)), b"x" * (MAX_PACKET_BYTES + 1)])
def test_what_is_no_video_is_refused_by_name(data: bytes) -> None:
    header = recorded(1)[0][0]
    decoder = VideoDecoder()
    with pytest.raises(DepthCodecError):
        decoder.decode(header, data)
    assert decoder.wants_key_frame


def test_a_picture_of_another_size_is_refused() -> None:
    encoder = VideoEncoder(96, 64, 10.0)
    with pytest.raises(DepthCodecError, match="96x64"):
        encoder.encode(np.zeros((32, 48), np.uint8), 0, 1000.0)


@settings(max_examples=50)
@given(arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9))), st.integers(1, 9))
def test_the_nearest_of_each_block_stays(codes: np.ndarray, divisor: int) -> None:
    small = shrunk_codes(codes, min(divisor, *codes.shape))
    step = min(divisor, *codes.shape)
    for row in range(small.shape[0]):
        for column in range(small.shape[1]):
            block = codes[row * step : (row + 1) * step, column * step : (column + 1) * step]
            valid = block[block > 0]
            assert small[row, column] == (valid.min() if valid.size else 0)


def test_the_camera_of_a_small_picture_looks_along_the_same_rays() -> None:
    camera = shrunk_camera(CAMERA, 4)
    large = CameraModel(CAMERA.width, CAMERA.height, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
    small = CameraModel(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    blocks = large.normalized_rays.reshape(16, 4, 24, 4, -1).mean(axis=(1, 3))
    np.testing.assert_allclose(small.normalized_rays, blocks, atol=1e-6)
