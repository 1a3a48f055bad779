"""PX4's map of 72 bins, each statement with what was measured on v1.18's simulator."""

from __future__ import annotations

import pytest
from fake_support import one_word

from service.fake_autopilot.obstacle_map_px4 import ObstacleMap, UnsupportedFrameError
from service.fake_autopilot.obstacle_words import ObstacleWords

POLE_CM, OTHERS_CM = 300, 2000


def map_of(words: ObstacleWords, yaw_deg: float = 0.0) -> ObstacleMap:
    known = ObstacleMap()
    known.update(words, 0.0, yaw_deg)
    return known


def lost_poles(count: int, increment: float, offset_deg: float) -> list[float]:
    """Bearings of the one-element poles that are in no bin afterwards."""
    lost = []
    for element in range(count):
        words = [OTHERS_CM] * count + [65535] * (72 - count)
        words[element] = POLE_CM
        message = ObstacleWords(words, 0, increment, offset_deg, min_distance_cm=30, max_distance_cm=4000)
        if POLE_CM not in map_of(message).distances_cm:
            lost.append(element * increment + offset_deg)
    return lost


@pytest.mark.parametrize(
    ("count", "increment", "offset_deg", "lost"),
    [
        (72, 5, -155, []),
        (72, 5, -180, []),
        (72, 5, 0, []),
        (72, 5, -45, []),
        (72, 5, -177.5, [-177.5, -2.5]),
        (72, 5, -157.5, [-157.5, -2.5]),
        (72, 5, 2.5, [2.5]),
        (36, 10, -180, []),
        (36, 10, 0, []),
        (36, 10, -175, [-5]),
        (60, 6, -180, []),
        (24, 15, -180, []),
    ],
)
def test_which_poles_a_layout_loses(
    count: int, increment: float, offset_deg: float, lost: list[float]
) -> None:
    assert lost_poles(count, increment, offset_deg) == lost


@pytest.mark.parametrize(("increment", "offset_deg", "lost"), [(1.25, -45.0, 55), (2.5, -90.0, 37)])
def test_fine_fans_lose_most_poles_and_those_ahead_all(
    increment: float, offset_deg: float, lost: int
) -> None:
    bearings = lost_poles(72, increment, offset_deg)
    assert len(bearings) == lost
    assert {-30.0, -10.0, 0.0, 10.0, 30.0} <= set(bearings)


def test_below_5_degrees_it_reads_past_the_array_and_sees_phantoms() -> None:
    fan = map_of(ObstacleWords([4001] * 72, 0, 1.25, -45.0, 30, 4000))
    assert fan.distance_m(0) == float("inf")
    assert fan.distance_m(36) == 0.0


def test_the_last_overlapping_element_wins_not_the_nearest() -> None:
    words = [65535] * 72
    words[31], words[32] = 300, 2000
    # Elements of 2.5 degrees at -2.5 and 0 both lie in the bin of the nose.
    message = ObstacleWords(words, 0, 2.5, -80.0, 30, 4000, frame=0)
    assert map_of(message).distance_m(0) == 20.0


@pytest.mark.parametrize(("bearing_deg", "bin_index"), [(-30, 66), (-10, 70), (0, 0), (10, 2), (30, 6)])
def test_a_pole_lands_in_its_bin(bearing_deg: int, bin_index: int) -> None:
    known = map_of(one_word(bearing_deg, 300, others=2001))
    assert [i for i, word in enumerate(known.distances_cm) if word == 300] == [bin_index]


class TestFrames:
    def test_the_body_frame_does_not_turn_with_the_vehicle(self) -> None:
        assert map_of(one_word(0, 300), yaw_deg=97.0).distance_m(0) == 3.0

    @pytest.mark.parametrize("frame", [0, 1])
    def test_frames_0_and_1_point_north(self, frame: int) -> None:
        known = map_of(one_word(0, 300, frame=frame), yaw_deg=97.0)
        bins = [i for i, word in enumerate(known.distances_cm) if word == 300]
        assert {round((5 * i + 180) % 360 - 180) for i in bins} == {-100, -95}

    @pytest.mark.parametrize("frame", [8, 20, 21])
    def test_other_frames_are_refused_in_px4s_words(self, frame: int) -> None:
        with pytest.raises(UnsupportedFrameError, match=f"unsupported frame {frame}"):
            map_of(one_word(0, 300, frame=frame))


class TestWords:
    @pytest.mark.parametrize("word", [0, 1, 29, 30, 300, 3999])
    def test_everything_below_max_is_an_obstacle_zero_too(self, word: int) -> None:
        known = map_of(one_word(0, word, min_distance_cm=30, max_distance_cm=4000))
        assert known.distance_m(0) == word / 100.0

    @pytest.mark.parametrize("word", [4000, 4001, 65534])
    def test_max_and_above_is_free(self, word: int) -> None:
        assert map_of(one_word(0, word, max_distance_cm=4000)).distance_m(0) == float("inf")

    def test_unknown_does_not_clear_a_bin(self) -> None:
        known = map_of(one_word(0, 300))
        known.update(one_word(0, 65535), 0.1)
        assert known.distance_m(0) == 3.0

    def test_a_bin_goes_between_0_4_and_0_5_s_after_its_last_update(self) -> None:
        known = map_of(one_word(0, 300))
        known.tick(0.4)
        assert known.distance_m(0) == 3.0
        known.tick(0.5)
        assert known.distance_m(0) is None

    def test_after_max_was_lowered_clear_is_never_accepted_but_readings_are(self) -> None:
        known = map_of(one_word(0, 4001, others=4001, max_distance_cm=4000))
        lower = one_word(0, 1500, others=2001, max_distance_cm=2000)
        for step in range(1, 20):
            known.tick(step * 0.1)
            known.update(lower, step * 0.1)
        assert known.distance_m(0) == 15.0
        assert known.distance_m(36) is None
        known.reset()
        known.update(lower, 2.0)
        assert known.distance_m(36) == float("inf")

    def test_the_map_remembers_the_largest_max_and_the_smallest_min(self) -> None:
        known = map_of(one_word(0, 300, min_distance_cm=30, max_distance_cm=4000))
        known.update(one_word(0, 300, min_distance_cm=50, max_distance_cm=2000), 0.1)
        assert (known.min_distance_cm, known.max_distance_cm) == (30, 4000)

    @pytest.mark.parametrize(
        ("increment", "increment_f", "taken"),
        [(5, 0.0, True), (5, -5.0, True), (0, 5.0, True), (0, 0.0, False)],
    )
    def test_the_float_increment_counts_when_positive(
        self, increment: int, increment_f: float, taken: bool
    ) -> None:
        known = ObstacleMap()
        words = one_word(0, 300, increment_deg=increment, increment_f_deg=increment_f)
        assert known.update(words, 0.0) is taken
        assert known.knows_anything is taken
