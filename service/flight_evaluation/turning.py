"""How far the bearings of a scan are off, by turning the true outline until it fits."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.fake_autopilot.autopilot import Flavor
from service.fake_autopilot.obstacle_words import UNKNOWN_WORD, ObstacleWords
from service.flight_evaluation.configuration import BAND
from service.flight_evaluation.lockstep import Lockstep
from service.flight_evaluation.routes import Route
from service.flight_evaluation.sight import Eyes
from service.settings import Settings
from uavdepth.scan.obstacle_scan import SECTOR_WIDTH_DEG
from uavdepth.scenes import Scene

_STEP_DEG = 0.5
_TURNING_RPS = math.radians(15.0)
_LARGEST_DEG = 20.0
_HALF_VIEW_DEG = 70.0
_HEIGHT_STEP_M = 0.25
_GROUND_CLEARANCE_M = 0.4
_FEWEST_ELEMENTS = 5
_FEWEST_EDGES = 2
_EDGE_RATIO = 1.4
"""Neighbouring elements whose true distances differ so much mark an edge; an outline without edges, such as
a wall across the view, fits whichever way it is turned."""

_WORST_FIT, _LEAST_GAP, _BESIDE_DEG = 0.2, 0.03, 5.0
"""An outline that fits nowhere, or nearly as well more than an element beside, tells no turn. Exact depth at
its own moment, with nothing to be made good, fitted up to 18 degrees beside where it fitted so badly."""

TURN_S = 3.0
_BEGIN_S = 1.0


def bearing_errors_deg(
    scene: Scene, settings: Settings, flavor: Flavor, eyes: Eyes, route: Route, latency_s: float, share: float
) -> list[float]:
    """Turn on the spot with the yaw stick at a share of full (90 degrees a second), to and fro.

    Args:
        scene, settings, flavor, eyes, route, latency_s: as in `Lockstep`.
        share: of the stick, 0 to 1.

    Returns:
        Degrees by which each message whose outline has edges is turned clockwise against the true one.
    """
    flight = Lockstep(scene, settings, flavor, eyes, route, latency_s)
    flight.take_off()
    begin_s = flight.now_s + _BEGIN_S
    errors: list[float] = []
    told = flight.messages
    while flight.now_s < begin_s + TURN_S and not flight.controller.collided:
        side = 1.0 if (flight.now_s - begin_s) % TURN_S < TURN_S / 2 else -1.0
        flight.fly(0.0, side * share if flight.now_s >= begin_s else 0.0)
        flight.step()
        if flight.messages == told or flight.words is None:
            continue
        told = flight.messages
        if abs(flight.controller.vehicle.yaw_rate_rps) > _TURNING_RPS:
            vehicle = flight.controller.vehicle
            error = outline_turn_deg(scene, flight.words, vehicle.position_ned_m, vehicle.yaw_rad)
            errors += [] if error is None else [error]
    return errors


def outline_turn_deg(
    scene: Scene, words: ObstacleWords, position_ned_m: Sequence[float], yaw_rad: float
) -> float | None:
    """Degrees by which a message's outline is turned clockwise against the true one; None where nothing tells
    it.

    Args:
        scene: the world.
        words: the message.
        position_ned_m, yaw_rad: of the vehicle at the moment when it arrives.
    """
    most_m = words.max_distance_cm / 100.0
    outline = _outline(scene, position_ned_m, yaw_rad, most_m)
    distances_cm = np.asarray(words.distances_cm)
    bearings = words.offset_deg + words.increment_deg * np.arange(len(distances_cm))
    bearings = (bearings + 180.0) % 360.0 - 180.0
    known = distances_cm != UNKNOWN_WORD
    known &= np.abs(bearings) < _HALF_VIEW_DEG - _LARGEST_DEG - SECTOR_WIDTH_DEG
    if np.count_nonzero(known) < _FEWEST_ELEMENTS:
        return None
    told = np.minimum(distances_cm[known] / 100.0, most_m)
    bearings = bearings[known]
    straight = _elements_of(outline, bearings)
    order = np.argsort(bearings)
    edges = np.abs(np.diff(np.log(straight[order]))) > math.log(_EDGE_RATIO)
    if np.count_nonzero(edges) < _FEWEST_EDGES:
        return None
    turns = np.arange(-_LARGEST_DEG, _LARGEST_DEG + 1e-9, _STEP_DEG)
    costs = np.array([_misfit(told, _elements_of(outline, bearings - turn)) for turn in turns])
    # Elements are 5 degrees wide: of turns that fit equally well the middle one is meant.
    turn = float(np.mean(turns[costs <= costs.min() + 1e-3]))
    beside = costs[np.abs(turns - turn) > _BESIDE_DEG].min()
    if costs.min() > _WORST_FIT or beside < costs.min() + _LEAST_GAP:
        return None
    return turn


def _misfit(told_m: NDArray[np.float64], true_m: NDArray[np.float64]) -> float:
    """Mean difference of the logarithms, but for a factor common to all: scale is judged elsewhere."""
    difference = np.log(np.maximum(told_m, 0.2) / true_m)
    return float(np.mean(np.abs(difference - np.median(difference))))


def _outline(
    scene: Scene, position_ned_m: Sequence[float], yaw_rad: float, most_m: float
) -> NDArray[np.float64]:
    """Nearest horizontal distance in the height band by bearing from the nose, every `_STEP_DEG`."""
    north_m, east_m, down_m = position_ned_m
    floor_m = -scene.ground_height_m(float(north_m), float(east_m)) - _GROUND_CLEARANCE_M
    downs = np.arange(down_m - BAND.above_m, min(down_m + BAND.below_m, floor_m), _HEIGHT_STEP_M)
    bearings = np.radians(np.arange(-_HALF_VIEW_DEG, _HALF_VIEW_DEG + 1e-9, _STEP_DEG)) + yaw_rad
    down, bearing = (grid.ravel() for grid in np.meshgrid(downs, bearings, indexing="ij"))
    origins = np.stack([np.full_like(down, north_m), np.full_like(down, east_m), down], axis=1)
    directions = np.stack([np.cos(bearing), np.sin(bearing), np.zeros_like(bearing)], axis=1)
    reach = scene.ray_distance_m(origins, directions).reshape(len(downs), len(bearings))
    return np.asarray(np.minimum(reach.min(axis=0, initial=math.inf), most_m))


def _elements_of(outline: NDArray[np.float64], bearings_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nearest of the outline over elements of 5 degrees about bearings."""
    half = SECTOR_WIDTH_DEG / 2
    first = np.ceil((bearings_deg - half + _HALF_VIEW_DEG) / _STEP_DEG).astype(np.intp)
    count = round(SECTOR_WIDTH_DEG / _STEP_DEG)
    which = np.clip(first[:, None] + np.arange(count), 0, len(outline) - 1)
    return np.asarray(np.maximum(outline[which].min(axis=1), 0.2))
