"""ArduPilot's eight faces, each statement with the numbers that were measured on ArduCopter's simulator."""

from __future__ import annotations

import math

import pytest
from fake_support import one_word

from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.proximity_ardupilot import FaceBoundary, NotFiniteWordsError, face_of


def raw_faces_m(words: ObstacleWords) -> list[float | None]:
    faces = FaceBoundary()
    faces.update(words, 1000)
    return [None if (d := faces.raw_m(face)) is None else round(d, 3) for face in range(8)]


def words_at(values: dict[int, int], others: int = 65535, **fields: float) -> ObstacleWords:
    words = [values.get(element, others) for element in range(72)]
    return ObstacleWords(words, **{"offset_deg": 0.0, "min_distance_cm": 30, **fields})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("bearing_deg", "face"),
    [(0.0, 0), (22.4, 0), (22.6, 1), (-22.4, 0), (-22.6, 7), (45.0, 1), (180.0, 4), (-90.0, 6), (359.9, 0)],
)
def test_a_face_is_45_degrees_wide_and_the_first_lies_round_the_nose(bearing_deg: float, face: int) -> None:
    assert face_of(bearing_deg) == face


@pytest.mark.parametrize(
    ("word", "expected_m"),
    [
        *((word, None) for word in (0, 1, 29, 2001, 65534, 65535)),
        *((word, word / 100) for word in (30, 31, 1999, 2000)),
    ],
)
def test_only_words_within_the_range_are_obstacles_and_too_near_vanishes(
    word: int, expected_m: float | None
) -> None:
    assert raw_faces_m(one_word(0, word, min_distance_cm=30))[0] == expected_m


def test_a_range_without_end_takes_655_metres_and_a_range_of_nothing_takes_nothing() -> None:
    assert raw_faces_m(one_word(0, 65534, max_distance_cm=65535))[0] == 655.34
    faces = FaceBoundary()
    faces.update(one_word(0, 500, max_distance_cm=0), 1000)
    assert faces.raw_m(0) is None
    assert faces.is_healthy(1000)


def test_a_90_degree_fan_at_one_distance_fills_the_three_faces_ahead() -> None:
    fan = {element % 72: 500 for element in range(-9, 10)}
    assert raw_faces_m(words_at(fan)) == [5.0, 5.0, None, None, None, None, None, 5.0]


class TestOverwriteOrder:
    """A face visited twice in one message keeps its last visit only."""

    def test_an_array_that_begins_at_the_nose_loses_a_3_m_obstacle(self) -> None:
        assert raw_faces_m(words_at(dict.fromkeys(range(5), 300), others=1500))[0] == 15.0

    def test_the_sparse_case(self) -> None:
        assert raw_faces_m(words_at({0: 300, 4: 300, 36: 1500, 70: 900}))[0] == 9.0

    def test_without_a_valid_word_in_another_face_in_between_nothing_is_lost(self) -> None:
        values = dict.fromkeys(range(5), 300) | dict.fromkeys(range(68, 72), 1500)
        assert raw_faces_m(words_at(values))[0] == 3.0

    @pytest.mark.parametrize("offset_deg", [-180.0, -155.0, -157.5])
    def test_an_array_that_begins_behind_keeps_it(self, offset_deg: float) -> None:
        nose = round(-offset_deg / 5.0)
        values = dict.fromkeys(range(nose, nose + 5), 300)
        assert raw_faces_m(words_at(values, others=1500, offset_deg=offset_deg))[0] == 3.0


class TestAngles:
    @pytest.mark.parametrize(("bearing_deg", "face"), [(-30, 7), (-10, 0), (0, 0), (10, 0), (30, 1)])
    def test_a_pole_lands_in_its_face(self, bearing_deg: int, face: int) -> None:
        found = raw_faces_m(one_word(bearing_deg, 300))
        assert [index for index, distance in enumerate(found) if distance is not None] == [face]

    @pytest.mark.parametrize(
        ("fields", "element", "face"),
        [
            ({"increment_deg": 0, "increment_f_deg": 5.0}, 18, 2),
            ({"increment_deg": 5, "increment_f_deg": 0.0}, 18, 2),
            ({"increment_deg": 10, "increment_f_deg": 1.25}, 36, 1),
            ({"increment_f_deg": -5.0}, 18, 6),
            ({"increment_deg": 5, "increment_f_deg": 1e-30}, 18, 2),
            ({"offset_deg": 315.0}, 0, 7),
            ({"offset_deg": 400.0}, 0, 1),
            ({"offset_deg": -180.0}, 0, 4),
        ],
    )
    def test_increments_and_offsets(self, fields: dict[str, float], element: int, face: int) -> None:
        assert raw_faces_m(words_at({element: 500}, **fields))[face] == 5.0

    def test_elements_beyond_a_full_turn_are_ignored(self) -> None:
        assert raw_faces_m(words_at({36: 500}, increment_f_deg=10.0)) == [None] * 8

    def test_without_any_increment_the_message_is_ignored_and_not_healthy(self) -> None:
        faces = FaceBoundary()
        assert not faces.update(words_at({0: 500}, increment_deg=0, increment_f_deg=0.0), 1000)
        assert not faces.is_healthy(1000)

    @pytest.mark.parametrize("frame", [0, 1, 8, 12, 20])
    def test_the_frame_is_not_looked_at(self, frame: int) -> None:
        assert raw_faces_m(one_word(0, 500, frame=frame))[0] == 5.0

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
    @pytest.mark.parametrize("field", ["increment_f_deg", "offset_deg"])
    def test_a_float_that_is_not_finite_aborts_the_simulator(self, field: str, bad: float) -> None:
        with pytest.raises(NotFiniteWordsError, match="finite"):
            FaceBoundary().update(words_at({0: 500}, **{field: bad}), 1000)


