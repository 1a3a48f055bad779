"""What becomes of a closed-loop flight: stopped, touched, passed."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from service.demo.truth import true_distance_ahead_m
from service.fake_autopilot.autopilot import Flavor
from service.flight_evaluation.configuration import BAND
from service.flight_evaluation.lockstep import STEP_S, Lockstep
from service.flight_evaluation.routes import Route
from service.flight_evaluation.sight import Eyes
from service.settings import Settings
from uavdepth.scenes import Scene

SPEED_MPS = 3.0
HOVER_S = 0.7
"""Before the stick goes forward: the first messages have arrived by then."""

LONGEST_S = 25.0
REST_M, REST_S = 0.6, 2.0
"""The vehicle has stopped when it stayed within so few metres for so long, the stick still forward."""


class Outcome(StrEnum):
    """How a flight ended."""

    STOPPED = "stopped"
    TOUCHED = "touched"
    PASSED = "passed"
    LATE = "neither"


@dataclass(frozen=True)
class Flown:
    """One closed-loop flight.

    Args:
        route, flavor: what was flown, by whom.
        outcome: how it ended.
        way_m: metres flown along the route.
        ahead_m: nearest surface within 20 degrees of the nose and in the height band at the end, or None.
        path_m: (n, 2) time in seconds and way flown in metres.
        silent_frames: frames of which the autopilot was not told.
    """

    route: Route
    flavor: Flavor
    outcome: Outcome
    way_m: float
    ahead_m: float | None
    path_m: tuple[tuple[float, float], ...]
    silent_frames: int


def fly_route(
    scene: Scene,
    settings: Settings,
    flavor: Flavor,
    eyes: Eyes | None,
    route: Route,
    latency_s: float,
    *,
    corridor: bool = False,
) -> Flown:
    """Take off, hover for a moment, and hold the stick forward until something is decided.

    Args:
        scene, settings, flavor, eyes, route, latency_s: as in `Lockstep`.
        corridor: the way is free; flying all of it ends the flight.
    """
    flight = Lockstep(scene, settings, flavor, eyes, route, latency_s)
    flight.take_off()
    begin_s = flight.now_s + HOVER_S
    controller = flight.controller
    path: list[tuple[float, float]] = []
    recent: deque[float] = deque(maxlen=round(REST_S / STEP_S))
    outcome = Outcome.LATE
    while flight.now_s < begin_s + LONGEST_S:
        flight.fly(SPEED_MPS if flight.now_s >= begin_s else 0.0)
        flight.step()
        way_m = _way_m(route, controller.vehicle.north_m, controller.vehicle.east_m)
        if len(path) * 0.1 <= flight.now_s - begin_s:
            path.append((flight.now_s - begin_s, way_m))
        recent.append(way_m)
        if controller.collided:
            outcome = Outcome.TOUCHED
            break
        if corridor and way_m >= route.length_m:
            outcome = Outcome.PASSED
            break
        rests = len(recent) == recent.maxlen and max(recent) - min(recent) < REST_M
        if rests and flight.now_s > begin_s + REST_S + 1.0:
            outcome = Outcome.STOPPED
            break
    vehicle = controller.vehicle
    return Flown(
        route=route,
        flavor=flavor,
        outcome=outcome,
        way_m=_way_m(route, vehicle.north_m, vehicle.east_m),
        ahead_m=true_distance_ahead_m(
            scene, vehicle.position_ned_m, vehicle.yaw_rad, BAND.below_m, BAND.above_m
        ),
        path_m=tuple(path),
        silent_frames=flight.silent_frames,
    )


def _way_m(route: Route, north_m: float, east_m: float) -> float:
    return float(
        np.dot(
            (north_m - route.north_m, east_m - route.east_m),
            (math.cos(route.yaw_rad), math.sin(route.yaw_rad)),
        )
    )
