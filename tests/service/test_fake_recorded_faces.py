"""The ArduPilot model, fed with what a companion sent in a recorded flight, holds what ArduPilot logged."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
from fake_support import LOGS, boot_clock, read_tlog
from pymavlink import DFReader

from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.proximity_ardupilot import FACE_COUNT, FaceBoundary

FLIGHT = "A_hover_and_forward"
FACE_FIELDS = ("D0", "D45", "D90", "D135", "D180", "D225", "D270", "D315")
OPEN_M = 20.0
"""What the log holds for a face without a reading: the message's max_distance."""

RACE_MS = 4.0
"""A log row this near to a message may hold the state before or after it: the clocks of host and autopilot
are only joined to within a millisecond or two, and the autopilot reads its link at its own pace."""

RAW_TOLERANCE_M = 0.02
FILTERED_TOLERANCE_M = 0.10


@dataclass(frozen=True)
class Faces:
    """Eight distances at a time since boot."""

    at_ms: float
    raw_m: tuple[float, ...]
    filtered_m: tuple[float, ...]


@pytest.fixture(scope="module")
def modelled() -> list[Faces]:
    """The model after each message of the companion."""
    to_boot_us = boot_clock(f"{FLIGHT}.tlog")
    faces = FaceBoundary(filter_hz=0.25)
    states = []
    for host_us, message in read_tlog(f"{FLIGHT}.companion_tx.tlog", ["OBSTACLE_DISTANCE"]):
        at_ms = to_boot_us(host_us) / 1000.0
        faces.tick(int(at_ms))
        faces.update(ObstacleWords.from_message(message), int(at_ms))
        raw = tuple(OPEN_M if (d := faces.raw_m(face)) is None else d for face in range(FACE_COUNT))
        filtered = tuple(OPEN_M if (d := faces.filtered_m(face)) is None else d for face in range(FACE_COUNT))
        states.append(Faces(at_ms, raw, filtered))
    return states


@pytest.fixture(scope="module")
def logged() -> dict[str, list[tuple[float, tuple[float, ...]]]]:
    """Rows of the autopilot's own log: milliseconds since boot, eight distances."""
    log = DFReader.DFReader_binary(str(LOGS / f"{FLIGHT}.BIN"))
    rows: dict[str, list[tuple[float, tuple[float, ...]]]] = {"PRX": [], "PRXR": []}
    while (row := log.recv_match(type=["PRX", "PRXR"])) is not None:
        distances = tuple(float(getattr(row, field)) for field in FACE_FIELDS)
        rows[row.get_type()].append((row.TimeUS / 1000.0, distances))
    return rows


def errors_m(
    rows: list[tuple[float, tuple[float, ...]]], states: list[Faces], attribute: str, race_ms: float
) -> list[float]:
    """For each row the largest error of its faces, against the best state of those within the race."""
    found = []
    for at_ms, distances in rows:
        newest = max(index for index, state in enumerate(states) if state.at_ms <= at_ms)
        candidates = [newest]
        if at_ms - states[newest].at_ms < race_ms:
            candidates.append(newest - 1)
        if newest + 1 < len(states) and states[newest + 1].at_ms - at_ms < race_ms:
            candidates.append(newest + 1)
        found.append(
            min(
                max(abs(a - b) for a, b in zip(getattr(states[index], attribute), distances, strict=True))
                for index in candidates
            )
        )
    return found


@pytest.mark.parametrize(
    ("row", "attribute", "tolerance_m"),
    [("PRXR", "raw_m", RAW_TOLERANCE_M), ("PRX", "filtered_m", FILTERED_TOLERANCE_M)],
)
def test_every_logged_face_distance_is_the_models_and_97_of_100_at_the_very_same_moment(
    modelled: list[Faces],
    logged: dict[str, list[tuple[float, tuple[float, ...]]]],
    row: str,
    attribute: str,
    tolerance_m: float,
) -> None:
    errors = errors_m(logged[row], modelled, attribute, RACE_MS)
    assert len(errors) == 637
    assert max(errors) <= tolerance_m
    same_moment = errors_m(logged[row], modelled, attribute, race_ms=0.0)
    assert sum(error <= tolerance_m for error in same_moment) >= 0.97 * len(same_moment)


def test_the_recorded_approach_would_tell_a_wrong_filter(
    logged: dict[str, list[tuple[float, tuple[float, ...]]]], modelled: list[Faces]
) -> None:
    """Unfiltered distances are metres away from the filtered rows, so agreement above says something."""
    errors = errors_m(logged["PRX"], modelled, "raw_m", RACE_MS)
    assert max(errors) > 2.0
    assert math.isfinite(max(errors))
