"""A camera is found again from pictures of a board that it took."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from calibrated_views import CHARUCO, CHESSBOARD, SIZE, TRUE, ideal_views, seen
from hypothesis import given
from hypothesis import strategies as st

from uavdepth.calibration.advice import advise, horizontal_fov_deg
from uavdepth.calibration.coverage import cover
from uavdepth.calibration.detection import View
from uavdepth.calibration.picture import draw_coverage
from uavdepth.calibration.selection import choose_views
from uavdepth.calibration.solve import Calibration, Distortion, solve
from uavdepth.camera import CameraModel
from uavdepth.errors import CalibrationError


@pytest.fixture(scope="module")
def charuco_views() -> list[View]:
    return seen(CHARUCO, TRUE, 18)


@pytest.fixture(scope="module")
def charuco_calibration(charuco_views: list[View]) -> Calibration:
    return solve(charuco_views, SIZE, CHARUCO)


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
