"""Portable float maps: what is written is read, and nothing broken passes for depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.pfm import read_pfm, write_pfm

MAPS = arrays.arrays(
    np.float32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.floats(width=32, allow_nan=True)
)


@given(MAPS)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_map_is_read_as_it_was_written(tmp_path: Path, values: NDArray[np.float32]) -> None:
    write_pfm(tmp_path / "map.pfm", values)
    np.testing.assert_array_equal(read_pfm(tmp_path / "map.pfm"), values)


@given(MAPS, st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_truncated_map_is_read(tmp_path: Path, values: NDArray[np.float32], data: st.DataObject) -> None:
    path = tmp_path / "map.pfm"
    write_pfm(path, values)
    content = path.read_bytes()
    path.write_bytes(content[: data.draw(st.integers(0, len(content) - 1))])
    with pytest.raises(BrokenFrameError, match=r"map\.pfm"):
        read_pfm(path)


def test_the_first_row_in_the_file_is_the_bottom_of_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "map.pfm"
    path.write_bytes(b"Pf\n2 2\n-1.0\n" + np.array([3, 4, 1, 2], "<f4").tobytes())
    assert read_pfm(path).tolist() == [[1.0, 2.0], [3.0, 4.0]]


def test_a_positive_scale_means_big_endian(tmp_path: Path) -> None:
    path = tmp_path / "map.pfm"
    path.write_bytes(b"Pf\n2 1\n1\n" + np.array([3, 4], ">f4").tobytes())
    assert read_pfm(path).tolist() == [[3.0, 4.0]]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "not a portable float map"),
        (b"P5\n2 1\n255\n\x00\x00", "not a portable float map"),
        (b"PF\n1 1\n-1.0\n" + bytes(12), "three channels"),
        (b"Pf\n0 1\n-1.0\n", "0 x 1"),
        (b"Pf\n99999 99999\n-1.0\n", "99999"),
        (b"Pf\n1 1\n0.0\n" + bytes(4), "scale 0"),
        (b"Pf\n2 1\n-1.0\n" + bytes(9), "holds 9 bytes"),
    ],
)
def test_a_broken_map_is_named_with_what_is_wrong(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "broken.pfm"
    path.write_bytes(content)
    with pytest.raises(BrokenFrameError, match=said) as raised:
        read_pfm(path)
    assert "broken.pfm" in str(raised.value)


def test_a_missing_map_is_named(tmp_path: Path) -> None:
    with pytest.raises(BrokenFrameError, match=r"nowhere\.pfm"):
        read_pfm(tmp_path / "nowhere.pfm")


def test_a_picture_of_three_channels_is_not_written_as_a_map(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match=r"\(2, 2, 3\)"):
        write_pfm(tmp_path / "map.pfm", np.zeros((2, 2, 3), np.float32))
