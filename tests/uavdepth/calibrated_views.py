"""Boards as a camera of known intrinsics sees them."""

from __future__ import annotations

import cv2
import numpy as np
from board_pictures import board_pose, varied_pictures

from uavdepth.calibration.board import Board, parse_board
from uavdepth.calibration.detection import BoardDetector, View
from uavdepth.camera import CameraModel

SIZE = (640, 480)
TRUE = CameraModel(*SIZE, 480.0, 482.0, 325.5, 236.0, (-0.22, 0.08, 0.0008, -0.0006, 0.0))
CHESSBOARD = parse_board("chessboard:9x6:25mm")
CHARUCO = parse_board("charuco:9x7:30mm:22mm")


def seen(board: Board, camera: CameraModel, count: int) -> list[View]:
    detector = BoardDetector(board)
    found = [
        detector.detect(picture, f"{number}.png")
        for number, picture in enumerate(varied_pictures(board, camera, count))
    ]
    return [view for view in found if isinstance(view, View)]


def ideal_views(
    camera: CameraModel,
    board: Board,
    count: int,
    noise_px: float = 0.05,
    tilt: float = 30.0,
    seed: int = 3,
    reach: float = 0.3,
) -> list[View]:
    """Corners as a camera projects them, without pictures."""
    rng = np.random.default_rng(seed)
    views = []
    for number in range(count):
        at = (0.5 + rng.uniform(-reach, reach), 0.5 + rng.uniform(-reach, reach))
        tilts = (rng.uniform(-tilt, tilt), rng.uniform(-tilt, tilt))
        distance_m = rng.uniform(1.0, 1.6) * board.size_m[0] * camera.fx / camera.width * 1.8
        turn, shift = board_pose(board, camera, at, distance_m, tilts, rng.uniform(-20, 20))
        points = board.corners_m.astype(float) + np.array([board.square_m, board.square_m, 0])
        pixels, _ = cv2.projectPoints(
            points, cv2.Rodrigues(turn)[0], shift, camera.matrix, np.array(camera.distortion)
        )
        noisy = pixels.reshape(-1, 2) + rng.normal(0, noise_px, (len(points), 2))
        inside = ((noisy > 0) & (noisy < np.array(SIZE) - 1)).all(axis=1)
        views.append(View(f"{number}.png", np.flatnonzero(inside), noisy[inside].astype(np.float32), 1.5))
    return views
