"""A wrong focal length shows when the vehicle turns."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from moving_camera import straight, told, wall_picture

from uavdepth import CameraModel, CameraMount
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.turn_check import TurnCheck


def turn(degrees: float) -> np.ndarray:
    return np.asarray(cv2.Rodrigues(np.array([0.1, 1.0, 0.0]) * math.radians(degrees))[0])


@pytest.mark.parametrize(("share", "word"), [(0.85, "too long"), (1.15, "too short"), (1.03, None)])
def test_pictures_that_turn_less_than_the_vehicle_have_too_long_a_focal_length(
    share: float, word: str | None
) -> None:
    check = TurnCheck()
    for degrees in (8, -12, 20, 15, -9) * 4:
        check.add(turn(degrees), turn(degrees * share))
    assert check.ratio == pytest.approx(share, abs=0.01)
    assert check.suspicion is None if word is None else word in str(check.suspicion)


def test_small_and_few_turns_say_nothing() -> None:
    check = TurnCheck()
    for _ in range(50):
        check.add(turn(2), turn(1))
    assert check.ratio is None
    for _ in range(10):
        check.add(turn(20), turn(15))
    assert check.suspicion is None


@pytest.mark.parametrize(("believed", "suspected"), [(1.0, False), (1.2, True)])
def test_a_wrong_focal_length_is_told_by_a_turn_in_flight(believed: float, suspected: bool) -> None:
    true = CameraModel.from_fov(320, 160, 80)
    camera = CameraModel(320, 160, true.fx * believed, true.fy * believed, true.cx, true.cy)
    place = straight((0.0, 2.0, 0.0))

    def yaw_rad(t_s: float) -> float:
        return math.radians(12.0) * math.sin(1.2 * t_s)

    motion, points = told(place, 4.0, yaw_rad), MotionPoints(camera, CameraMount())
    for number in range(40):
        t_s = number / 10
        picture = wall_picture(true, place(t_s)[0], 12.0, yaw_rad(t_s))
        points.update(picture, round(t_s * 1e9), motion)
    assert (points.suspicion is not None) is suspected
