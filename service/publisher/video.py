"""The thin profile: the logarithmic depth picture as H.264, for eyes only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from service.errors import ConfigError
from service.publisher.wire import Count, Intrinsics, Stamp, Words
from uavdepth.errors import DepthCodecError

if TYPE_CHECKING:
    import av

MAX_PACKET_BYTES: Final = 262_144
_MAX_PIXELS: Final = 4_194_304
_FORMATS: Final = ("yuv420p", "yuvj420p", "gray")
_KEY_FRAME_PERIOD_NS: Final = 2_000_000_000
_REBUILD_RATIO = 1.3
"""A change of the bit rate below it is not worth a new encoder and its key frame."""


class VideoHeader(Stamp):
    """Attachment of a video sample, whose payload is one H.264 access unit.

    Args:
        encoding: luma is the code of `uavdepth.depth.codec`, altered by the codec: never fly by it.
        stream: changes when the vehicle starts its encoder anew.
        sequence: counts the stream's pictures; a gap makes everything up to the next key frame unreadable.
        is_key: readable on its own.
        near_m, far_m: ends of the logarithmic scale in metres.
        camera: the depth picture's camera.
    """

    encoding: Literal["log8-h264"] = "log8-h264"
    stream: Words
    sequence: Count
    is_key: bool
    near_m: float = Field(gt=0.0)
    far_m: float = Field(gt=0.0)
    camera: Intrinsics


def require_video() -> None:
    """Raise ConfigError if the package that reads and writes H.264 is not installed."""
    try:
        import av
    except ImportError as error:
        raise ConfigError(
            "[zenoh] profile: thin needs the package av: pip install 'uavdepth[video]'"
        ) from error
    av.logging.set_level(av.logging.PANIC)


class VideoEncoder:
    """Writes 8-bit pictures of one size as H.264 without delay.

    Args:
        width, height: of the pictures; odd ones lose their last row or column.
        frames_per_s: what the bit rate is spread over.
    """

    def __init__(self, width: int, height: int, frames_per_s: float) -> None:
        require_video()
        self._width, self._height = width - width % 2, height - height % 2
        if self._width < 16 or self._height < 16:
            raise DepthCodecError(f"a video of {width}x{height} pixels: 16x16 is the least")
        self._frames_per_s = frames_per_s
        self._bits_per_s = 0.0
        self._encoder: av.VideoCodecContext | None = None
        self._key_ns: int | None = None
        self.stream = 0
        """Number of the encoder, counted from 1."""
        self.sequence = -1
        """Number of the newest picture in the stream."""

    def encode(
        self, codes: NDArray[np.uint8], now_ns: int, bytes_per_s: float, *, key_frame: bool = False
    ) -> tuple[bytes, bool]:
        """One access unit, and whether it is readable on its own.

        Args:
            codes: (H, W) uint8.
            now_ns: a clock for the time stamps.
            bytes_per_s: what the stream may take.
            key_frame: make it readable on its own.

        Raises:
            DepthCodecError: a picture of another size, or an encoder that fails.
        """
        import av

        if codes.shape[0] < self._height or codes.shape[1] < self._width or codes.dtype != np.uint8:
            raise DepthCodecError(
                f"a picture of {codes.dtype} {codes.shape} in a video of {self._width}x{self._height}"
            )
        with _named("encode"):
            encoder = self._fitting(8 * bytes_per_s)
            frame = av.VideoFrame(self._width, self._height, "yuv420p")
            _fill(frame.planes[0], codes[: self._height, : self._width])
            for plane in (frame.planes[1], frame.planes[2]):
                _fill(plane, np.full((self._height // 2, self._width // 2), 128, np.uint8))
            key_frame = key_frame or self._key_ns is None or now_ns - self._key_ns >= _KEY_FRAME_PERIOD_NS
            if key_frame:
                frame.pict_type = av.video.frame.PictureType.I
                self._key_ns = now_ns
            self.sequence += 1
            frame.pts, frame.time_base = self.sequence, Fraction(1, max(round(self._frames_per_s), 1))
            packets = encoder.encode(frame)
            return b"".join(bytes(packet) for packet in packets), any(p.is_keyframe for p in packets)

    def _fitting(self, bits_per_s: float) -> av.VideoCodecContext:
        ratio = bits_per_s / self._bits_per_s if self._bits_per_s else 0.0
        if self._encoder is not None and 1 / _REBUILD_RATIO < ratio < _REBUILD_RATIO:
            return self._encoder
        import av

        rate = max(round(self._frames_per_s), 1)
        kbit = max(round(bits_per_s / 1000), 8)
        encoder = av.VideoCodecContext.create("libx264", "w")
        encoder.width, encoder.height, encoder.pix_fmt = self._width, self._height, "yuv420p"
        encoder.framerate, encoder.time_base = Fraction(rate, 1), Fraction(1, rate)
        encoder.thread_count = 1
        encoder.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "crf": "18",
            # One picture's worth of buffer and a half: none is much larger than its share.
            "maxrate": f"{kbit}k",
            "bufsize": f"{max(1, round(1.5 * kbit / rate))}k",
            "g": "100000",
            "forced-idr": "1",
            "x264-params": "repeat-headers=1:fullrange=on",
        }
        self._encoder, self._bits_per_s = encoder, bits_per_s
        self._key_ns, self.sequence = None, -1
        self.stream += 1
        return encoder


class VideoDecoder:
    """Turns one vehicle's video samples back into pictures, from data that need not be trusted."""

    def __init__(self) -> None:
        self._decoder: av.VideoCodecContext | None = None
        self._stream: str | None = None
        self._sequence = -1
        self.wants_key_frame = True
        """Nothing can be read before the next key frame."""

    def decode(self, header: VideoHeader, data: bytes) -> NDArray[np.uint8] | None:
        """(H, W) uint8 codes, or None where a key frame has to come first.

        Raises:
            DepthCodecError: data that is no H.264 picture, or one that is too large.
            ConfigError: the package that reads H.264 is not installed.
        """
        if len(data) > MAX_PACKET_BYTES:
            raise DepthCodecError(
                f"a video picture of {len(data)} bytes: at most {MAX_PACKET_BYTES} are read"
            )
        follows = header.stream == self._stream and header.sequence == self._sequence + 1
        decoder = self._decoder
        if decoder is None or (header.is_key and not follows):
            decoder = self._start()
        if not header.is_key and (self.wants_key_frame or not follows):
            self.wants_key_frame = True
            return None
        self._stream, self._sequence = header.stream, header.sequence
        import av

        try:
            with _named("decode"):
                frames = decoder.decode(av.Packet(data))
        except DepthCodecError:
            self.wants_key_frame = True
            raise
        if not frames:
            self.wants_key_frame = True
            raise DepthCodecError(f"{len(data)} bytes hold no picture")
        if frames[-1].format.name not in _FORMATS:
            self.wants_key_frame = True
            raise DepthCodecError(f"the video's pixels are {frames[-1].format.name}: 8-bit ones are needed")
        self.wants_key_frame = False
        plane = frames[-1].planes[0]
        rows = np.frombuffer(bytes(plane), np.uint8)[: plane.height * plane.line_size]
        return np.array(rows.reshape(plane.height, plane.line_size)[:, : plane.width], np.uint8)

    def _start(self) -> av.VideoCodecContext:
        require_video()
        import av

        decoder = av.VideoCodecContext.create("h264", "r")
        decoder.thread_count = 1
        decoder.options = {"max_pixels": str(_MAX_PIXELS), "flags": "+low_delay"}
        self._decoder = decoder
        return decoder


@contextmanager
def _named(what: str) -> Iterator[None]:
    """FFmpeg's errors as ours."""
    import av

    try:
        yield
    except (av.FFmpegError, ValueError, TypeError, EOFError) as error:
        raise DepthCodecError(f"the video cannot be {what}d: {error}") from error


def _fill(plane: av.video.plane.VideoPlane, values: NDArray[np.uint8]) -> None:
    padded = np.zeros((values.shape[0], plane.line_size), np.uint8)
    padded[:, : values.shape[1]] = values
    plane.update(padded.tobytes())
