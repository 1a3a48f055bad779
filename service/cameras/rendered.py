"""The rendered camera: the world of a scene, seen from where the autopilot says it is."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Protocol

from service.cameras.camera import Camera, CameraTimeoutError
from service.clock import Clock
from service.errors import CameraError
from service.frame import Frame
from service.settings.camera import CameraSettings
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraMount

if TYPE_CHECKING:
    from uavdepth.scenes import Scene

_POLL_S = 0.005
"""How often a pose is looked for: far below the 20 ms between two poses of a 50 Hz stream."""

_REMEMBERED_COSTS = 15
_USUALLY_READY = 0.7
"""Share of the pictures that are ready in the time that is planned for them."""

_LONGEST_COST_NS = 150_000_000
"""Poses are not carried on further: a vehicle that brakes would be seen at a wrong tilt."""

_LONGEST_AHEAD_NS = 250_000_000
"""From the newest pose on. Where the computer was held up that one is old, and carried on from it the picture
would show a place where the vehicle never was: in a demo's take-off the points measured by such a one were
told at half their distance."""

_TAKE_OFF_NED_M = (0.0, 0.0, -1.0)
"""A metre above the origin, which is free ground in every scene."""


class PoseSource(Protocol):
    """Who knows where the vehicle is."""

    def newest_pose(self) -> Telemetry:
        """The newest known pose and the time it holds for."""

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        """The vehicle at a moment in the recent past."""

    def predicted_pose(self, at_ns: int) -> Telemetry:
        """The vehicle at a moment that is about to come."""


class RenderedCamera(Camera):
    """Renders from the pose that the connected autopilot reports, so that any autopilot flies in the scene.

    A camera exposes while the computer does other things; rendering takes the computer's time instead. So a
    picture is rendered for the moment at which it will be ready, from the autopilot's pose carried on by its
    rates, and delivered then. Its capture stamp is that moment, the time for which its pose holds.

    Args:
        spec: `SCENE` or `SCENE:SEED`.
        mount: where the camera sits.
        poses: the autopilot link.
    """

    reopen_on_timeout = False
    stands_back = True

    def __init__(
        self, settings: CameraSettings, clock: Clock, spec: str, mount: CameraMount, poses: PoseSource
    ) -> None:
        super().__init__(settings, clock)
        self._spec = spec
        self._mount = mount
        self._poses = poses
        self._scene: Scene | None = None
        self._due_ns = 0
        self._last_pose_ns = self._shown_ns = -1
        self._costs_ns: deque[int] = deque(maxlen=_REMEMBERED_COSTS)
        self._model = settings.model

    def open(self) -> None:
        if self._scene is None:
            from uavdepth.scenes import load_scene, parse_scene

            scene = load_scene(*parse_scene(self._spec))
            # The first picture loads the compiled shading, or compiles it: not while frames are awaited.
            scene.render(self._model, self._mount, _TAKE_OFF_NED_M, Attitude(0.0, 0.0, 0.0))
            self._scene = scene
        self._due_ns = self.clock.now_ns()

    def read(self, timeout_s: float) -> Frame:
        if self._scene is None:
            raise CameraError(f"camera {self.name}: not open")
        self._wait((self._due_ns - self.clock.now_ns()) / 1e9)
        pose, begun_ns = self._pose_to_show(timeout_s)
        # A late picture does not make the following ones hurry.
        self._due_ns = max(self._due_ns, begun_ns) + round(1e9 / self.settings.fps)
        if pose.position_ned_m is None or pose.attitude is None:
            raise CameraError(f"camera {self.name}: a pose without position or attitude")
        picture = self._scene.render(self._model, self._mount, pose.position_ned_m, pose.attitude)
        now_ns = self.clock.now_ns()
        self._costs_ns.append(now_ns - begun_ns)
        self._wait((pose.at_ns - now_ns) / 1e9)
        return self._frame(picture.image_bgr, pose.at_ns)

    def _pose_to_show(self, timeout_s: float) -> tuple[Telemetry, int]:
        """A whole pose, heard and shown later than the last picture's, and when it was found."""
        end_ns = self.clock.now_ns() + round(timeout_s * 1e9)
        while True:
            newest = self._poses.newest_pose()
            begun_ns = self.clock.now_ns()
            if newest.at_ns > self._last_pose_ns:
                pose = self._pose_when_ready(self._poses.telemetry_at(newest.at_ns), begun_ns)
                # After a stall a pose is shown as it was, and the last picture may have shown a later one.
                if _is_whole(pose) and pose.at_ns > self._shown_ns:
                    self._last_pose_ns, self._shown_ns = newest.at_ns, pose.at_ns
                    return pose, begun_ns
            if begun_ns >= end_ns:
                raise CameraTimeoutError(
                    f"camera {self.name}: waits for the autopilot's position and attitude "
                    "(LOCAL_POSITION_NED, ATTITUDE)"
                )
            self._wait(_POLL_S)

    def _pose_when_ready(self, newest: Telemetry, begun_ns: int) -> Telemetry:
        """The pose for the moment at which the picture will be ready, or the newest if that is too far."""
        if not self._costs_ns or not _is_whole(newest):
            return newest
        cost_ns = sorted(self._costs_ns)[round(_USUALLY_READY * (len(self._costs_ns) - 1))]
        ready_ns = begun_ns + min(cost_ns, _LONGEST_COST_NS)
        if ready_ns - newest.at_ns > _LONGEST_AHEAD_NS:
            return newest
        pose = self._poses.predicted_pose(ready_ns)
        return pose if _is_whole(pose) else newest

    def close(self) -> None:
        self._due_ns = 0


def _is_whole(pose: Telemetry) -> bool:
    return pose.position_ned_m is not None and pose.attitude is not None
