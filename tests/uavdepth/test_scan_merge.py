"""Several cameras make one message: the nearest counts, and doubt stays doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from elements import element, obstacles
from hypothesis import given, settings
from hypothesis import strategies as st
from scan_strategies import scan_of, scans, single
from solids import box, depth_of, ground, pole

from uavdepth import CameraMount, ObstacleScanner, ScanError, SectorState, obstacle_words
from uavdepth.scan.merge import merge_scans

OBSTACLE, CLEAR, UNKNOWN = SectorState.OBSTACLE, SectorState.CLEAR, SectorState.UNKNOWN


def test_r12_two_cameras_make_one_message_with_the_minimum_of_each_element(camera, level):
    things = [ground(4), pole(-30, 6.0, 0.1), pole(30, 7.0, 0.1), box((4.8, -0.2, -9), (5, 0.2, 9))]
    views = []
    for yaw in (-40, 40):
        mount = CameraMount(yaw_deg=yaw)
        views.append(ObstacleScanner(camera, mount).scan(depth_of(things, camera, mount, level), level, 4.0))
    merged = merge_scans(views)
    assert obstacles(merged) == sorted({*obstacles(views[0]), *obstacles(views[1])})
    assert {element(-30), element(0), element(30)} <= set(obstacles(merged))
    words = np.minimum(obstacle_words(views[0]), obstacle_words(views[1]))
    np.testing.assert_array_equal(obstacle_words(merged), words)
    assert merged.state[element(70)] == CLEAR
    assert merged.state[element(120)] == UNKNOWN


def test_r12_two_halves_of_an_element_do_not_make_it_clear(camera, level):
    # The pictures of 90 degrees meet at the middle of the element ahead: each sees one half of it.
    sky = np.full((320, 640), np.inf, np.float32)
    views = [ObstacleScanner(camera, CameraMount(yaw_deg=yaw)).scan(sky, level) for yaw in (-45, 45)]
    merged = merge_scans(views)
    assert merged.state[element(0)] == UNKNOWN
    assert (merged.state[[element(-5), element(5)]] == CLEAR).all()


def test_an_obstacle_without_a_distance_is_doubt_that_no_other_camera_lifts():
    lost = replace(single(10, 5.0), distance_m=np.full(72, np.nan, np.float32))
    assert merge_scans([lost, single(-10, 5.0)]).state[element(10)] == UNKNOWN
    assert merge_scans([lost, single(10, 5.0)]).distance_m[element(10)] == 5.0


@settings(max_examples=40)
@given(st.lists(scans, min_size=1, max_size=4))
def test_r12_merging_takes_the_minimum_and_never_makes_clear_of_what_no_camera_called_clear(views):
    merged = merge_scans(views)
    states = np.stack([view.state for view in views])
    np.testing.assert_array_equal(merged.state == OBSTACLE, (states == OBSTACLE).any(axis=0))
    seen = merged.state == OBSTACLE
    nearest = np.nanmin([view.distance_m[seen] for view in views], axis=0) if seen.any() else []
    np.testing.assert_array_equal(merged.distance_m[seen], nearest)
    assert np.isnan(merged.distance_m[~seen]).all()
    assert ((states == CLEAR).any(axis=0) | (merged.state != CLEAR)).all()


@settings(max_examples=40)
@given(st.permutations(range(3)), st.tuples(scans, scans, scans))
def test_the_order_of_the_cameras_does_not_matter(order, views):
    merged, shuffled = merge_scans(views), merge_scans([views[number] for number in order])
    np.testing.assert_array_equal(merged.state, shuffled.state)
    np.testing.assert_array_equal(merged.distance_m, shuffled.distance_m)


def test_what_cannot_be_merged_is_refused():
    scan = single(0, 5.0)
    with pytest.raises(ScanError, match="at least 1"):
        merge_scans([])
    with pytest.raises(ScanError, match=r"0\.2 to 20\.0 m and of 0\.2 to 30\.0 m"):
        merge_scans([scan, replace(scan, max_distance_m=30.0)])
    with pytest.raises(ScanError, match=r"state has the shape \(36,\)"):
        merge_scans([scan, replace(scan, state=np.zeros(36, np.uint8))])
    np.testing.assert_array_equal(merge_scans([scan]).state, scan_of(5.0, scan.state).state)
