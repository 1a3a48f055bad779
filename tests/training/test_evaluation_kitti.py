"""KITTI's pictures, zero-shot: a drive on a level road made up here, and the real ten frames."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import pytest
from knowing_network import KnowingNetwork
from numpy.typing import NDArray
from sequence_files import DRIVE, KITTI_CAMERA, write_kitti_raw

from training.commands import evaluate
from training.errors import EvaluationError, TrainingDataError
from training.evaluation import MeasuredFrame
from training.evaluation_kitti import (
    CAMERA_HEIGHT_M,
    POINT_SIGMA,
    caution,
    kitti_frames,
    lidar_points,
    measure_kitti_frame,
    road_knowledge,
)
from training.evaluation_run import evaluate_kitti
from training.evaluation_sources import CONSTANT, FLAT_GROUND, Sources, nearest_of, points_scaled
from training.sequences.garg_crop import garg_mask
from training.sequences.kitti_raw import open_kitti_raw
from uavdepth.model.depth_model import DepthModel

REAL = Path(__file__).parents[3] / "shared" / "data" / "kitti_raw"
needs_real_pictures = pytest.mark.skipif(
    not REAL.is_dir(), reason="KITTI samples (../shared/data) are not part of the project"
)


def road_depth() -> NDArray[np.float32]:
    """(H, W) z-depth of a level road below the camera and of a wall 30 m ahead."""
    rays = KITTI_CAMERA.normalized_rays
    with np.errstate(divide="ignore"):
        road = np.where(rays[..., 1] > 0, CAMERA_HEIGHT_M / rays[..., 1], np.inf)
    return np.minimum(road, 30.0).astype(np.float32)


def write_road(root: Path, frames: int = 2) -> Path:
    """A drive whose LiDAR has a point in every pixel of the road and the wall."""
    x, y, z = np.moveaxis(KITTI_CAMERA.normalized_rays * road_depth()[..., None], -1, 0)
    return write_kitti_raw(root, range(frames), np.stack([z, -x, -y], axis=-1).reshape(-1, 3))


def measure(root: Path, network: KnowingNetwork, counts: tuple[int, ...] = (20,)) -> MeasuredFrame:
    sources = Sources(cast(DepthModel, network), counts)
    return measure_kitti_frame(sources, kitti_frames(open_kitti_raw(root))[0])


def test_on_a_level_road_the_flat_road_is_right_wherever_the_wall_is_not(tmp_path: Path) -> None:
    sources = measure(write_road(tmp_path), KnowingNetwork(road_depth() * np.float32(3.0))).errors.sources
    flat = sources[FLAT_GROUND].metric
    assert flat is not None
    near = [band for band in flat.bands[1:4] if band is not None]
    assert near
    assert all(band.abs_rel < 0.02 for band in near)
    assert sources["none"].scaled.overall.abs_rel < 0.01
    assert sources["none"].factor == pytest.approx(1 / 3, rel=0.01)
    assert {CONSTANT, nearest_of(20), points_scaled(20)} <= set(sources)


def test_points_from_the_lidar_set_the_scale_to_within_their_noise(tmp_path: Path) -> None:
    network = KnowingNetwork(road_depth() * np.float32(3.0))
    scaled = measure(write_road(tmp_path), network, (200,)).errors.sources[points_scaled(200)].metric
    assert scaled is not None
    assert scaled.overall.abs_rel < POINT_SIGMA


def test_points_that_were_told_and_what_lies_outside_the_crop_are_not_scored(tmp_path: Path) -> None:
    root = write_road(tmp_path)
    frame = kitti_frames(open_kitti_raw(root))[0]
    truth = frame.drive.truth_m(0)
    assert truth is not None
    knowledge = road_knowledge(frame, truth, (20,))
    scored = knowledge.without_points(truth)[garg_mask(*truth.shape)]
    found = measure(root, KnowingNetwork(road_depth())).errors
    assert found.points == {20: 20}
    assert sum(found.sources["none"].scaled.pixels) == np.count_nonzero(~np.isnan(scored))


def test_lidar_points_have_the_noise_that_they_claim_and_are_the_same_every_time() -> None:
    truth = np.full((100, 100), 20.0, np.float32)
    truth[::2] = np.nan
    truth[:, :50] = 200.0
    first, second = (lidar_points(np.random.default_rng(3), truth, 300) for _ in range(2))
    assert np.array_equal(first.depth_m, second.depth_m)
    assert np.std(np.log(first.depth_m / 20.0)) == pytest.approx(POINT_SIGMA, rel=0.15)
    column, row = first.pixels.astype(int).T
    assert (truth[row, column] == 20.0).all(), "only where the LiDAR sees something in range"
    assert len({*zip(column.tolist(), row.tolist(), strict=True)}) == 300
    assert len(lidar_points(np.random.default_rng(3), truth[:3], 300)) == 50, "no more than there are"


def test_the_same_picture_gets_the_same_points(tmp_path: Path) -> None:
    frames = kitti_frames(open_kitti_raw(write_road(tmp_path)))
    truth = frames[0].drive.truth_m(0)
    assert truth is not None
    first, again, other = (road_knowledge(frame, truth, (20,)) for frame in (frames[0], *frames))
    assert np.array_equal(first.points[20].pixels, again.points[20].pixels)
    assert not np.array_equal(first.points[20].pixels, other.points[20].pixels)


def test_only_the_left_camera_counts(tmp_path: Path) -> None:
    drives = open_kitti_raw(write_road(tmp_path, 5))
    assert len(drives) == 2
    frames = kitti_frames(drives, 2)
    assert [frame.index for frame in frames] == [0, 2, 4]
    assert all(frame.drive.name.endswith("image_02") for frame in frames)
    with pytest.raises(EvaluationError, match="image_02"):
        kitti_frames(drives[1:])


def test_a_broken_picture_is_skipped_and_named(tmp_path: Path) -> None:
    root = write_road(tmp_path, 3)
    broken = root / DRIVE / "image_02" / "data" / "0000000001.png"
    cv2.imwrite(str(broken), np.zeros((5, 5, 3), np.uint8))
    (root / DRIVE / "velodyne_points" / "data" / "0000000002.bin").unlink()
    network = cast(DepthModel, KnowingNetwork(road_depth()))
    report = evaluate_kitti(network, root, (20,)).report
    assert len(report.errors) == 1
    assert len(report.skipped) == 2
    assert "0000000001.png" in report.skipped[0]
    assert "no LiDAR points" in report.skipped[1]
    assert report.as_json()["skipped"] == list(report.skipped)


def test_a_folder_without_drives_is_named(tmp_path: Path) -> None:
    network = cast(DepthModel, KnowingNetwork(road_depth()))
    with pytest.raises(TrainingDataError, match="nowhere"):
        evaluate_kitti(network, tmp_path / "nowhere", (20,))
    with pytest.raises(TrainingDataError, match="image_02"):
        evaluate_kitti(network, tmp_path, (20,))


def test_drives_of_which_nothing_can_be_measured_are_an_error(tmp_path: Path) -> None:
    root = write_kitti_raw(tmp_path)
    network = cast(DepthModel, KnowingNetwork(road_depth()))
    with pytest.raises(EvaluationError, match=r"none of 5 pictures .* no LiDAR"):
        evaluate_kitti(network, root, (20,))


def test_few_pictures_are_said_to_decide_nothing() -> None:
    assert caution(10).startswith("10 pictures decide nothing")
    assert "decide nothing" not in caution(697)


def test_rendered_worlds_and_real_pictures_are_not_mixed(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="--kitti"):
        evaluate("default", seeds="1000", kitti=tmp_path)


@needs_real_pictures
def test_the_real_ten_frames_are_measured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    evaluate(
        "default",
        kitti=REAL,
        every=5,
        points="100",
        provider="cpu",
        threads=1,
        as_json="-",
        sheet=tmp_path / "sheet.png",
    )
    content = json.loads(capsys.readouterr().out)
    assert "decide nothing" in content["note"]
    sources = content["parts"]["kitti"]["sources"]
    assert sources["none"]["frames"] == 2
    # Constant depth is known to be 0.45 wrong on these ten frames, a flat road near or far from it.
    assert sources[CONSTANT]["median_scaled"]["abs_rel"] == pytest.approx(0.43, abs=0.05)
    assert math.isfinite(sources[FLAT_GROUND]["metric"]["abs_rel"])
    assert content["parts"]["kitti"]["mean_points"] == {"100": 100.0}
    assert (tmp_path / "sheet.png").stat().st_size > 10_000