class TestTime:
    def test_health_lasts_half_a_second_whatever_the_message_held(self) -> None:
        faces = FaceBoundary()
        faces.update(one_word(0, 65535), 1000)
        assert faces.is_healthy(1500)
        assert not faces.is_healthy(1521)

    def test_an_obstacle_goes_with_the_very_next_message_that_does_not_report_it(self) -> None:
        faces = FaceBoundary()
        faces.update(one_word(0, 500), 1000)
        faces.update(one_word(0, 65535), 1080)
        assert faces.raw_m(0) is None

    def test_faces_expire_between_1_and_1_75_seconds_after_the_last_message(self) -> None:
        ages_ms = set()
        for at_ms in range(1000, 1750, 10):
            faces = FaceBoundary()
            now_ms = 0
            while now_ms < at_ms:
                now_ms += 5
                faces.tick(now_ms)
            faces.update(one_word(0, 500), now_ms)
            while faces.raw_m(0) is not None:
                now_ms += 5
                faces.tick(now_ms)
            ages_ms.add(now_ms - at_ms)
        assert 1000 < min(ages_ms) < 1050
        assert 1700 < max(ages_ms) <= 1755

    @pytest.mark.parametrize(("share", "seconds"), [(0.63, 0.64), (0.90, 1.5)])
    def test_the_default_filter_follows_a_step_as_slowly_as_measured(
        self, share: float, seconds: float
    ) -> None:
        faces = FaceBoundary(filter_hz=0.25)
        period_ms = 1000.0 / 15.0
        faces.update(one_word(0, 1000), 0)
        faces.update(one_word(0, 500), round(period_ms))
        at_ms = 0.0
        while (faces.filtered_m(0) or 0.0) > 10.0 - 5.0 * share:
            at_ms += period_ms
            faces.update(one_word(0, 500), round(period_ms + at_ms))
        assert at_ms / 1000.0 == pytest.approx(seconds, abs=0.1)

    def test_without_a_filter_the_face_is_the_reading(self) -> None:
        faces = FaceBoundary(filter_hz=0.0)
        faces.update(one_word(0, 1000), 0)
        faces.update(one_word(0, 500), 66)
        assert faces.filtered_m(0) == pytest.approx(5.0)

    def test_a_face_that_was_open_for_over_a_second_starts_anew_at_the_reading(self) -> None:
        faces = FaceBoundary(filter_hz=0.25)
        faces.update(one_word(0, 1000), 0)
        faces.update(one_word(0, 500), 1001)
        assert faces.filtered_m(0) == pytest.approx(5.0)


class TestEcho:
    def test_it_is_unfiltered_and_truncated(self) -> None:
        faces = FaceBoundary(filter_hz=0.25)
        faces.update(one_word(0, 1000, min_distance_cm=30), 0)
        faces.update(one_word(0, 500, min_distance_cm=30), 66)
        (echo,) = faces.echo(66)
        assert (echo.face, echo.distance_cm, echo.min_distance_cm, echo.max_distance_cm) == (0, 500, 29, 2000)

    @pytest.mark.parametrize(("word", "echoed"), [(30, 29), (31, 31), (300, 300), (65534, 65533)])
    def test_30_cm_comes_back_as_29(self, word: int, echoed: int) -> None:
        faces = FaceBoundary()
        faces.update(one_word(0, word, min_distance_cm=30, max_distance_cm=65535), 0)
        assert faces.echo(0)[0].distance_cm == echoed

    def test_a_face_that_lost_its_reading_is_sent_as_max_while_another_holds_one(self) -> None:
        faces = FaceBoundary()
        faces.update(one_word(0, 500), 0)
        faces.update(one_word(90, 700), 100)
        assert [(e.face, e.distance_cm) for e in faces.echo(100)] == [(0, 2000), (2, 700)]

    def test_all_clear_and_no_data_look_alike_there(self) -> None:
        faces = FaceBoundary()
        faces.update(one_word(0, 500), 0)
        faces.update(one_word(0, 2001, others=2001), 100)
        assert faces.echo(100) == []
        assert faces.is_healthy(100)

    def test_it_stops_with_the_health(self) -> None:
        faces = FaceBoundary()
        faces.update(one_word(0, 500), 0)
        assert faces.echo(500) != []
        assert faces.echo(521) == []
