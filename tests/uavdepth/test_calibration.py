"""A camera is found again from pictures of a board that it took."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest
from board_pictures import board_picture, board_pose, varied_pictures
from hypothesis import given
from hypothesis import strategies as st

from uavdepth.calibration.advice import advise, horizontal_fov_deg
from uavdepth.calibration.board import Board, parse_board
from uavdepth.calibration.coverage import cover
from uavdepth.calibration.detection import BoardDetector, Refusal, View, other_board
from uavdepth.calibration.picture import draw_coverage
from uavdepth.calibration.print_board import board_png
from uavdepth.calibration.selection import choose_views
from uavdepth.calibration.solve import Calibration, Distortion, solve
from uavdepth.camera import CameraModel
from uavdepth.errors import CalibrationError

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


@pytest.fixture(scope="module")
def charuco_views() -> list[View]:
    return seen(CHARUCO, TRUE, 18)


@pytest.fixture(scope="module")
def charuco_calibration(charuco_views: list[View]) -> Calibration:
    return solve(charuco_views, SIZE, CHARUCO)


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


def worst_corner_px(found: CameraModel, true: CameraModel) -> float:
    """By how much the two distortions differ in the picture's corners, in pixels."""
    rays = true.normalized_rays[[0, 0, -1, -1], [0, -1, 0, -1]].astype(np.float64)
    pixels = [
        cv2.projectPoints(rays, np.zeros(3), np.zeros(3), true.matrix, np.array(lens))[0].reshape(-1, 2)
        for lens in (found.distortion, true.distortion)
    ]
    return float(np.linalg.norm(pixels[0] - pixels[1], axis=1).max())


def assert_is_the_true_camera(calibration: Calibration) -> None:
    found = calibration.camera
    assert found.fx == pytest.approx(TRUE.fx, rel=0.005)
    assert found.fy == pytest.approx(TRUE.fy, rel=0.005)
    assert found.cx == pytest.approx(TRUE.cx, abs=1.0)
    assert found.cy == pytest.approx(TRUE.cy, abs=1.0)
    assert worst_corner_px(found, TRUE) < 0.5
    assert calibration.rms_px < 0.2


def test_pictures_of_a_chessboard_give_the_camera_back():
    assert_is_the_true_camera(solve(seen(CHESSBOARD, TRUE, 18), SIZE, CHESSBOARD))


def test_pictures_of_a_charuco_board_give_the_camera_back(charuco_calibration):
    assert_is_the_true_camera(charuco_calibration)
    assert charuco_calibration.left_out == ()


def test_the_truth_lies_within_four_standard_deviations(charuco_calibration):
    found, sigma = charuco_calibration.camera, charuco_calibration.sigma
    for value, truth, one in zip(
        (found.fx, found.fy, found.cx, found.cy), (TRUE.fx, TRUE.fy, TRUE.cx, TRUE.cy), sigma, strict=False
    ):
        assert abs(value - truth) < 4 * one


@pytest.mark.parametrize("model", list(Distortion))
def test_each_lens_model_finds_a_lens_without_distortion(model):
    true = CameraModel(*SIZE, 500.0, 500.0, 319.5, 239.5)
    found = solve(ideal_views(true, CHESSBOARD, 20, 0.02), SIZE, CHESSBOARD, model).camera
    assert len(found.distortion) == {"none": 0, "brown5": 5, "rational8": 8}[model]
    assert found.fx == pytest.approx(500, rel=0.003)
    assert found.cx == pytest.approx(319.5, abs=1)


def test_a_picture_that_contradicts_the_others_is_named_and_left_out():
    views = ideal_views(TRUE, CHESSBOARD, 12)
    rng = np.random.default_rng(0)
    bad = views[4]
    bent = bad.pixels + rng.normal(0, 4, bad.pixels.shape).astype(np.float32)
    views[4] = View("bent.png", bad.ids, bent, 1.5)
    calibration = solve(views, SIZE, CHESSBOARD)
    assert [refusal.name for refusal in calibration.left_out] == ["bent.png"]
    assert "pixels" in calibration.left_out[0].reason
    assert len(calibration.views) == 11
    assert calibration.camera.fx == pytest.approx(TRUE.fx, rel=0.005)


