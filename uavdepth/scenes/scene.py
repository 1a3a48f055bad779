"""A rendered world to fly in."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import SceneError
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.picture import RenderedPicture

if TYPE_CHECKING:
    from uavdepth.scenes.flight import Flight
    from uavdepth.scenes.renderer import Renderer

_CLEARANCE_LIMIT_M = 1000.0


class Scene:
    """One world, loaded. The same name and seed give the same world and pictures, to the bit.

    Args:
        name: what the scene is called.
        seed: which variant of it.
        description: mesh, light and air. What rendering does not need of it is not kept.

    Attributes:
        extent_m: half the side of the square around the origin that is worth flying in.
        sun_direction_ned: (3,) unit vector towards the sun.

    Raises:
        SceneError: embreex or numba is not installed.
    """

    def __init__(self, name: str, seed: int, description: SceneDescription) -> None:
        self.name = name
        self.seed = seed
        self.extent_m = description.extent_m
        self.sun_direction_ned = description.sun_direction_ned
        self._ground_height_m = description.ground_height_m
        self._renderer = _load_renderer(description, seed)

    def render(
        self,
        camera: CameraModel,
        mount: CameraMount,
        position_ned_m: Sequence[float],
        attitude: Attitude,
    ) -> RenderedPicture:
        """What the camera sees, with the exact depth of each pixel's centre.

        Args:
            camera: intrinsics, distortion included.
            mount: the camera in the vehicle's body frame.
            position_ned_m: the vehicle's position, NED metres.
            attitude: the vehicle's attitude.

        Returns:
            The picture, its depth along the optical axis, +inf in the sky.
        """
        ned_from_body = attitude.ned_from_body
        position = _point(position_ned_m) + ned_from_body @ mount.position_body_m
        return self._renderer.picture(camera, ned_from_body @ mount.body_from_camera, position)

    def ground_height_m(self, north_m: float, east_m: float) -> float:
        """Height of the bare ground in metres, up positive."""
        return float(self._ground_height_m(north_m, east_m))

    def ground_heights_m(self, north_m: ArrayLike, east_m: ArrayLike) -> NDArray[np.float64]:
        """Heights of the bare ground in metres, up positive, at many places (any equal shapes)."""
        return self._ground_height_m(north_m, east_m)

    def rangefinder_m(self, position_ned_m: Sequence[float]) -> float | None:
        """Metres straight down to the first surface of anything, or None when nothing is below."""
        reading = float(self.ray_distance_m(_point(position_ned_m), np.array([0.0, 0.0, 1.0]))[0])
        return reading if np.isfinite(reading) else None

    def ray_distance_m(self, origin_ned_m: ArrayLike, direction_ned: ArrayLike) -> NDArray[np.float64]:
        """Metres along rays to the first surface.

        Args:
            origin_ned_m: (N, 3) or (3,) NED metres.
            direction_ned: (N, 3) or (3,) directions of any length above 0.

        Returns:
            (N,) float64 distances, +inf where the ray is free.
        """
        origins = np.atleast_2d(np.asarray(origin_ned_m, np.float64))
        directions = np.atleast_2d(np.asarray(direction_ned, np.float64))
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        if origins.shape[1] != 3 or directions.shape[1] != 3 or not np.all(lengths > 0):
            raise SceneError("rays need origins and directions of shape (N, 3), directions longer than 0")
        count = max(len(origins), len(directions))
        start = np.broadcast_to(origins, (count, 3)).astype(np.float32)
        aim = np.broadcast_to(directions / lengths, (count, 3)).astype(np.float32)
        return self._renderer.distances(start, aim).astype(np.float64)

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        """Metres from a point to the nearest surface of anything, the ground included.

        Exact, at most 1000 m; 0 below the ground and inside closed solids such as buildings.
        """
        point = _point(position_ned_m)
        if -point[2] <= self.ground_height_m(float(point[0]), float(point[1])):
            return 0.0
        return self._renderer.clearance_m(point, _CLEARANCE_LIMIT_M)

    def flight(self, seed: int, duration_s: float) -> Flight:
        """A smooth flight clear of obstacles, with the attitude that its accelerations need.

        Args:
            seed: which flight.
            duration_s: its length in seconds.
        """
        from uavdepth.scenes.flight import plan_flight

        return plan_flight(self, seed, duration_s)


def _point(position_ned_m: ArrayLike) -> NDArray[np.float64]:
    point = np.asarray(position_ned_m, np.float64)
    if point.shape != (3,) or not np.all(np.isfinite(point)):
        raise SceneError(f"position {position_ned_m!r} is not three finite numbers")
    return point


def _load_renderer(description: SceneDescription, seed: int) -> Renderer:
    for package in ("embreex", "numba"):
        try:
            importlib.import_module(package)
        except ImportError as error:
            raise SceneError(
                f"rendered scenes need the package {package}, which is not here ({error}): "
                "pip install 'uavdepth[sim]' (embreex has wheels for x86-64, and for macOS on arm64)"
            ) from error
    from uavdepth.scenes.renderer import Renderer

    return Renderer(description, seed)
