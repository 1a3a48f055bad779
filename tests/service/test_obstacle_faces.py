"""R3, R4, R5: from what the camera sees to the faces that ArduPilot keeps, through the message."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.proximity_ardupilot import FaceBoundary
from uavdepth import (
    Attitude,
    CameraModel,
    CameraMount,
    ObstacleScanner,
    SectorState,
    encode_obstacle_distance,
)

CAMERA = CameraModel.from_fov(320, 200, horizontal_fov_deg=90.0)
POLE_M = 4.0
SECOND_MS = 1000


def poles(*bearings_deg: float, metres: float = POLE_M) -> NDArray[np.float32]:
    """(H, W) z-depth of poles 14 cm wide, from the bottom of the picture to its top; sky behind."""
    across = CAMERA.normalized_rays[..., 0]
    bearing = np.degrees(np.arctan(across))
    half_deg = math.degrees(0.07 / metres)
    depth = np.full((CAMERA.height, CAMERA.width), np.inf, np.float32)
    for pole_deg in bearings_deg:
        on_it = np.abs(bearing - pole_deg) < half_deg
        depth[on_it] = (metres * np.cos(np.radians(bearing)))[on_it]
    return depth


def message_of(depth_m: NDArray[np.float32], yaw_deg: float = 0.0) -> ObstacleWords:
    """What is sent of a depth map."""
    scan = ObstacleScanner(CAMERA, CameraMount()).scan(
        depth_m, Attitude(0.0, 0.0, math.radians(yaw_deg)), height_m=5.0
    )
    assert (scan.state == SectorState.OBSTACLE).any()
    return ObstacleWords.from_message(encode_obstacle_distance(scan))


def told_at(words: ObstacleWords) -> list[float]:
    """Bearings of the elements that tell an obstacle, degrees."""
    return [
        words.offset_deg + words.increment_f_deg * k
        for k, word in enumerate(words.distances_cm)
        if word <= words.max_distance_cm
    ]


@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, 90.0, -170.0])
def test_r3_distances_turn_with_the_vehicle_and_not_with_north(yaw_deg: float) -> None:
    words = message_of(poles(10.0), yaw_deg)
    assert words.frame == 12
    assert words.distances_cm == message_of(poles(10.0)).distances_cm


@pytest.mark.parametrize(("bearing_deg", "face"), [(-30, 7), (-10, 0), (0, 0), (10, 0), (30, 1)])
def test_r4_a_pole_lands_in_its_element_and_its_face(bearing_deg: int, face: int) -> None:
    words = message_of(poles(bearing_deg))
    assert told_at(words) == [bearing_deg]
    faces = FaceBoundary()
    faces.update(words, SECOND_MS)
    kept = {k: faces.raw_m(k) for k in range(8) if faces.raw_m(k) is not None}
    assert kept == {face: pytest.approx(POLE_M, abs=0.06)}


@pytest.mark.parametrize("filter_hz", [0.25, 5.0])
def test_r5_the_filtered_face_comes_to_the_nearer_of_two_poles_on_both_sides_of_the_nose(
    filter_hz: float,
) -> None:
    """With an array that begins at the nose the face kept its last visit only, and lost the other pole."""
    for near_deg, far_deg in ((-10.0, 10.0), (10.0, -10.0)):
        depth = np.minimum(poles(near_deg, metres=3.0), poles(far_deg, metres=8.0))
        words = message_of(depth)
        faces = FaceBoundary()
        faces.filter_hz = filter_hz
        for message in range(100):
            faces.update(words, SECOND_MS + 67 * message)
            faces.tick(SECOND_MS + 67 * message)
        assert faces.filtered_faces_m[0] == pytest.approx(min(words.distances_cm) / 100, abs=0.02)
        assert min(words.distances_cm) == pytest.approx(300, abs=6)