def test_too_few_pictures_are_an_error_that_says_how_many():
    with pytest.raises(CalibrationError, match=r"3 pictures .* at least 4"):
        solve(ideal_views(TRUE, CHESSBOARD, 3), SIZE, CHESSBOARD)


# What a picture is refused for.


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


# What advice is given.


def texts(views: list[View], model: Distortion = Distortion.BROWN5) -> str:
    calibration = solve(views, SIZE, CHESSBOARD, model)
    return "\n".join(
        f"{'serious ' if remark.serious else ''}{remark.text}"
        for remark in advise(calibration, cover(calibration))
    )


def test_a_good_calibration_needs_no_advice():
    assert texts(ideal_views(TRUE, CHESSBOARD, 40, reach=0.42)) == ""


def test_pictures_that_all_face_the_board_are_a_serious_fault():
    assert "serious all pictures face the board squarely" in texts(
        ideal_views(TRUE, CHESSBOARD, 20, tilt=4.0)
    )


def test_pictures_from_which_no_focal_length_comes_out_are_an_error_that_says_what_to_do():
    with pytest.raises(CalibrationError, match="tilt it by 20 to 45 degrees"):
        solve(ideal_views(TRUE, CHESSBOARD, 20, tilt=1.0), SIZE, CHESSBOARD, Distortion.NONE)


def test_corners_of_the_picture_that_were_never_covered_are_named():
    views = [
        View(
            view.name,
            view.ids[keep],
            view.pixels[keep],
            1.5,
        )
        for view in ideal_views(TRUE, CHESSBOARD, 30)
        for keep in [~((view.pixels[:, 0] > 400) & (view.pixels[:, 1] > 300))]
        if keep.sum() > 20
    ]
    calibration = solve(views, SIZE, CHESSBOARD)
    coverage = cover(calibration)
    assert "bottom right" in coverage.empty_corners
    assert coverage.counts[-1, -1] == 0
    assert any("bottom right" in remark.text for remark in advise(calibration, coverage))
    drawn = draw_coverage(calibration, coverage)
    assert drawn.shape[1] == 1200
    hatched = (drawn == (60, 60, 150)).all(axis=2)
    assert hatched[760:890, 1060:].any()
    assert not hatched[400:500, 560:640].any()


def test_few_pictures_and_large_errors_are_told():
    said = texts(ideal_views(TRUE, CHESSBOARD, 6, noise_px=1.0))
    assert "only 6 pictures" in said
    assert "corners miss by" in said


def test_an_implausible_field_of_view_is_serious():
    fish = CameraModel(*SIZE, 30.0, 30.0, 319.5, 239.5)
    assert horizontal_fov_deg(fish) > 150
    calibration = solve(ideal_views(TRUE, CHESSBOARD, 12), SIZE, CHESSBOARD)
    changed = Calibration(fish, Distortion.NONE, calibration.sigma, calibration.rms_px, calibration.views, ())
    remarks = advise(changed, cover(changed))
    assert any(remark.serious and "field of view" in remark.text for remark in remarks)


def test_a_distortion_that_folds_the_picture_is_serious():
    folding = CameraModel(*SIZE, 300.0, 300.0, 319.5, 239.5, (-0.9, 0.0, 0.0, 0.0))
    calibration = solve(ideal_views(TRUE, CHESSBOARD, 12), SIZE, CHESSBOARD)
    changed = Calibration(
        folding, Distortion.BROWN5, calibration.sigma, calibration.rms_px, calibration.views, ()
    )
    remarks = advise(changed, cover(changed))
    assert any(remark.serious and "cannot be undone" in remark.text for remark in remarks)


# Which pictures are chosen.


def test_of_many_alike_pictures_only_different_ones_are_chosen():
    base = ideal_views(TRUE, CHESSBOARD, 6, 0.0)
    many = [view for view in base for _ in range(5)]
    chosen = choose_views(many, SIZE, CHESSBOARD, 20)
    assert {view.name for view in chosen} == {view.name for view in base}
    assert len(chosen) == 6


@given(st.integers(1, 12))
def test_never_more_pictures_are_chosen_than_asked_for_and_their_order_is_kept(at_most):
    views = ideal_views(TRUE, CHESSBOARD, 9)
    chosen = choose_views(views, SIZE, CHESSBOARD, at_most)
    assert len(chosen) <= at_most
    assert [view for view in views if any(view is each for each in chosen)] == list(chosen)


# The board.


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
