"""A network with hints gets what the vehicle knows, in its own unit; without, it gets nothing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from onnx_files import hinted_card, write_hinted_network, write_red_network

from uavdepth import (
    Attitude,
    CameraModel,
    CameraMount,
    DepthModel,
    GroundHint,
    Hints,
    ModelCardError,
    PointHints,
)

CAMERA = CameraModel.from_fov(96, 64, 90)
MOUNT = CameraMount(pitch_deg=-20.0)
PICTURE = np.zeros((64, 96, 3), np.uint8)
UNHINTED = 1e-3


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> DepthModel:
    path = write_hinted_network(tmp_path_factory.mktemp("net") / "hinted.onnx", unhinted=UNHINTED)
    return DepthModel.load(path, provider="cpu", threads=1)


def test_ground_and_point_come_back_as_the_metres_they_were_given_in(model: DepthModel) -> None:
    points = PointHints(np.array([[30.0, 10.0]]), np.array([7.0]), np.array([0.05]))
    hints = Hints(GroundHint(MOUNT, Attitude(0.1, -0.1, 1.0), 3.0), points)
    depth_m = model.infer(PICTURE, CAMERA, hints).depth_m
    assert depth_m[10, 30] == pytest.approx(7.0, rel=1e-4)
    row, column = 60, 40
    # The network's pixels are two of the camera's wide: the plane is exact at their centres.
    ray = CAMERA.scaled(48, 32).normalized_rays[row // 2, column // 2]
    down = Attitude(0.1, -0.1, 1.0).level_from_body[2] @ MOUNT.body_from_camera @ ray
    assert depth_m[row, column] == pytest.approx(3.0 / down, rel=1e-4)


@pytest.mark.parametrize("hints", [None, Hints()])
def test_without_hints_the_planes_are_empty(model: DepthModel, hints: Hints | None) -> None:
    result = model.infer(PICTURE, CAMERA, hints)
    farthest_m = min(100.0, CAMERA.fx * 0.5 / (40.0 * UNHINTED))
    np.testing.assert_allclose(result.depth_m, farthest_m, rtol=1e-4)
    assert result.relative_sigma is not None
    np.testing.assert_allclose(result.relative_sigma, math.exp(-2.0), rtol=1e-4)


def test_a_network_without_hints_is_not_given_any(tmp_path: Path) -> None:
    from onnx_files import card_values

    plain = DepthModel.load(write_red_network(tmp_path / "n.onnx", card_values()), provider="cpu", threads=1)
    hints = Hints(GroundHint(MOUNT, Attitude(0, 0, 0), 3.0))
    np.testing.assert_array_equal(
        plain.infer(PICTURE, CAMERA, hints).depth_m, plain.infer(PICTURE, CAMERA).depth_m
    )


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"hints": ["ground"]}, r"inputs that the card does not explain: \['points'\]"),
        ({"hints": []}, r"does not explain: \['ground', 'points'\]"),
        ({"ground_name": "plane"}, "ground_name is 'plane'"),
        ({"points_name": "ground"}, r"'ground' of \[1, 2, 32, 48\], the network's is \[1, 1, 32, 48\]"),
        ({"focal_px": None}, "'focal_px' is needed for a network with hints"),
        ({"metric": False}, "'metric' is needed for a network with hints"),
        ({"uncertainty": None}, "'uncertainty' is needed for a network with hints"),
        ({"multiple_of": 16}, "a network with hints has a fixed size"),
        ({"hints": ["ground", "ground"]}, "'hints' names one twice"),
        ({"hints": ["sun"]}, r"'hints\.0' is 'sun'"),
        ({"card_version": 1}, "'hints' needs card_version = 2"),
        ({"hint_layout": "levels"}, r"'hint_layout' is 'levels': .* 48x32: multiples of 32 are needed"),
        ({"hint_layout": "levels", "hints": ["ground"]}, r"needs the hints 'ground' and 'points', not \['gr"),
        ({"hint_layout": "levels", "input_width": 64}, "hint_layout is 'levels', .* an input 'hints_2', the"),
    ],
)
def test_a_card_that_tells_other_hints_than_the_network_takes_is_refused(
    tmp_path: Path, changes: dict[str, object], text: str
) -> None:
    path = write_hinted_network(tmp_path / "n.onnx", hinted_card(**changes))
    with pytest.raises(ModelCardError, match=text):
        DepthModel.load(path, provider="cpu")
