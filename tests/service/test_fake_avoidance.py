"""What ArduPilot's simple avoidance and PX4's Collision Prevention let pass."""

from __future__ import annotations

import math

import pytest
from fake_support import one_word
from hypothesis import given
from hypothesis import strategies as st

from service.fake_autopilot.avoidance_ardupilot import limit_velocity, safe_speed_mps
from service.fake_autopilot.collision_prevention_px4 import CollisionPrevention, Stick
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.parameters import PX4_DEFAULTS

OPEN: tuple[float | None, ...] = (None,) * 8
speeds = st.floats(-15.0, 15.0)
faces = st.lists(st.one_of(st.none(), st.floats(0.3, 30.0)), min_size=8, max_size=8)


def ahead(distance_m: float) -> tuple[float | None, ...]:
    return (distance_m, *OPEN[1:])


class TestArduPilot:
    @pytest.mark.parametrize(("distance_m", "speed_mps"), [(8.0, 3.3), (15.0, 5.0), (20.0, 5.9)])
    def test_the_speed_that_2_m_of_margin_allow(self, distance_m: float, speed_mps: float) -> None:
        assert safe_speed_mps(distance_m - 2.0) == pytest.approx(speed_mps, abs=0.05)

    def test_at_the_margin_and_inside_it_nothing_is_allowed(self) -> None:
        assert safe_speed_mps(0.0) == 0.0
        assert safe_speed_mps(-1.0) == 0.0

    def test_no_data_leaves_every_velocity_as_it_is(self) -> None:
        assert limit_velocity(7.0, -3.0, OPEN, margin_m=2.0) == (7.0, -3.0)

    def test_flying_away_from_an_obstacle_is_free(self) -> None:
        assert limit_velocity(-5.0, 0.0, ahead(3.0), margin_m=2.0) == (-5.0, 0.0)

    def test_stop_scales_the_whole_velocity_and_slide_only_what_leads_into_it(self) -> None:
        diagonal = (2.0, 3.0)
        stopped = limit_velocity(*diagonal, ahead(2.5), margin_m=2.0)
        assert stopped[1] / stopped[0] == pytest.approx(1.5)
        assert stopped[0] == pytest.approx(0.4)
        slid = limit_velocity(*diagonal, ahead(2.5), margin_m=2.0, slide=True)
        assert slid == pytest.approx((0.4, 3.0))

    def test_inside_the_margin_it_backs_away_but_never_faster_than_its_parameter(self) -> None:
        assert limit_velocity(0.0, 0.0, ahead(1.91), margin_m=2.0)[0] == pytest.approx(-0.38)
        assert limit_velocity(3.0, 0.0, ahead(0.5), margin_m=2.0)[0] == pytest.approx(-0.75)

    @given(forward=speeds, right=speeds, distances=faces)
    def test_stop_never_makes_a_velocity_larger_unless_it_backs_away(
        self, forward: float, right: float, distances: list[float | None]
    ) -> None:
        far = [None if d is None else d + 2.2 for d in distances]
        limited = limit_velocity(forward, right, far, margin_m=2.0)
        assert math.hypot(*limited) <= math.hypot(forward, right) + 1e-9


def prevention(words: ObstacleWords | None, **parameters: float) -> CollisionPrevention:
    made = CollisionPrevention({**PX4_DEFAULTS, "CP_DIST": 5.0, **parameters})
    made.enter(0.0)
    if words is not None:
        made.map.update(words, 0.0)
    return made


def sector(word: int, others: int, half_width_deg: int, **fields: int) -> ObstacleWords:
    words = [word if abs((5 * e - 155 + 180) % 360 - 180) <= half_width_deg else others for e in range(72)]
    return ObstacleWords(words, max_distance_cm=4000, min_distance_cm=fields.get("min_distance_cm", 30))


FORWARD = Stick(1.0, 0.0)
STILL = (0.0, 0.0)
WANTED = (3.0, 0.0)


