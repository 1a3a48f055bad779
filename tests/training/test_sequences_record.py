"""Recorded flights as video to learn from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from training.errors import TrainingDataError
from training.sequences.calibration import Calibration
from training.sequences.opening import open_sequences, open_triplets
from training.sequences.record import open_record
from uavdepth.camera import CameraModel

FLIGHTS = Path(__file__).parents[2] / "sitl_logs" / "flights"
FLIGHT = FLIGHTS / "reboot.mcap"


def test_a_recorded_flight_is_a_sequence_of_its_camera() -> None:
    (flight,) = open_record(FLIGHT)
    assert flight.name == "reboot"
    assert len(flight) == 60
    assert flight.camera == CameraModel.from_fov(384, 192, 90.0)
    assert flight.truth_m(0) is None
    assert flight.file_of(3) == FLIGHT


def test_single_pictures_are_those_of_the_stream() -> None:
    (flight,) = open_record(FLIGHTS / "forest.mcap")
    streamed = list(flight.images_bgr())
    assert len(streamed) == len(flight)
    for index in (0, 31, 87):
        np.testing.assert_array_equal(flight.image_bgr(index), streamed[index])
    assert not np.array_equal(streamed[0], streamed[31])


def test_all_records_of_a_folder_make_triplets() -> None:
    flights = open_sequences("record", FLIGHTS)
    assert len(flights) == len(list(FLIGHTS.glob("*.mcap")))
    triplets = open_triplets("record", FLIGHT)
    assert len(triplets.triplets) == 58


def test_what_is_no_record_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no records"):
        open_record(tmp_path)
    with pytest.raises(TrainingDataError, match=r"no record at .*a\.mcap"):
        open_record(tmp_path / "a.mcap")
    (tmp_path / "a.mcap").write_bytes(b"not a record")
    with pytest.raises(TrainingDataError, match="uavdepth recover"):
        open_record(tmp_path / "a.mcap")
    with pytest.raises(TrainingDataError, match="own calibration"):
        open_sequences("record", FLIGHT, Calibration(horizontal_fov_deg=90.0))


@pytest.mark.parametrize("share", [0.02, 0.5, 0.98])
def test_a_record_that_is_cut_off_is_named_with_what_rescues_it(tmp_path: Path, share: float) -> None:
    content = FLIGHT.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: int(share * len(content))])
    with pytest.raises(TrainingDataError, match="uavdepth recover"):
        open_record(tmp_path / "cut.mcap")
