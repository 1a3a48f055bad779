"""The open part: poses and flights looked at one by one, each scan held against the truth at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from service.flight_evaluation.configuration import BAND, FRAMES_PER_S
from service.flight_evaluation.judgement import Tally, judge
from service.flight_evaluation.poses import Manoeuvre, Trajectory, random_pose
from service.flight_evaluation.sight import Camera, DepthKind, Eyes, Sight
from service.flight_evaluation.truth import TruthFinder
from service.flight_evaluation.worlds import WorldSpec
from service.pipeline import PerceptionResult
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.errors import UavDepthError
from uavdepth.scan.obstacle_scan import SectorState
from uavdepth.scenes import Scene
from uavdepth.scenes.flight import Pose

SETTLE_S = 1.5
"""The first pictures of a flight are flown but not counted: metres from motion need some of it."""

_SCALE_SPAN_M = (1.0, 60.0)
_FEWEST_PIXELS = 500
_POSE_GAP_S = 10.0
"""Between two random poses: whatever a chain remembers has no say in the next."""


@dataclass(frozen=True)
class Looked:
    """One picture of the open part.

    Args:
        world: where.
        manoeuvre: what the vehicle did; None for a random pose.
        speed_mps: how fast.
        tally: its scan against the truth; None where nothing was told, because depth was not trusted.
        trouble: why nothing was told.
        scale_error: |factor of depth - 1|, by the median over the pixels; None without depth.
        points: the nearest obstacles (told, true), one pair a measured element with an obstacle.
    """

    world: WorldSpec
    manoeuvre: Manoeuvre | None
    speed_mps: float
    tally: Tally | None
    trouble: str | None
    scale_error: float | None
    points: NDArray[np.float64]


@dataclass(frozen=True)
class _Seen:
    pose: Pose
    sight: Sight
    height_m: float
    result: PerceptionResult


class Surveyor:
    """Looks at one world with one kind of depth.

    Args:
        world, scene: the world.
        settings: the service's configuration.
        kind: whose depth.
    """

    def __init__(self, world: WorldSpec, scene: Scene, settings: Settings, kind: DepthKind) -> None:
        self._world = world
        self._scene = scene
        self._settings = settings
        self._kind = kind
        camera, mount = settings.camera.model, settings.mount.mount
        self._camera = Camera(scene, camera, mount, kind)
        self._truth = TruthFinder(camera, mount, BAND, settings.scan.max_distance_m)

    def poses(self, seed: int, count: int) -> Iterator[Looked]:
        """Random poses, each by itself."""
        rng = np.random.default_rng([seed, self._world.seed, 0x905E])
        eyes = Eyes(self._settings, self._kind)
        for number in range(count):
            pose = random_pose(self._scene, rng)
            seen = self._see(eyes, _staying(pose), number * _POSE_GAP_S, number)
            yield self._judged(seen, None, 0.0)

    def flight(self, trajectory: Trajectory) -> Iterator[Looked]:
        """One flight, picture by picture through one chain."""
        eyes = Eyes(self._settings, self._kind)
        for number in range(round(trajectory.duration_s * FRAMES_PER_S)):
            t_s = number / FRAMES_PER_S
            seen = self._see(eyes, trajectory.pose_at, t_s, number)
            if t_s >= SETTLE_S:
                yield self._judged(seen, trajectory.manoeuvre, trajectory.speed_mps)

    def _see(self, eyes: Eyes, pose_at: Callable[[float], Pose], t_s: float, number: int) -> _Seen:
        pose = pose_at(t_s)
        sight = self._camera.look(pose.position_ned_m, pose.attitude)
        height_m = self._height_m(pose)

        def telemetry_at(at_ns: int) -> Telemetry:
            then = pose_at(at_ns / 1e9)
            return Telemetry(
                at_ns,
                attitude=then.attitude,
                # The rangefinder is asked once a picture: a ray for each of the chain's questions is dear.
                height_m=height_m + float(pose.position_ned_m[2] - then.position_ned_m[2]),
                position_ned_m=_triple(then.position_ned_m),
                velocity_ned_mps=_triple(then.velocity_ned_mps),
                armed=True,
            )

        frame = eyes.frame(sight, round(t_s * 1e9), number)
        return _Seen(pose, sight, height_m, eyes.perception.step_late(frame, telemetry_at))

    def _judged(self, seen: _Seen, manoeuvre: Manoeuvre | None, speed_mps: float) -> Looked:
        result, pose, depth_m = seen.result, seen.pose, seen.sight.depth_m
        tally, points = None, np.empty((0, 2))
        if result.trusted:
            truth = self._truth.find(self._scene, pose.position_ned_m, pose.attitude, seen.height_m, depth_m)
            tally = judge(truth, result.scan)
            both = (
                truth.looked_at & (result.scan.state == SectorState.OBSTACLE) & np.isfinite(truth.certain_m)
            )
            points = np.column_stack([result.scan.distance_m[both], truth.certain_m[both]])
        return Looked(
            world=self._world,
            manoeuvre=manoeuvre,
            speed_mps=speed_mps,
            tally=tally,
            trouble=None if result.trouble is None else result.trouble.name.lower(),
            scale_error=_scale_error(result, depth_m),
            points=points,
        )

    def _height_m(self, pose: Pose) -> float:
        height_m = self._scene.rangefinder_m(_triple(pose.position_ned_m))
        if height_m is None:
            raise UavDepthError(
                f"nothing below {pose.position_ned_m} in {self._world.name}:{self._world.seed}"
            )
        return height_m


def _staying(pose: Pose) -> Callable[[float], Pose]:
    return lambda _t_s: pose


def _scale_error(result: PerceptionResult, depth_m: NDArray[np.float32]) -> float | None:
    """How far the median factor between told and true depth is from 1."""
    if result.depth is None or not result.trusted:
        return None
    told = result.depth.depth_m
    with np.errstate(invalid="ignore"):
        known = np.isfinite(told) & (told > 0) & (depth_m > _SCALE_SPAN_M[0]) & (depth_m < _SCALE_SPAN_M[1])
    if np.count_nonzero(known) < _FEWEST_PIXELS:
        return None
    return abs(float(np.median(told[known] / depth_m[known])) - 1.0)


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
