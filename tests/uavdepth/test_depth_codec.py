"""A depth picture never shows a thing farther than it is, and keeps unknown unknown."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from uavdepth import (
    CameraModel,
    DepthCodecError,
    DepthPictureInfo,
    colorize_depth,
    decode_depth_png,
    encode_depth_png,
)
from uavdepth.depth.codec import depth_codes
from uavdepth.depth.colors import UNKNOWN_BGR

spans = st.tuples(st.floats(0.01, 50), st.floats(2, 10000)).map(lambda pair: (pair[0], pair[0] * pair[1]))
depths = st.one_of(
    st.floats(width=32),
    st.floats(0.009999999776482582, 1000, width=32),
    st.sampled_from([0.0, -1.0, math.nan, math.inf, -math.inf]),
)
maps = hnp.arrays(np.float32, hnp.array_shapes(min_dims=2, max_dims=2, max_side=12), elements=depths)


@given(maps, spans)
def test_a_decoded_depth_never_exceeds_the_encoded_one(depth, span):
    decoded = decode_depth_png(encode_depth_png(depth, *span), *span)
    valid = depth > 0
    assert (decoded[valid] <= depth[valid]).all()
    assert np.isnan(decoded[~valid]).all()


@given(maps, spans)
def test_within_the_span_the_loss_is_below_one_level(depth, span):
    near, far = span
    decoded = decode_depth_png(encode_depth_png(depth, near, far), near, far)
    within = (depth >= near * 1.000001) & (depth < far)
    level = (far / near) ** (1 / 253)
    assert (decoded[within] >= depth[within] / level * (1 - 1e-5)).all()


@given(maps, spans)
def test_decoded_depth_encodes_to_the_same_codes_again(depth, span):
    near, far = span
    codes = depth_codes(depth, near, far)
    again = depth_codes(decode_depth_png(encode_depth_png(depth, near, far), near, far), near, far)
    # Code 1, nearer than near_m, decodes to 0 m, which is no depth.
    np.testing.assert_array_equal(again, np.where(codes == 1, 0, codes))


@given(
    hnp.arrays(np.float64, (3, 5), elements=st.floats(0.2, 100)),
    st.sampled_from([np.float16, np.float64]),
)
def test_other_kinds_of_float_are_not_rounded_up(depth, dtype):
    depth = depth.astype(dtype)
    decoded = decode_depth_png(encode_depth_png(depth, 0.1, 200), 0.1, 200)
    assert (decoded.astype(np.float64) <= depth.astype(np.float64)).all()


@pytest.mark.parametrize(
    ("depth_m", "code", "decoded_m"),
    [
        (math.nan, 0, math.nan),
        (0.0, 0, math.nan),
        (-3.0, 0, math.nan),
        (-math.inf, 0, math.nan),
        (0.1, 1, 0.0),
        (0.2, 2, 0.2),
        (99.99, 254, 97.57),
        (100.0, 255, 100.0),
        (500.0, 255, 100.0),
        (math.inf, 255, 100.0),
    ],
)
def test_the_ends_of_the_scale(depth_m, code, decoded_m):
    depth = np.full((2, 2), depth_m, np.float32)
    assert (depth_codes(depth, 0.2, 100) == code).all()
    decoded = decode_depth_png(encode_depth_png(depth, 0.2, 100), 0.2, 100)
    np.testing.assert_allclose(decoded, decoded_m, rtol=1e-3)


def test_the_picture_is_a_grey_png_that_anything_can_open():
    picture = cv2.imdecode(
        np.frombuffer(encode_depth_png(np.ones((4, 6), np.float32), 0.2, 100), np.uint8), cv2.IMREAD_UNCHANGED
    )
    assert picture.shape == (4, 6)
    assert picture.dtype == np.uint8


@pytest.mark.parametrize(
    "span",
    [(0.0, 10.0), (-1.0, 10.0), (5.0, 9.9), (1.0, math.inf), (math.nan, 10.0), (1.0, math.nan), (1e-9, 1.0)],
)
def test_an_impossible_span_is_refused_by_value(span):
    with pytest.raises(DepthCodecError, match="the span is"):
        encode_depth_png(np.ones((2, 2), np.float32), *span)
    with pytest.raises(DepthCodecError, match="the span is"):
        decode_depth_png(b"", *span)


@pytest.mark.parametrize(
    "depth",
    [
        np.ones(4, np.float32),
        np.ones((2, 2, 3)),
        np.ones((0, 4)),
        np.full((2, 2), "a"),
        np.ones((2, 2), complex),
    ],
)
def test_what_is_no_depth_map_is_refused(depth):
    with pytest.raises(DepthCodecError, match="depth is"):
        encode_depth_png(depth, 0.2, 100)


def broken_pictures() -> list[bytes]:
    whole = encode_depth_png(np.ones((40, 60), np.float32), 0.2, 100)
    color = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes()
    deep = cv2.imencode(".png", np.zeros((4, 4), np.uint16))[1].tobytes()
    return [b"", b"not a picture", whole[:20], color, deep]


@pytest.mark.parametrize("data", broken_pictures(), ids=["empty", "text", "cut", "colour", "16 bit"])
def test_data_that_is_no_depth_picture_is_refused(data):
    with pytest.raises(DepthCodecError):
        decode_depth_png(data, 0.2, 100)


class TestColors:
    def test_nearer_is_lighter_all_the_way(self):
        depth = np.geomspace(0.3, 100, 200, dtype=np.float32).reshape(1, -1)
        lab = cv2.cvtColor(colorize_depth(depth, 0.3, 100), cv2.COLOR_BGR2LAB)
        lightness = lab[0, :, 0].astype(int)
        assert (np.diff(lightness) <= 1).all()
        assert lightness[0] > 230
        assert lightness[-1] < 15

    def test_unknown_has_a_colour_that_no_distance_has(self):
        every = np.geomspace(0.1, 200, 2000, dtype=np.float32).reshape(1, -1)
        colors = {tuple(color) for color in colorize_depth(every, 0.3, 100)[0].tolist()}
        unknown = colorize_depth(np.array([[np.nan, 0.0, -1.0]], np.float32), 0.3, 100)
        assert {tuple(color) for color in unknown[0].tolist()} == {UNKNOWN_BGR}
        assert UNKNOWN_BGR not in colors

    def test_sky_is_the_darkest_and_something_too_near_the_lightest(self):
        picture = colorize_depth(np.array([[0.01, 0.3001, 99.0, np.inf]], np.float32), 0.3, 100).astype(int)
        lightness = picture.sum(axis=2)[0]
        assert lightness[0] == lightness[1] > lightness[2] >= lightness[3]


def test_the_information_beside_a_picture_is_plain_json_and_gives_the_camera_back():
    camera = CameraModel(640, 320, 300, 301, 322, 158, (-0.2, 0.05, 0.001, -0.001))
    info = DepthPictureInfo.of(camera, 0.3, 100.0)
    read = json.loads(json.dumps(asdict(info)))
    assert read["version"] == 1
    assert read["encoding"] == "log8-png"
    read["distortion"] = tuple(read["distortion"])
    assert DepthPictureInfo(**read) == info
    assert info.camera == camera


def test_a_png_that_claims_to_be_huge_is_refused_before_memory_is_taken() -> None:
    data = bytearray(encode_depth_png(np.ones((4, 4), np.float32), 0.5, 60.0))
    data[16:24] = (30_000).to_bytes(4, "big") * 2
    with pytest.raises(DepthCodecError, match="30000x30000 pixels"):
        decode_depth_png(bytes(data), 0.5, 60.0)


def test_no_other_format_is_read_in_place_of_a_png() -> None:
    jpeg = cv2.imencode(".jpg", np.full((4, 4), 100, np.uint8))[1].tobytes()
    with pytest.raises(DepthCodecError, match="a PNG is needed"):
        decode_depth_png(jpeg, 0.5, 60.0)
