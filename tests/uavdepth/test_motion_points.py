"""Points of known depth from pictures and motion: a painted wall seen from a vehicle that flies by."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest
from moving_camera import LEVEL, Place, stops_after, straight, told, wall_picture
from numpy.typing import NDArray

from uavdepth import CameraModel, CameraMount, ImageSizeError, PointHints
from uavdepth.motion.motion_point_settings import MotionPointSettings
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import VehicleMotion

CAMERA = CameraModel.from_fov(320, 160, 90)
WALL_M = 10.0
ALONG = (0.0, 2.0, 0.0)
SIDEWAYS = straight(ALONG)


def fly(
    points: MotionPoints,
    place: Place,
    times_s: Iterable[float],
    motion: VehicleMotion | None = None,
    yaw_rad: Callable[[float], float] = lambda t_s: 0.0,
) -> list[PointHints]:
    """The points of pictures of the wall at these times."""
    told_motion = motion or told(place, 6.0, yaw_rad)
    return [
        points.update(
            wall_picture(points.camera, place(t_s)[0], WALL_M, yaw_rad(t_s)), round(t_s * 1e9), told_motion
        )
        for t_s in times_s
    ]


def fly_and_stop(last: int, place: Place | None = None) -> dict[int, PointHints]:
    """Points by tenths of a second. The autopilot tells of flight along the wall, and a stop after 1 s."""
    told_place, motion = stops_after(ALONG, 1.0), VehicleMotion()
    points, found = MotionPoints(CAMERA, CameraMount()), {}
    for step in range(2 * last + 1):
        at_ns = step * 50_000_000
        motion.add_attitude(at_ns, LEVEL)
        motion.add_position(at_ns, *told_place(step / 20))
        if step % 2 == 0:
            picture = wall_picture(CAMERA, (place or told_place)(step / 20)[0], WALL_M)
            found[step // 2] = points.update(picture, at_ns, motion)
    return found


def tenths(first: int, last: int) -> list[float]:
    return [step / 10 for step in range(first, last + 1)]


@pytest.mark.parametrize("velocity", [ALONG, (2.0, 1.0, 0.0), (2.5, 0.0, 0.0)])
def test_a_wall_is_where_it_is(velocity: tuple[float, float, float]) -> None:
    place = straight(velocity)
    last = fly(MotionPoints(CAMERA, CameraMount()), place, tenths(0, 10))[-1]
    depth = WALL_M - place(1.0)[0][0]
    assert len(last) > 60
    assert np.median(np.abs(last.depth_m / depth - 1)) < 0.03
    # The corners err by less than is assumed, so this is the safe side.
    assert np.mean(np.abs(last.depth_m / depth - 1) < last.relative_sigma) > 0.68


def test_points_are_the_same_whenever_they_are_measured() -> None:
    class Early(MotionPoints):
        """Measures as soon as a picture's points have been told."""

        def update(self, image_bgr: NDArray[np.uint8], captured_ns: int, motion: VehicleMotion) -> PointHints:
            points = super().update(image_bgr, captured_ns, motion)
            self.measure()
            return points

    late = fly(MotionPoints(CAMERA, CameraMount()), SIDEWAYS, tenths(0, 5))[-1]
    early = fly(Early(CAMERA, CameraMount()), SIDEWAYS, tenths(0, 5))[-1]
    assert len(late) > 60
    np.testing.assert_array_equal(early.depth_m, late.depth_m)
    np.testing.assert_array_equal(early.relative_sigma, late.relative_sigma)


