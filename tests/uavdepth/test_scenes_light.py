"""How the renderer lights and samples surfaces."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

pytest.importorskip("embreex")
pytest.importorskip("numba")

from numpy.typing import ArrayLike, NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import Scene
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.mesh import MeshBuilder

CAMERA = CameraModel.from_fov(96, 64, 60)
MOUNT = CameraMount()
LEVEL = Attitude(0.0, 0.0, 0.0)
HERE = (0.0, 0.0, 0.0)
SUN_BEHIND = np.array([-0.8, 0.36, -0.48])


def _flat(north_m: ArrayLike, east_m: ArrayLike) -> NDArray[np.float64]:
    return np.full(np.broadcast(north_m, east_m).shape, -1000.0)


def _scene(builder: MeshBuilder) -> Scene:
    description = SceneDescription(
        mesh=builder.build(),
        ground_height_m=_flat,
        sun_direction_ned=SUN_BEHIND,
        sun_bgr=(1.0, 1.0, 1.0),
        ambient_bgr=(0.3, 0.3, 0.3),
        sky_top_bgr=(0.9, 0.6, 0.3),
        sky_horizon_bgr=(0.9, 0.85, 0.8),
        haze_per_m=0.0,
        cloud_amount=0.0,
        extent_m=40.0,
    )
    return Scene("light", 0, description)


def _quad(corners: ArrayLike, reverse: bool = False, smooth: bool = False, tint: float = 1.0) -> MeshBuilder:
    """Quads given by (K, 4, 3) corners that share vertices where they are equal."""
    points = np.asarray(corners, float).reshape(-1, 3)
    vertices, number = np.unique(points, axis=0, return_inverse=True)
    ring = number.reshape(-1, 4)
    faces = np.concatenate([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]])
    builder = MeshBuilder()
    builder.add(
        vertices,
        faces[:, ::-1] if reverse else faces,
        vertices[:, 1:],
        "concrete",
        (tint,) * 3,
        smooth=smooth,
    )
    return builder


BOARD = [[(10.0, -3.0, 2.0), (10.0, 3.0, 2.0), (10.0, 3.0, -2.0), (10.0, -3.0, -2.0)]]


def test_both_sides_of_a_face_take_light_alike() -> None:
    """A board that faces the viewer and one that turns its back look the same: neither shades itself."""
    front, back = (
        _scene(_quad(BOARD, reverse)).render(CAMERA, MOUNT, HERE, LEVEL) for reverse in (False, True)
    )
    np.testing.assert_array_equal(front.depth_m, back.depth_m)
    assert np.abs(front.image_bgr.astype(int) - back.image_bgr).max() <= 1
    board = front.image_bgr[np.isfinite(front.depth_m)]
    assert board.mean() > 100.0, "in full sun"


def test_smooth_faces_hide_the_edge_between_them_and_flat_ones_show_it() -> None:
    """Two halves of a folded sheet: brightness jumps at the fold unless normals are smooth."""
    fold = [
        [(10.0, -3.0, 3.0), (9.0, 0.0, 3.0), (9.0, 0.0, -3.0), (10.0, -3.0, -3.0)],
        [(9.0, 0.0, 3.0), (10.0, 3.0, 3.0), (10.0, 3.0, -3.0), (9.0, 0.0, -3.0)],
    ]

    def jump(smooth: bool) -> float:
        image = _scene(_quad(fold, smooth=smooth)).render(CAMERA, MOUNT, HERE, LEVEL).image_bgr.astype(float)
        columns = image[20:44].mean(axis=(0, 2))
        return abs(columns[44:47].mean() - columns[49:52].mean())

    assert jump(smooth=False) > 12.0
    assert jump(smooth=True) < 0.5 * jump(smooth=False)


def test_slanted_edges_are_as_smooth_as_in_a_picture_of_16_times_the_pixels() -> None:
    scene = _scene(_quad(BOARD, tint=0.15))
    attitude = Attitude(0.3, 0.0, 0.0)
    picture = scene.render(CAMERA, MOUNT, HERE, attitude)
    fine = scene.render(CAMERA.scaled(96 * 4, 64 * 4), MOUNT, HERE, attitude)
    reference = cv2.resize(fine.image_bgr, (96, 64), interpolation=cv2.INTER_AREA).astype(float)
    board = np.isfinite(fine.depth_m).reshape(64, 4, 96, 4).mean(axis=(1, 3))
    edge = (board > 0.05) & (board < 0.95)
    away = np.abs(picture.image_bgr - reference).mean(axis=2)[edge]
    contrast = np.ptp(reference.mean(axis=2)[edge])
    assert edge.sum() > 100
    assert contrast > 60.0
    assert away.mean() < 0.12 * contrast
