"""Points at pixels: as planes and back, and in maps of another size."""

from __future__ import annotations

import numpy as np
import pytest

from uavdepth.model.point_pixels import PointPixels

WIDTH, HEIGHT = 32, 16


def planes() -> np.ndarray:
    made = np.zeros((2, HEIGHT, WIDTH), np.float32)
    for row, column, q, confidence in [(0, 0, 0.1, 0.5), (7, 31, 0.2, 1.0), (15, 4, 0.3, 0.25)]:
        made[:, row, column] = q, confidence
    return made


def test_planes_and_points_are_the_same_thing() -> None:
    points = PointPixels.of_planes(planes())
    assert len(points) == 3
    assert points.row.tolist() == [0, 7, 15]
    assert points.column.tolist() == [0, 31, 4]
    assert points.confidence.tolist() == [0.5, 1.0, 0.25]
    np.testing.assert_array_equal(points.planes, planes())


@pytest.mark.parametrize("channel", [0, 1])
def test_a_pixel_that_lacks_either_number_is_no_point(channel: int) -> None:
    made = planes()
    made[channel, 7, 31] = 0.0
    assert PointPixels.of_planes(made).row.tolist() == [0, 15]


def test_cells_of_a_smaller_picture_cover_the_points() -> None:
    row, column = PointPixels.of_planes(planes()).cells(WIDTH // 2, HEIGHT // 2)
    assert row.tolist() == [0, 3, 7]
    assert column.tolist() == [0, 15, 2]


def test_a_map_of_half_the_size_is_read_where_the_points_lie_in_it() -> None:
    points = PointPixels.of_planes(planes())
    rows, columns = np.mgrid[: HEIGHT // 2, : WIDTH // 2].astype(np.float32)
    # Full-size pixel i lies at (i + 0.5) / 2 - 0.5 of the half-size map, whose ends are repeated.
    assert points.sampled(rows) == pytest.approx([0.0, 3.25, 7.0])
    assert points.sampled(columns) == pytest.approx([0.0, 15.0, 1.75])


def test_a_map_of_the_same_size_is_read_as_it_is_and_no_points_read_nothing() -> None:
    values = np.arange(WIDTH * HEIGHT, dtype=np.float32).reshape(HEIGHT, WIDTH)
    values[7, 31] = np.nan
    found = PointPixels.of_planes(planes()).sampled(values)
    assert found[[0, 2]].tolist() == [0.0, 15.0 * WIDTH + 4.0]
    assert np.isnan(found[1])
    assert PointPixels.none(WIDTH, HEIGHT).sampled(values[:8]).shape == (0,)


def test_what_is_unknown_beside_a_point_makes_it_unknown() -> None:
    values = np.ones((HEIGHT // 2, WIDTH // 2), np.float32)
    values[3, 15] = np.nan
    assert np.isnan(PointPixels.of_planes(planes()).sampled(values)).tolist() == [False, True, False]
