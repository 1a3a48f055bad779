"""The scale through pictures that do not show it."""

from __future__ import annotations

import math

import pytest

from uavdepth import GroundScale, ScaleTracker

SECOND = 1_000_000_000


def test_nothing_is_known_before_the_first_estimate():
    assert ScaleTracker().update(None, 5 * SECOND) is None


def test_the_first_estimate_is_taken_as_it_is():
    estimate = GroundScale(2.0, 0.05, 100)
    assert ScaleTracker().update(estimate, 5 * SECOND) == estimate


def test_a_scale_is_held_while_doubt_grows_and_then_dropped():
    tracker = ScaleTracker(max_age_s=2.0)
    tracker.update(GroundScale(2.0, 0.05, 100), 0)
    held = [tracker.update(None, int(age * SECOND)) for age in (0.1, 1.0, 2.0)]
    assert [scale.factor for scale in held] == [2.0, 2.0, 2.0]
    sigmas = [scale.relative_sigma for scale in held]
    assert 0.05 < sigmas[0] < sigmas[1] < sigmas[2]
    assert tracker.update(None, int(2.01 * SECOND)) is None


def test_a_dropped_scale_does_not_come_back():
    tracker = ScaleTracker(max_age_s=2.0)
    tracker.update(GroundScale(2.0, 0.05, 100), 0)
    tracker.update(None, 3 * SECOND)
    fresh = GroundScale(7.0, 0.05, 100)
    assert tracker.update(fresh, 4 * SECOND) == fresh


def test_one_wild_estimate_moves_it_little_and_raises_doubt():
    tracker = ScaleTracker()
    tracker.update(GroundScale(1.0, 0.03, 100), 0)
    jumped = tracker.update(GroundScale(2.0, 0.03, 100), SECOND // 15)
    assert 1.0 < jumped.factor < 1.25
    assert jumped.relative_sigma > 0.1


def test_it_follows_a_lasting_change_within_a_second():
    tracker = ScaleTracker()
    for frame in range(30):
        now = tracker.update(GroundScale(1.0 if frame < 10 else 2.0, 0.03, 100), frame * SECOND // 15)
    assert now.factor == pytest.approx(2.0, rel=0.03)


def test_up_and_down_count_alike():
    results = []
    for factor in (2.0, 0.5):
        tracker = ScaleTracker()
        tracker.update(GroundScale(1.0, 0.03, 100), 0)
        results.append(math.log(tracker.update(GroundScale(factor, 0.03, 100), SECOND // 10).factor))
    assert results[0] == pytest.approx(-results[1])


def test_a_step_back_in_time_starts_anew():
    tracker = ScaleTracker()
    tracker.update(GroundScale(1.0, 0.03, 100), 10 * SECOND)
    assert tracker.update(None, 9 * SECOND) is None


@pytest.mark.parametrize("age", [-1.0, math.nan, math.inf])
def test_an_impossible_age_is_refused(age):
    with pytest.raises(ValueError, match="max_age_s"):
        ScaleTracker(max_age_s=age)
