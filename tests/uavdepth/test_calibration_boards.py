"""Boards: how they are written, printed and found in a picture."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest
from board_pictures import board_picture, board_pose
from calibrated_views import CHARUCO, CHESSBOARD, TRUE
from hypothesis import given
from hypothesis import strategies as st

from uavdepth.calibration.board import Board, parse_board
from uavdepth.calibration.detection import BoardDetector, Refusal, View, other_board
from uavdepth.calibration.print_board import board_png
from uavdepth.errors import CalibrationError


def near_picture(board: Board = CHARUCO) -> np.ndarray:
    pose = board_pose(board, TRUE, (0.5, 0.5), board.size_m[0] * 1.2, (15.0, 20.0))
    return board_picture(board, TRUE, *pose)


@pytest.mark.parametrize("board", [CHARUCO, CHESSBOARD])
def test_a_sharp_picture_is_taken_and_a_blurred_one_is_refused_as_blurred(board):
    detector = BoardDetector(board)
    sharp = near_picture(board)
    view = detector.detect(sharp, "sharp")
    assert isinstance(view, View)
    assert 1 <= view.edge_width_px < 2
    answer = detector.detect(cv2.GaussianBlur(sharp, (0, 0), 2.4), "soft")
    assert isinstance(answer, Refusal)
    assert answer.name == "soft"
    assert "blurred" in answer.reason


def test_motion_along_one_axis_counts_as_blur():
    moved = BoardDetector(CHESSBOARD).detect(cv2.blur(near_picture(CHESSBOARD), (9, 1)), "moved")
    assert isinstance(moved, Refusal)
    assert "blurred" in moved.reason


@pytest.mark.parametrize("board", [CHARUCO, CHESSBOARD])
def test_an_empty_picture_shows_no_board(board):
    answer = BoardDetector(board).detect(np.full((480, 640, 3), 127, np.uint8), "empty")
    assert isinstance(answer, Refusal)
    assert "no board" in answer.reason


def test_a_board_of_another_size_is_told_by_what_is_there():
    picture = near_picture(CHESSBOARD)
    wrong = parse_board("chessboard:8x5:25mm")
    assert isinstance(BoardDetector(wrong).detect(picture, "p"), Refusal)
    assert other_board(wrong, picture) == "a chessboard with 9x6 inner corners"
    assert other_board(CHESSBOARD, picture) is None


def test_markers_that_the_board_does_not_have_are_told():
    assert "markers 0 to 16" in str(other_board(parse_board("charuco:7x5:30mm:22mm"), near_picture()))


def test_a_part_of_a_charuco_board_is_enough():
    picture = near_picture()
    picture[:, :300] = 100
    view = BoardDetector(CHARUCO).detect(picture, "half")
    assert isinstance(view, View)
    assert 8 <= len(view.ids) < len(CHARUCO.corners_m)


@given(st.integers(3, 20), st.integers(3, 20), st.integers(2, 500))
def test_a_chessboard_is_read_as_it_is_written(columns, rows, side_mm):
    board = parse_board(f"chessboard:{columns}x{rows}:{side_mm}mm")
    assert board.inner == (columns, rows)
    assert board.square_m == pytest.approx(side_mm / 1000)
    assert len(board.corners_m) == columns * rows


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("chessboard", "chessboard:COLUMNSxROWS:SIDE"),
        ("chessboard:9-6:25mm", "no size"),
        ("chessboard:9x6:25", "no length"),
        ("chessboard:9x1:25mm", "2 rows"),
        ("chessboard:9x6:1mm", "1 mm"),
        ("charuco:7x5:30mm", "charuco:COLUMNSxROWS"),
        ("charuco:7x5:30mm:31mm", "do not fit"),
        ("charuco:7x5:30mm:22mm:9X9_1", "no dictionary 9X9_1"),
        ("charuco:20x20:30mm:22mm:4X4_50", "200 markers are needed"),
    ],
)
def test_a_board_that_cannot_be_is_refused_with_the_reason(text, part):
    with pytest.raises(CalibrationError, match=part):
        parse_board(text)


@pytest.mark.parametrize(
    "text", ["chessboard:6x4:20mm", "charuco:5x4:31mm:20mm", "charuco-legacy:5x4:3cm:2cm"]
)
def test_the_printed_board_has_its_true_size_and_is_found(text):
    board = parse_board(text)
    data = board_png(board)
    page = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    at = data.index(b"pHYs")
    per_m, per_m_y, unit = struct.unpack(">IIB", data[at + 4 : at + 13])
    assert (per_m, unit) == (per_m_y, 1)
    assert data.count(b"pHYs") == 1
    assert page.shape[1] / per_m == pytest.approx((board.columns + 2) * board.square_m, rel=1e-4)
    view = BoardDetector(board).detect(page, "page")
    assert isinstance(view, View)
    assert len(view.ids) == len(board.corners_m)
    sides = np.ptp(view.pixels, axis=0) / per_m / board.square_m
    assert sorted(sides) == pytest.approx(sorted(side - 1 for side in board.inner), rel=1e-3)
