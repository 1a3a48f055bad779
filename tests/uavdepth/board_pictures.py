"""Pictures of a printed board as a known camera would take them."""

from __future__ import annotations

import functools
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.calibration.board import Board
from uavdepth.camera import CameraModel

_SQUARE_PX = 48
_FINER = 2
"""Each pixel is the mean of so many times so many rays: without it edges are jagged and corners move."""


def board_picture(
    board: Board, camera: CameraModel, turn: NDArray[np.float64], shift_m: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """(H, W) uint8 the board before a grey wall, seen through the camera's lens, exactly.

    Args:
        turn: (3, 3) camera axes from board axes.
        shift_m: (3,) the first square's outer corner, in the camera's frame.
    """
    rays = _fine_rays(camera)
    normal = turn[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (normal @ shift_m) / (rays @ normal)
    on_board = (rays * depth[..., None] - shift_m) @ turn[:, :2]
    # The drawing has a margin of one white square, and its first pixel's centre lies half a pixel inside.
    page = cv2.copyMakeBorder(board.draw(_SQUARE_PX), *[_SQUARE_PX] * 4, cv2.BORDER_CONSTANT, value=255)
    place = (on_board / board.square_m + 1) * _SQUARE_PX - 0.5
    seen = cv2.remap(
        page,
        place[..., 0].astype(np.float32),
        place[..., 1].astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=120,
    )
    seen[~(depth > 0)] = 120
    whole = seen.reshape(camera.height, _FINER, camera.width, _FINER).mean(axis=(1, 3))
    return np.asarray(np.round(20 + whole * 0.8), np.uint8)


def board_pose(
    board: Board,
    camera: CameraModel,
    at: tuple[float, float],
    distance_m: float,
    tilt_deg: tuple[float, float] = (0.0, 0.0),
    turn_deg: float = 0.0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turn and shift that put the board's middle at a place of the picture.

    Args:
        at: x, y of the middle in shares of the picture.
        distance_m: depth of the middle.
        tilt_deg: about the picture's x and y axes.
        turn_deg: about the optical axis.
    """
    rx, ry = (cv2.Rodrigues(np.array(axis, float))[0] for axis in _axes(tilt_deg))
    rz = cv2.Rodrigues(np.array([0, 0, math.radians(turn_deg)]))[0]
    turn = rx @ ry @ rz
    x = (at[0] * camera.width - camera.cx) / camera.fx
    y = (at[1] * camera.height - camera.cy) / camera.fy
    width_m, height_m = board.size_m
    shift = distance_m * np.array([x, y, 1.0]) - turn @ np.array([width_m / 2, height_m / 2, 0])
    return turn, shift


def varied_pictures(board: Board, camera: CameraModel, count: int, seed: int = 0) -> list[NDArray[np.uint8]]:
    """Pictures of the board all over the picture, into its corners, tilted to all sides.

    A chessboard stays whole; of a ChArUco board, parts may lie outside.
    """
    rng = np.random.default_rng(seed)
    width_m, height_m = board.size_m
    margin_m = 0.0 if board.is_charuco else board.square_m
    pictures = []
    for number in range(count):
        share = rng.uniform(0.42, 0.6) if board.is_charuco else rng.uniform(0.34, 0.46)
        distance_m = width_m * camera.fx / (share * camera.width)
        tilt = (rng.choice([-1, 1]) * rng.uniform(15, 30), rng.choice([-1, 1]) * rng.uniform(15, 30))
        turn_deg = rng.uniform(-6, 6)
        column, row = number % 3 - 1, number // 3 % 3 - 1
        half_x = share * (width_m / 2 + margin_m) / width_m
        half_y = share * (height_m / 2 + margin_m) / width_m * camera.width / camera.height
        over = 1.5 if board.is_charuco else 1.0
        free = (over * max(0.0, 0.5 - half_x), over * max(0.0, 0.5 - half_y))
        at = (0.5 + column * free[0], 0.5 + row * free[1])
        turn, shift = board_pose(board, camera, at, distance_m, tilt, turn_deg)
        pictures.append(board_picture(board, camera, turn, shift))
    return pictures


@functools.lru_cache(maxsize=4)
def _fine_rays(camera: CameraModel) -> NDArray[np.float64]:
    fine = camera.scaled(camera.width * _FINER, camera.height * _FINER)
    return fine.normalized_rays.astype(np.float64)


def _axes(tilt_deg: tuple[float, float]) -> tuple[list[float], list[float]]:
    return [math.radians(tilt_deg[0]), 0.0, 0.0], [0.0, math.radians(tilt_deg[1]), 0.0]
