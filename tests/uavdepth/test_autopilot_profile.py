"""Each autopilot's layout: never an obstacle lost, never unknown made clear, whatever the layout."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from uavdepth import ObstacleScan, ScanError, SectorState, encode_obstacle_distance, obstacle_words
from uavdepth.messages.autopilot_profile import ARDUPILOT, PROFILES, PX4, PX4_LEGACY, AutopilotProfile
from uavdepth.scan.obstacle_scan import sector_bearings_deg

CLEAR_WORD, UNKNOWN_WORD = 2001, 65535
BEARINGS = sector_bearings_deg()

profiles = st.sampled_from(list(PROFILES.values()))
scans = st.builds(
    lambda distance, state: ObstacleScan(distance, state, BEARINGS, 0.2, 20.0),
    hnp.arrays(np.float32, 72, elements=st.floats(0.0, 19.75, width=32)),
    hnp.arrays(np.uint8, 72, elements=st.integers(0, 2)),
)


def apart_deg(a: float, b: float) -> float:
    return abs((a - b + 180.0) % 360.0 - 180.0)


@cache
def touching(profile: AutopilotProfile, element: int) -> list[int]:
    """The scan's sectors that share an angle with an element, by the definition."""
    centre = profile.first_bearing_deg + element * profile.increment_deg
    return [k for k in range(72) if apart_deg(BEARINGS[k], centre) < profile.increment_deg / 2 + 2.5 - 1e-3]


@given(scans, profiles)
def test_an_obstacle_is_told_in_every_element_that_it_reaches_into(
    scan: ObstacleScan, profile: AutopilotProfile
) -> None:
    words = obstacle_words(scan, profile)
    told = {
        k: [int(words[j]) for j in range(profile.element_count) if k in touching(profile, j)]
        for k in np.flatnonzero(scan.state == SectorState.OBSTACLE)
    }
    for k, places in told.items():
        assert places, f"sector {k} is in no element"
        assert max(places) <= max(21, math.floor(float(scan.distance_m[k]) * 100 + 1e-3))


@given(scans, profiles)
def test_clear_is_told_only_where_everything_is_clear(scan: ObstacleScan, profile: AutopilotProfile) -> None:
    words = obstacle_words(scan, profile)
    for element in np.flatnonzero(words == CLEAR_WORD):
        assert element < profile.element_count
        assert all(scan.state[k] == SectorState.CLEAR for k in touching(profile, element))


@given(scans, profiles)
def test_every_word_is_legal_and_none_is_invented(scan: ObstacleScan, profile: AutopilotProfile) -> None:
    words = obstacle_words(scan, profile)
    sector_words = set(obstacle_words(scan, PX4).tolist())
    assert all(word in (CLEAR_WORD, UNKNOWN_WORD) or 20 < word < 2000 for word in words.tolist())
    assert set(words.tolist()) <= sector_words | {UNKNOWN_WORD}
    assert (words[profile.element_count :] == UNKNOWN_WORD).all()


@given(scans)
def test_px4_1_15_which_looks_at_one_element_per_10_degrees_sees_every_obstacle(scan: ObstacleScan) -> None:
    message = encode_obstacle_distance(scan, profile=PX4_LEGACY)
    looked_at = {
        bearing: message.distances[math.ceil((bearing - message.angle_offset) % 360.0 / message.increment_f)]
        for bearing in range(0, 360, 10)
    }
    for k in np.flatnonzero(scan.state == SectorState.OBSTACLE):
        near = [word for bearing, word in looked_at.items() if apart_deg(bearing, BEARINGS[k]) < 7.0]
        assert min(near) <= max(21, float(scan.distance_m[k]) * 100 + 1e-3)


def test_between_two_wide_elements_an_obstacle_is_in_both_and_unknown_beats_clear() -> None:
    distance, state = np.full(72, np.nan, np.float32), np.full(72, SectorState.CLEAR, np.uint8)
    at = {int(b): k for k, b in enumerate(BEARINGS)}
    state[at[5]], distance[at[5]] = SectorState.OBSTACLE, 3.0
    state[at[10]], distance[at[10]] = SectorState.OBSTACLE, 2.0
    state[at[-15]] = SectorState.UNKNOWN
    words = obstacle_words(ObstacleScan(distance, state, BEARINGS, 0.2, 20.0), PX4_LEGACY)
    by_bearing = {-180 + 10 * j: int(words[j]) for j in range(36)}
    assert by_bearing[0] == 300
    assert by_bearing[10] == 200
    assert by_bearing[20] == CLEAR_WORD
    assert by_bearing[-10] == by_bearing[-20] == UNKNOWN_WORD


@pytest.mark.parametrize(
    ("profile", "layout"),
    [(ARDUPILOT, (72, 5, -155.0)), (PX4, (72, 5, -155.0)), (PX4_LEGACY, (36, 10, -180.0))],
)
def test_the_messages_have_the_measured_layouts(
    profile: AutopilotProfile, layout: tuple[int, int, float]
) -> None:
    scan = ObstacleScan(
        np.full(72, np.nan, np.float32), np.full(72, SectorState.CLEAR, np.uint8), BEARINGS, 0.2, 20.0
    )
    message = encode_obstacle_distance(scan, profile=profile)
    count, increment, offset = layout
    assert (message.increment, message.increment_f, message.angle_offset) == (increment, increment, offset)
    assert message.frame == 12
    assert len(message.distances) == 72
    assert message.distances.count(CLEAR_WORD) == count


def test_profiles_never_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        PX4.increment_deg = 1.25  # type: ignore[misc]


@pytest.mark.parametrize(
    ("count", "increment", "text"),
    [(144, 2.5, "increment_deg is 2.5: at least 5 degrees"), (36, 5.0, "36 elements of 5 degrees are not")],
)
def test_a_layout_that_px4_reads_past_or_that_is_no_circle_is_refused(
    count: int, increment: float, text: str
) -> None:
    with pytest.raises(ScanError, match=text):
        AutopilotProfile("fan", count, increment, -90.0)