class TestPx4:
    def test_far_from_everything_the_stick_is_flown(self) -> None:
        assert prevention(one_word(0, 2001, others=2001)).constrain(WANTED, STILL, FORWARD, 0.1) == WANTED

    def test_without_any_message_it_does_not_move(self) -> None:
        assert prevention(None).constrain(WANTED, STILL, FORWARD, 0.1) == STILL

    def test_the_acceleration_ends_0_53_s_after_the_last_message(self) -> None:
        made = prevention(sector(2000, 4001, 180))
        assert made.constrain(WANTED, STILL, FORWARD, 0.52) == pytest.approx(WANTED)
        assert made.constrain(WANTED, STILL, FORWARD, 0.54) == STILL

    @pytest.mark.parametrize(("word", "least_mps2", "most_mps2"), [(300, -2.0, -1.0), (31, -4.0, -3.0)])
    def test_inside_cp_dist_it_pushes_backwards_the_harder_the_nearer(
        self, word: int, least_mps2: float, most_mps2: float
    ) -> None:
        limited = prevention(sector(word, 4001, 5)).constrain(WANTED, STILL, FORWARD, 0.1)
        assert limited is not None
        assert least_mps2 < limited[0] < most_mps2

    def test_with_the_stick_centred_nothing_pushes(self) -> None:
        assert prevention(sector(31, 4001, 5)).constrain(STILL, STILL, Stick(), 0.1) == STILL

    def test_something_behind_does_not_matter_to_a_stick_forward(self) -> None:
        behind = one_word(180, 20, others=4001, max_distance_cm=4000)
        assert prevention(behind).constrain(WANTED, STILL, FORWARD, 0.1) == pytest.approx(WANTED)

    @pytest.mark.parametrize(
        "words",
        [sector(0, 0, 180), sector(20, 20, 180), sector(30, 30, 180), sector(30, 65535, 45)],
        ids=["all 0", "all 20", "all min", "95 degrees of min"],
    )
    def test_all_known_at_or_below_min_loses_the_set_point_until_position_mode_is_entered_again(
        self, words: ObstacleWords
    ) -> None:
        made = prevention(words)
        assert made.constrain(WANTED, STILL, FORWARD, 0.1) is None
        made.map.update(sector(4001, 4001, 180), 0.2)
        assert made.constrain(WANTED, STILL, FORWARD, 0.2) is None
        made.enter(0.3)
        made.map.update(sector(4001, 4001, 180), 0.3)
        assert made.constrain(WANTED, STILL, FORWARD, 0.3) == WANTED

    def test_the_set_point_survives_with_the_stick_centred_or_one_bin_above_min(self) -> None:
        assert prevention(sector(30, 30, 180)).constrain(STILL, STILL, Stick(), 0.1) == STILL
        assert prevention(sector(31, 30, 5)).constrain(WANTED, STILL, FORWARD, 0.1) is not None

    @pytest.mark.parametrize(("go_no_data", "moves"), [(0, False), (1, True)])
    def test_a_wide_unknown_sector_is_entered_only_with_go_no_data(
        self, go_no_data: int, moves: bool
    ) -> None:
        made = prevention(sector(65535, 4001, 45), CP_GO_NO_DATA=go_no_data)
        assert (made.constrain(WANTED, STILL, FORWARD, 0.1) == WANTED) is moves

    def test_but_not_where_there_ever_was_data(self) -> None:
        made = prevention(sector(4001, 4001, 180), CP_GO_NO_DATA=1)
        for step in range(1, 8):
            made.map.update(sector(65535, 4001, 45), step * 0.1)
            made.map.tick(step * 0.1)
        assert made.constrain(WANTED, STILL, FORWARD, 0.7) == STILL

    @pytest.mark.parametrize("go_no_data", [0, 1])
    def test_all_unknown_does_not_move_with_either_setting(self, go_no_data: int) -> None:
        made = prevention(sector(65535, 65535, 180), CP_GO_NO_DATA=go_no_data)
        assert made.constrain(WANTED, STILL, FORWARD, 0.1) == STILL

    def test_hold_is_wanted_5_to_6_seconds_after_the_last_message(self) -> None:
        made = prevention(sector(4001, 4001, 180))
        assert not made.wants_hold(5.0)
        assert made.wants_hold(6.0)
