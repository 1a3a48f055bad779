"""The PX4 model fed with what a companion sent in a recorded flight holds the map that PX4 streamed back."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from fake_support import read_tlog

from service.fake_autopilot.obstacle_map_px4 import ObstacleMap
from service.fake_autopilot.obstacle_words import UNKNOWN_WORD, ObstacleWords

COMPANION, AUTOPILOT = 196, 1
RACE_US = 25_000
"""PX4 takes a message in, and streams its map, at its own pace: a map may still be without a message that was
sent less than this before it was heard (seen in the recording: up to 24 ms)."""


@dataclass(frozen=True)
class Comparison:
    """A map that PX4 streamed, the model's at that moment, and the model's without the message on its way."""

    at_us: int
    streamed: tuple[int, ...]
    modelled: tuple[int, ...]
    one_before: tuple[int, ...] | None


def compare(name: str) -> list[Comparison]:
    """All maps of a recording. Collision Prevention begins, empty, where the first one is streamed."""
    found: list[Comparison] = []
    known = ObstacleMap()
    sent_us, before = 0, known.distances_cm
    for at_us, message in read_tlog(name, ["OBSTACLE_DISTANCE"]):
        words = ObstacleWords.from_message(message)
        if message.get_srcComponent() == COMPANION and found:
            before, sent_us = known.distances_cm, at_us
            known.tick(at_us * 1e-6)
            known.update(words, at_us * 1e-6)
        elif message.get_srcComponent() == AUTOPILOT:
            known.tick(at_us * 1e-6)
            racing = at_us - sent_us < RACE_US
            found.append(
                Comparison(at_us, tuple(words.distances_cm), known.distances_cm, before if racing else None)
            )
    return found


@pytest.fixture(scope="module", params=["px4_118_approach_stop.tlog", "px4_118_manoeuvre.tlog"])
def comparisons(request: pytest.FixtureRequest) -> list[Comparison]:
    return compare(request.param)


def test_every_streamed_map_is_the_models_bin_for_bin(comparisons: list[Comparison]) -> None:
    assert len(comparisons) > 300
    wrong = [c.at_us for c in comparisons if c.streamed not in (c.modelled, c.one_before)]
    assert not wrong


def test_most_maps_leave_no_choice_and_hold_obstacles(comparisons: list[Comparison]) -> None:
    settled = [c for c in comparisons if c.one_before is None]
    assert len(settled) > 0.6 * len(comparisons)
    assert sum(min(c.streamed) < 4000 for c in settled) > 100


def test_collision_prevention_begins_with_an_empty_map(comparisons: list[Comparison]) -> None:
    assert set(comparisons[0].streamed) == {UNKNOWN_WORD}
