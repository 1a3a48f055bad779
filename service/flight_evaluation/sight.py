"""Eyes of the evaluated vehicle: what the camera gives at a pose, and who makes depth of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from service.frame import Frame
from service.pipeline import Perception, make_scanner
from service.settings import Settings
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints
from uavdepth.scenes import Scene

_TRUE_SIGMA = 0.01


class DepthKind(StrEnum):
    """Whose depth is flown with."""

    TRUE = "true"
    NETWORK = "network"


@dataclass(frozen=True)
class Sight:
    """A picture and its exact depth.

    Args:
        image_bgr: (H, W, 3) uint8; black where only depth was wanted.
        depth_m: (H, W) float32, +inf in the sky.
    """

    image_bgr: NDArray[np.uint8]
    depth_m: NDArray[np.float32]


class Camera:
    """Renders what is needed: with true depth nobody looks at the picture, and rays alone are three times
    faster."""

    def __init__(self, scene: Scene, camera: CameraModel, mount: CameraMount, kind: DepthKind) -> None:
        self._scene = scene
        self._camera = camera
        self._mount = mount
        self._kind = kind
        self._black = np.zeros((camera.height, camera.width, 3), np.uint8)
        self._order = _tiles(camera.height, camera.width)
        self._rays = camera.normalized_rays.reshape(-1, 3)[self._order].astype(np.float64)
        self._lengths = np.linalg.norm(self._rays, axis=1)

    def look(self, position_ned_m: NDArray[np.float64], attitude: Attitude) -> Sight:
        """What it sees from a pose of the vehicle."""
        if self._kind is DepthKind.NETWORK:
            picture = self._scene.render(self._camera, self._mount, position_ned_m.tolist(), attitude)
            return Sight(picture.image_bgr, picture.depth_m)
        turn = attitude.ned_from_body
        origin = position_ned_m + turn @ self._mount.position_body_m
        directions = self._rays @ (turn @ self._mount.body_from_camera).T
        depth = np.empty(len(self._rays), np.float32)
        depth[self._order] = self._scene.ray_distance_m(origin, directions) / self._lengths
        return Sight(self._black, depth.reshape(self._camera.height, self._camera.width))


def _tiles(height: int, width: int) -> NDArray[np.intp]:
    """Pixels in squares of 4 x 4: rays that lie together are traced together."""
    row, column = np.divmod(np.arange(height * width), width)
    return np.lexsort((column % 4, row % 4, column // 4, row // 4))


class TrueDepth:
    """A depth source without any error: it is told the exact depth of each picture before it is asked."""

    def __init__(self) -> None:
        self.depth_m: NDArray[np.float32] | None = None

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        """The depth of the picture that was shown last."""
        depth = self.depth_m
        if depth is None or depth.shape != image_bgr.shape[:2]:
            raise ValueError(f"no exact depth of a picture of {image_bgr.shape[:2]} was given")
        return DepthMap(depth, np.full_like(depth, _TRUE_SIGMA))


@lru_cache(maxsize=1)
def _with_network(settings: Settings) -> Perception:
    """Loading takes seconds, and a hundred flights look with one network."""
    return Perception.load(settings)


class Eyes:
    """The service's perception over one kind of depth. It remembers: one for each flight.

    Args:
        settings: the configuration.
        kind: whose depth.

    Raises:
        ConfigError: the configured network cannot be used.
    """

    def __init__(self, settings: Settings, kind: DepthKind) -> None:
        self.kind = kind
        self._true: TrueDepth | None = None
        if kind is DepthKind.TRUE:
            self._true = TrueDepth()
            self.perception = Perception(
                settings, self._true, None, make_scanner(settings), takes=("ground",)
            )
        else:
            self.perception = _with_network(settings).beside(settings)

    def frame(self, sight: Sight, captured_ns: int, index: int) -> Frame:
        """The frame of a sight; the true depth source is told its depth."""
        if self._true is not None:
            self._true.depth_m = sight.depth_m
        return Frame(sight.image_bgr, captured_ns, index)
