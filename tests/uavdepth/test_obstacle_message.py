"""Only legal words leave, whatever comes in."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uavdepth import ObstacleScan, ScanError, SectorState, encode_obstacle_distance, obstacle_words
from uavdepth.scan.obstacle_scan import sector_bearings_deg

UNKNOWN_WORD = 65535


def scan_of(distance_m, state, *, nearest=0.2, farthest=20.0) -> ObstacleScan:
    return ObstacleScan(distance_m, state, sector_bearings_deg(), nearest, farthest)


def one(distance_m: float, state: int = SectorState.OBSTACLE, **limits: float) -> int:
    """The word of element 3 when only that element holds something."""
    distance = np.full(72, np.nan, np.float32)
    states = np.zeros(72, np.uint8)
    distance[3], states[3] = distance_m, state
    words = obstacle_words(scan_of(distance, states, **limits))
    assert (np.delete(words, 3) == UNKNOWN_WORD).all()
    return int(words[3])


@pytest.mark.parametrize(
    ("distance_m", "word"),
    [
        (5.0, 500),
        (5.009, 500),
        (19.989, 1998),
        (19.99, 1999),
        (0.21, 21),
        (0.2, 21),
        (0.1, 21),
        (0.0, 21),
        (20.0, 2001),
        (25.0, 2001),
        (math.inf, 2001),
        (1e30, 2001),
        (math.nan, UNKNOWN_WORD),
        (-0.5, UNKNOWN_WORD),
        (-math.inf, UNKNOWN_WORD),
    ],
)
def test_r6_an_obstacle_is_told_in_centimetres_rounded_down_within_the_legal_span(distance_m, word):
    assert one(distance_m) == word


def test_clear_is_one_above_the_maximum_and_unknown_is_all_ones():
    assert one(math.nan, SectorState.CLEAR) == 2001
    assert one(5.0, SectorState.CLEAR) == 2001
    assert one(5.0, SectorState.UNKNOWN) == UNKNOWN_WORD


def test_a_state_that_is_none_of_the_three_is_unknown():
    assert one(5.0, 7) == UNKNOWN_WORD


any_number = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True, width=32),
    st.sampled_from([0.0, -0.0, 0.2, 20.0, 19.999, 0.21, 655.34, 655.35, 1e9, -1.0, math.nan, math.inf]),
)
any_distances = st.one_of(
    hnp.arrays(np.float32, 72, elements=st.floats(width=32)),
    hnp.arrays(np.float64, 72, elements=any_number),
    hnp.arrays(np.float16, 72, elements=st.floats(width=16)),
    hnp.arrays(np.int64, 72),
    hnp.arrays(np.uint16, 72),
    hnp.arrays(np.bool_, 72),
)
any_states = st.one_of(
    hnp.arrays(np.uint8, 72, elements=st.integers(0, 2)),
    hnp.arrays(np.uint8, 72),
    hnp.arrays(np.int64, 72),
    hnp.arrays(np.float64, 72, elements=any_number),
)
legal_limits = st.tuples(st.integers(1, 500), st.integers(600, 60000)).map(
    lambda cm: (cm[0] / 100, cm[1] / 100)
)


@given(any_distances, any_states, legal_limits)
def test_r6_whatever_comes_in_only_legal_words_leave(distance, state, limits):
    scan = scan_of(distance, state, nearest=limits[0], farthest=limits[1])
    message = encode_obstacle_distance(scan)
    low, high = message.min_distance, message.max_distance
    legal = {high + 1, UNKNOWN_WORD}
    assert all(word in legal or low < word < high for word in message.distances)
    assert UNKNOWN_WORD - 1 not in message.distances


@given(any_distances, any_states)
def test_r7_doubt_never_leaves_as_clear(distance, state):
    words = obstacle_words(scan_of(distance, state))
    with np.errstate(invalid="ignore"):
        wide = distance.astype(np.float64)
        beyond = (state == SectorState.OBSTACLE) & (wide > 19.98)
        said_clear = (state == SectorState.CLEAR) | beyond
    assert said_clear[words == 2001].all()


@given(any_distances, any_states)
def test_an_obstacle_is_never_told_farther_than_it_is(distance, state):
    words = obstacle_words(scan_of(distance, state)).astype(np.float64)
    told = (words > 21) & (words < 2000)
    assert (words[told] / 100 <= distance[told].astype(np.float64) + 2e-5).all()


def test_r3_the_message_has_the_layout_that_is_safe_on_both_autopilots():
    message = encode_obstacle_distance(scan_of(np.full(72, np.nan), np.zeros(72)), time_usec=123)
    assert message.time_usec == 123
    assert message.sensor_type == mavlink.MAV_DISTANCE_SENSOR_UNKNOWN
    assert (message.increment, message.increment_f) == (5, 5.0)
    assert message.angle_offset == -155.0
    assert message.frame == mavlink.MAV_FRAME_BODY_FRD
    assert (message.min_distance, message.max_distance) == (20, 2000)
    assert len(message.distances) == 72


def test_the_message_survives_the_wire():
    distance, state = np.full(72, np.nan, np.float32), np.zeros(72, np.uint8)
    distance[31], state[31], state[32] = 7.25, SectorState.OBSTACLE, SectorState.CLEAR
    message = encode_obstacle_distance(scan_of(distance, state), time_usec=2**63)
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=196)
    (received,) = mavlink.MAVLink(None).parse_buffer(message.pack(link))
    assert received.to_dict() == message.to_dict()
    assert received.distances[31:33] == [725, 2001]


@pytest.mark.parametrize(
    ("nearest", "farthest", "text"),
    [
        (math.nan, 20.0, "min_distance_m is nan"),
        (0.2, math.inf, "max_distance_m is inf"),
        (0.0, 20.0, "min_distance_m is 0.0"),
        (-1.0, 20.0, "min_distance_m is -1.0"),
        (5.0, 5.01, "max_distance_m is 5.01"),
        (0.2, 600.01, "max_distance_m is 600.01"),
    ],
)
def test_limits_that_leave_no_legal_words_are_refused(nearest, farthest, text):
    scan = scan_of(np.zeros(72), np.zeros(72), nearest=nearest, farthest=farthest)
    with pytest.raises(ScanError, match=text):
        encode_obstacle_distance(scan)


@pytest.mark.parametrize(
    ("distance", "state", "text"),
    [
        (np.zeros(71), np.zeros(72), r"distance_m has the shape \(71,\)"),
        (np.zeros(72), np.zeros((72, 1)), r"state has the shape \(72, 1\)"),
        (np.full(72, "far"), np.zeros(72), "distance_m is not an array of numbers"),
        (np.zeros(72), np.full(72, None), None),
    ],
)
def test_arrays_of_another_shape_or_kind_are_refused_or_unknown(distance, state, text):
    if text is None:
        assert (obstacle_words(scan_of(distance, state)) == UNKNOWN_WORD).all()
    else:
        with pytest.raises(ScanError, match=text):
            obstacle_words(scan_of(distance, state))


@pytest.mark.parametrize("time_usec", [-1, 2**64])
def test_a_time_that_does_not_fit_is_refused(time_usec):
    with pytest.raises(ScanError, match=str(time_usec)):
        encode_obstacle_distance(scan_of(np.zeros(72), np.zeros(72)), time_usec)
