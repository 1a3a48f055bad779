"""`uavdepth doctor --fix`: what the ground station will load."""

from __future__ import annotations

import struct

import pytest
from doctor_bench import Bench
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.doctor.parameter_file import parameter_file
from service.doctor.parameter_reader import ParameterReader


def file_of(bench: Bench) -> str:
    seen = bench.run(4.0)
    return parameter_file(bench.findings().values(), seen)


def active_lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith("#")]


def test_ardupilots_file_changes_what_is_wrong_and_nothing_else() -> None:
    text = file_of(Bench(PRX1_TYPE=0, AVOID_ENABLE=4, PRX_FILT=0.25))
    assert active_lines(text) == ["PRX1_TYPE,2", "PRX_FILT,0", "AVOID_ENABLE,7", "AVOID_MARGIN,2.6"]
    assert "# AVOID_BEHAVE is 1 already" in text
    assert "1.16 m instead of 2.15 m" in text  # the reason stands beside the value


def test_px4s_file_is_qgroundcontrols_with_the_types_that_px4_has() -> None:
    text = file_of(Bench("px4", CP_DIST=-1.0, MAV_SYS_ID=3, CP_DELAY=0.1))
    assert active_lines(text) == [
        "3\t1\tCP_DIST\t3\t9",
        "3\t1\tCP_DELAY\t0.4\t9",
        "3\t1\tMAV_SYS_ID\t1\t6",
    ]
    assert "# CP_GO_NO_DATA:" in text  # a choice of the pilot's is never written


def test_loading_the_file_ends_the_failures() -> None:
    broken = Bench(PRX1_TYPE=0, PRX1_ORIENT=1, PRX1_YAW_CORR=90, AVOID_ENABLE=0, AVOID_MARGIN=0.5)
    changes = dict(line.split(",") for line in active_lines(file_of(broken)))
    repaired = Bench(**{name: float(value) for name, value in changes.items()})
    assert active_lines(file_of(repaired)) == []


def test_parameters_that_did_not_answer_are_comments() -> None:
    bench = Bench(loses=lambda message: getattr(message, "param_id", "") == "PRX1_TYPE")
    bench.run(4.0)
    text = file_of(bench)
    assert "# PRX1_TYPE was not answered" in text
    assert not any(line.startswith("PRX1_TYPE") for line in text.splitlines())


@pytest.mark.parametrize(
    ("kind", "word", "value"),
    [
        (mavlink.MAV_PARAM_TYPE_INT32, struct.pack("<i", -3), -3.0),
        (mavlink.MAV_PARAM_TYPE_UINT8, b"\xc8\0\0\0", 200.0),
        (mavlink.MAV_PARAM_TYPE_INT8, b"\xff\0\0\0", -1.0),
        (mavlink.MAV_PARAM_TYPE_REAL32, struct.pack("<f", 0.25), 0.25),
    ],
)
def test_px4s_whole_numbers_are_read_byte_by_byte(kind: int, word: bytes, value: float) -> None:
    reader = ParameterReader(["A"], bytewise=True)
    (number,) = struct.unpack("<f", word)
    reader.on_value(mavlink.MAVLink_param_value_message(b"A", number, kind, 1, 0))
    assert reader.values == {"A": value}


def test_ardupilots_whole_numbers_are_the_values_themselves() -> None:
    reader = ParameterReader(["A"], bytewise=False)
    reader.on_value(mavlink.MAVLink_param_value_message(b"A", 7.0, mavlink.MAV_PARAM_TYPE_INT8, 1, 0))
    assert reader.values == {"A": 7.0}


def test_a_value_that_is_no_number_is_no_answer() -> None:
    reader = ParameterReader(["A"], bytewise=False)
    reader.on_value(
        mavlink.MAVLink_param_value_message(b"A", float("nan"), mavlink.MAV_PARAM_TYPE_REAL32, 1, 0)
    )
    assert reader.unanswered == ("A",)
