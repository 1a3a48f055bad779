"""Which frames an evaluation measures: worlds that training never saw, stored or rendered."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from frames import HEIGHT, WIDTH, ground_frame, make_store

from training.data.frame_store import read_frames
from training.errors import EvaluationError, TrainingDataError
from training.evaluation_command import parse_points
from training.evaluation_frames import EvaluationPlan, parse_seeds
from training.evaluation_run import indices_for_sheet


@pytest.mark.parametrize(
    ("scenes", "seeds", "frames", "complaint"),
    [
        (("city",), (3,), 1, "seed 3 is for training"),
        (("city",), (999, 1000), 1, "mixed"),
        (("moon",), (1000,), 1, "moon"),
        ((), (1000,), 1, "at least one"),
        (("city",), (), 1, "at least one"),
        (("city",), (1000,), 0, "at least one"),
    ],
)
def test_a_plan_that_proves_nothing_is_refused(
    scenes: tuple[str, ...], seeds: tuple[int, ...], frames: int, complaint: str
) -> None:
    with pytest.raises(EvaluationError, match=complaint):
        EvaluationPlan(scenes, seeds, frames)


def test_stored_frames_are_read_and_not_rendered_again(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000), ("wall", 1000)))
    plan = EvaluationPlan(("city", "wall"), (1000,), 2, tmp_path)
    frames = list(plan.frames())
    assert [(item.scene, item.index) for item in frames] == [
        ("city", 0),
        ("city", 1),
        ("wall", 0),
        ("wall", 1),
    ]
    stored = [record for record in read_frames(tmp_path) if record.name == "0000"]
    assert np.array_equal(frames[0].frame.depth_m, stored[0].depth_m())


def test_a_world_measures_the_same_whether_it_was_stored_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(1)
    noisy = rng.integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    rendered = [replace(ground_frame(3.0), image_bgr=noisy)]
    monkeypatch.setattr("training.evaluation_frames.load_scene", lambda *_: None)
    monkeypatch.setattr("training.evaluation_frames.render_world", lambda *_: rendered)
    (unstored,) = EvaluationPlan(("city",), (1000,), 1).frames()
    plan = EvaluationPlan(("city",), (1000,), 1, tmp_path)
    (written,), (read,) = plan.frames(), plan.frames()
    for item in (written, read):
        assert np.array_equal(item.frame.image_bgr, unstored.frame.image_bgr)
        assert np.array_equal(item.frame.depth_m, unstored.frame.depth_m)


def test_other_surfaces_are_the_same_every_time_and_change_no_depth(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    plain = EvaluationPlan(("city",), (1000,), 3, tmp_path)
    first, again = (list(replace(plain, other_surfaces=True).frames()) for _ in range(2))
    changed = 0
    for before, one, two in zip(plain.frames(), first, again, strict=True):
        assert np.array_equal(one.frame.image_bgr, two.frame.image_bgr)
        assert np.array_equal(one.frame.depth_m, before.frame.depth_m)
        changed += not np.array_equal(one.frame.image_bgr, before.frame.image_bgr)
    assert changed >= 2


def test_a_stored_picture_of_another_size_is_named(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    cv2.imwrite(str(tmp_path / "city-001000" / "0001.jpg"), np.zeros((10, 20, 3), np.uint8))
    plan = EvaluationPlan(("city",), (1000,), 2, tmp_path)
    with pytest.raises(
        TrainingDataError, match=rf"0001\.jpg is 20x10 pixels, its camera is {WIDTH}x{HEIGHT}"
    ):
        list(plan.frames())


def test_a_stored_depth_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    (tmp_path / "city-001000" / "0000.png").write_bytes(b"not a picture")
    with pytest.raises(TrainingDataError, match=r"0000\.png"):
        list(EvaluationPlan(("city",), (1000,), 1, tmp_path).frames())


@pytest.mark.parametrize(
    ("text", "seeds"),
    [("1000", (1000,)), ("1000-1002", (1000, 1001, 1002)), ("1000-1001, 1005,1001", (1000, 1001, 1005))],
)
def test_seeds_are_read_as_ranges(text: str, seeds: tuple[int, ...]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "x", "1-", "5-3", "1.5", "-1", "0-99999999"])
def test_seeds_that_cannot_be_read_are_named(text: str) -> None:
    with pytest.raises(EvaluationError, match="seeds"):
        parse_seeds(text)


def test_counts_of_points_are_read() -> None:
    assert parse_points("20, 100") == (20, 100)
    for text in ("", "x", "1.5", "-3", "20,"):
        with pytest.raises(EvaluationError, match="points"):
            parse_points(text)


def test_the_sheet_takes_as_many_frames_of_each_scene() -> None:
    plan = EvaluationPlan(("city", "wall", "forest"), (1000, 1001), 12)
    numbers = indices_for_sheet(plan)
    scenes = [(number // 12) % 3 for number in numbers]
    assert max(numbers) < plan.frames_count
    assert [scenes.count(scene) for scene in range(3)] == [8, 8, 8]
    assert {number // 36 for number in numbers} == {0, 1}
