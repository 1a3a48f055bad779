"""Which journeys an evaluation makes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from service.motion_evaluation.journey import Journey
from service.motion_evaluation.kitti_journey import open_kitti
from service.motion_evaluation.recorded_journey import RecordedJourney
from service.motion_evaluation.rendered_journey import RenderedJourney

FLIGHTS = (
    ("city:1000", 3),
    ("suburb:1000", 1),
    ("forest:1000", 1),
    ("park:1000", 1),
    ("works:1000", 1),
    ("mountain:1000", 1),
)
"""Worlds that no training has seen, and a flight through each."""

PARTS = (
    ("S-turns", 14.0, "park:1000"),
    ("climbing", 50.0, "suburb:1000"),
    ("yaw both ways", 79.0, "suburb:1000"),
    ("sideways", 94.0, "city:1000"),
    ("fast and stop", 113.0, "forest:1000"),
    ("hard roll and pitch", 131.0, "works:1000"),
)
"""Parts of the recorded flight `C_s_turns`: begin in seconds, and the world that each is set down in."""


def planned_journeys(
    flights: bool, log: Path | None, kitti: Sequence[Path], seconds: float, rate_hz: float
) -> list[Journey]:
    """All journeys, in order.

    Args:
        flights: planned flights through rendered worlds.
        log: a recorded flight (NAME.BIN) to replay parts of, or None.
        kitti: folders of KITTI's raw or odometry data.
        seconds: length of each flight and part.
        rate_hz: pictures a second of planned flights.

    Raises:
        RecordError: a folder without such data.
    """
    journeys: list[Journey] = []
    if flights:
        journeys += [RenderedJourney(scene, seconds, rate_hz, seed) for scene, seed in FLIGHTS]
    if log is not None:
        journeys += [RecordedJourney(log, scene, title, start_s, seconds) for title, start_s, scene in PARTS]
    for folder in kitti:
        journeys += open_kitti(folder)
    return journeys