def test_points_spread_over_the_picture() -> None:
    last = fly(MotionPoints(CAMERA, CameraMount()), SIDEWAYS, tenths(0, 8))[-1]
    cells = {(int(x // 80), int(y // 80)) for x, y in last.pixels}
    assert len(cells) == 8
    assert len(last) <= 300


def test_the_mount_and_a_lens_that_bends_are_taken_into_account() -> None:
    camera = CameraModel(320, 160, 170, 170, 159.5, 79.5, (-0.2, 0.04, 0.0, 0.0))
    last = fly(MotionPoints(camera, CameraMount()), SIDEWAYS, tenths(0, 10))[-1]
    edge = np.abs(last.pixels[:, 0] - 159.5) > 100
    assert edge.sum() > 10
    assert np.median(np.abs(last.depth_m[edge] / WALL_M - 1)) < 0.03


def test_turning_while_flying_does_no_harm() -> None:
    def yaw(t_s: float) -> float:
        return 0.6 * math.sin(1.5 * t_s)

    place = straight((0.5, 2.0, 0.0))
    last = fly(MotionPoints(CAMERA, CameraMount()), place, tenths(0, 10), yaw_rad=yaw)[-1]
    north = WALL_M - 0.5
    # Depth is along the optical axis, which is turned: seen at the angle a the wall's depth is this.
    angle = np.arctan((last.pixels[:, 0] - CAMERA.cx) / CAMERA.fx)
    depth = north * np.cos(angle) / np.cos(yaw(1.0) + angle)
    assert len(last) > 40
    assert np.median(np.abs(last.depth_m / depth - 1)) < 0.04


def test_hover_and_turning_on_the_spot_give_no_points() -> None:
    for yaw in (lambda t_s: 0.0, lambda t_s: 0.5 * t_s):
        found = fly(MotionPoints(CAMERA, CameraMount()), straight((0, 0, 0)), tenths(0, 12), yaw_rad=yaw)
        assert [len(each) for each in found] == [0] * 13


def test_in_a_hover_points_stay_while_they_are_seen_and_grow_doubtful() -> None:
    found = fly_and_stop(120)
    moving, held = found[10], found[120]
    assert len(held) > 0.5 * len(moving)
    assert np.median(np.abs(held.depth_m / WALL_M - 1)) < 0.03
    assert np.median(held.relative_sigma) > np.median(moving.relative_sigma) + 0.02
    assert max(held.relative_sigma) <= MotionPointSettings().largest_carried_sigma


def test_in_a_hover_points_follow_a_drift_that_the_autopilot_does_not_tell() -> None:
    def place(t_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        (north, east, down), velocity = stops_after(ALONG, 1.0)(t_s)
        drift_s = max(t_s - 2.5, 0.0)
        return (north + 0.08 * drift_s, east - 0.05 * drift_s, down), velocity

    found = fly_and_stop(80, place)
    before, after = found[25], found[80]
    assert len(after) > 0.4 * len(before)
    nearer = np.median(after.depth_m) / np.median(before.depth_m)
    assert nearer == pytest.approx((WALL_M - 0.44) / WALL_M, abs=0.01)


def test_in_a_hover_a_scene_that_moves_gives_no_points_after_two_seconds() -> None:
    def place(t_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        (north, east, down), velocity = stops_after(ALONG, 1.0)(t_s)
        return (north, east - 1.0 * max(t_s - 3.5, 0.0), down), velocity

    found = fly_and_stop(60, place)
    assert len(found[35]) > 60
    assert len(found[57]) == 0


def test_in_a_hover_what_moves_before_a_still_scene_loses_its_points() -> None:
    """The lower half of the picture is another wall, which drives away when the vehicle stands."""
    points, place, motion = (
        MotionPoints(CAMERA, CameraMount()),
        stops_after(ALONG, 1.0),
        told(stops_after(ALONG, 1.0), 5.0),
    )
    for t_s in tenths(0, 50):
        picture = wall_picture(CAMERA, place(t_s)[0], WALL_M)
        driven_m = 0.6 * max(t_s - 3.0, 0.0)
        lower = wall_picture(CAMERA, (0.0, place(t_s)[0][1] - driven_m, 0.0), WALL_M)
        picture[100:] = lower[100:]
        last = points.update(picture, round(t_s * 1e9), motion)
        if t_s == 3.0:
            assert np.count_nonzero(last.pixels[:, 1] > 105) > 10
    assert np.count_nonzero(last.pixels[:, 1] < 95) > 40
    assert np.count_nonzero(last.pixels[:, 1] > 105) == 0


def test_points_that_are_lost_from_sight_stay_for_two_seconds() -> None:
    points, motion = MotionPoints(CAMERA, CameraMount()), told(stops_after(ALONG, 1.0), 5.0)
    fly(points, stops_after(ALONG, 1.0), tenths(0, 20), motion)
    blank = np.full((160, 320, 3), 128, np.uint8)
    found = {step: len(points.update(blank, step * 100_000_000, motion)) for step in range(21, 45)}
    assert found[22] > 20
    assert found[41] == 0


def test_points_that_are_carried_come_nearer_as_the_vehicle_does() -> None:
    points = MotionPoints(CAMERA, CameraMount())
    place = straight((2.0, 0.5, 0.0))
    motion = told(place, 6.0)
    fly(points, place, tenths(0, 10), motion)
    # The picture fades to nothing that can be followed: clouds, the sun, a black-out.
    blank = np.full((160, 320, 3), 128, np.uint8)
    for step in range(11, 14):
        carried = points.update(blank, step * 100_000_000, motion)
    assert len(carried) > 20
    assert np.median(carried.depth_m) == pytest.approx(WALL_M - 2.6, rel=0.04)
    assert (carried.pixels >= -0.5).all()
    assert (carried.pixels < (319.5, 159.5)).all()


def test_a_thing_that_moves_gives_no_points() -> None:
    points = MotionPoints(CAMERA, CameraMount())
    motion = told(SIDEWAYS, 2.0)
    for step in range(9):
        t_s = step / 10
        picture = wall_picture(CAMERA, SIDEWAYS(t_s)[0], WALL_M)
        # A poster that rises through the picture by 3 pixels a frame.
        poster = wall_picture(CAMERA, (0.0, -20.0, 0.0), WALL_M)[:60, :90]
        top = 70 - 3 * step
        picture[top : top + 60, 120:210] = poster
        last = points.update(picture, round(t_s * 1e9), motion)
    x, y = last.pixels.T
    on_it = (x > 128) & (x < 202) & (y > 54) & (y < 98)
    assert len(last) > 40
    assert np.count_nonzero(on_it) == 0
    assert np.median(np.abs(last.depth_m / WALL_M - 1)) < 0.03


def test_tracks_that_stay_behind_after_a_gap_tell_nothing() -> None:
    """Of a pattern that repeats itself the vehicle sees after a gap what it saw before, one repetition on."""

    def after_the_gap(seen_from_s: float) -> tuple[PointHints, PointHints]:
        points, motion = MotionPoints(CAMERA, CameraMount()), told(SIDEWAYS, 2.0)
        before = fly(points, SIDEWAYS, tenths(0, 8), motion)[-1]
        picture = wall_picture(CAMERA, SIDEWAYS(seen_from_s)[0], WALL_M)
        return before, points.update(picture, 1_200_000_000, motion)

    before, seen = after_the_gap(1.2)
    assert len(seen) > 0.5 * len(before) > 30
    assert np.median(np.abs(seen.depth_m / WALL_M - 1)) < 0.03
    _, repeated = after_the_gap(0.8)
    assert len(repeated) == 0


def test_a_position_that_jumps_changes_nothing() -> None:
    motion = VehicleMotion()
    for step in range(41):
        t_s = step / 20
        motion.add_attitude(round(t_s * 1e9), LEVEL)
        (north, east, down), velocity = SIDEWAYS(t_s)
        motion.add_position(round(t_s * 1e9), (north + 30 * (t_s > 0.9), east, down), velocity)
    last = fly(MotionPoints(CAMERA, CameraMount()), SIDEWAYS, tenths(0, 12), motion)[-1]
    assert len(last) > 60
    assert np.median(np.abs(last.depth_m / WALL_M - 1)) < 0.03


def test_a_velocity_that_jumps_leaves_no_points_until_there_is_parallax_again() -> None:
    motion = VehicleMotion()
    for step in range(41):
        t_s = step / 20
        motion.add_attitude(round(t_s * 1e9), LEVEL)
        motion.add_position(round(t_s * 1e9), (0, 0, 0), (0, 2.0, 0) if t_s < 1 else (0, 6.0, 0))
    found = fly(MotionPoints(CAMERA, CameraMount()), SIDEWAYS, tenths(0, 11), motion)
    assert len(found[9]) > 60
    assert len(found[10]) == 0
    assert len(found[11]) == 0


def test_without_attitude_or_velocity_there_are_no_points() -> None:
    points = MotionPoints(CAMERA, CameraMount())
    assert all(len(each) == 0 for each in fly(points, SIDEWAYS, tenths(0, 6), VehicleMotion()))
    short = told(SIDEWAYS, 0.8)
    found = fly(MotionPoints(CAMERA, CameraMount()), SIDEWAYS, tenths(0, 12), short)
    assert len(found[8]) > 60
    assert len(found[12]) == 0


def test_a_step_back_in_time_begins_anew_and_the_same_picture_again_is_the_same() -> None:
    points, motion = MotionPoints(CAMERA, CameraMount()), told(SIDEWAYS, 6.0)
    found = fly(points, SIDEWAYS, tenths(0, 6), motion)
    again = fly(points, SIDEWAYS, [0.6], motion)[0]
    assert again is found[-1]
    assert len(fly(points, SIDEWAYS, [0.2], motion)[0]) == 0
    points.clear()
    assert len(fly(points, SIDEWAYS, [0.6], motion)[0]) == 0


def test_a_sky_without_texture_gives_no_points() -> None:
    points, motion = MotionPoints(CAMERA, CameraMount()), told(SIDEWAYS, 2.0)
    rng = np.random.default_rng(1)
    for step in range(8):
        sky = (200 + rng.normal(0, 1.0, (160, 320, 3))).round().astype(np.uint8)
        assert len(points.update(sky, step * 100_000_000, motion)) == 0


@pytest.mark.parametrize(
    ("shape", "dtype"), [((320, 160, 3), np.uint8), ((160, 320), np.uint8), ((160, 320, 3), np.float32)]
)
def test_a_picture_of_another_camera_is_refused(shape: tuple[int, ...], dtype: type) -> None:
    with pytest.raises(ImageSizeError, match="the camera's is"):
        MotionPoints(CAMERA, CameraMount()).update(np.zeros(shape, dtype), 0, VehicleMotion())
