"""A network's 8-bit file: taken where it is faster, never in place of a network that it was not made from."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from onnx_files import HEIGHT, WIDTH, card_values, write_red_network

from uavdepth import Attitude, CameraModel, CameraMount, DepthModel, ModelFileError
from uavdepth.errors import ProviderFallbackWarning
from uavdepth.model import network_file
from uavdepth.model.inference import InferenceSession, open_session
from uavdepth.model.int8_file import int8_beside
from uavdepth.model.network_file import shipped_networks
from uavdepth.model.providers import PROVIDERS
from uavdepth.scenes import load_scene

GAIN_OF_INT8 = 2.0
"""Tells the two files apart: the network's own has 1."""


@pytest.fixture
def network(tmp_path: Path) -> Path:
    """A network with its 8-bit file."""
    path = write_red_network(tmp_path / "net.onnx", card_values())
    write_red_network(int8_beside(path), card_values(), gain=GAIN_OF_INT8, int8_of=path)
    return path


@pytest.fixture
def cpu_prefers_int8(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PROVIDERS, "cpu", replace(PROVIDERS["cpu"], prefers_int8=lambda: True))


def gain(inference: InferenceSession) -> float:
    """Of the file that was really loaded."""
    ones = np.ones((1, 3, HEIGHT, WIDTH), np.float32)
    return float(inference.session.run(None, {"image": ones})[0].mean())


def opened(path: Path, precision: str) -> InferenceSession:
    """Without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return open_session(path, "cpu", 1, precision)


@pytest.mark.usefixtures("cpu_prefers_int8")
@pytest.mark.parametrize(
    ("precision", "expected"), [("auto", GAIN_OF_INT8), ("int8", GAIN_OF_INT8), ("float", 1.0)]
)
def test_auto_takes_the_8_bit_file_where_the_provider_is_faster_with_it(
    network: Path, precision: str, expected: float
) -> None:
    inference = opened(network, precision)
    assert gain(inference) == expected
    assert inference.precision == ("fp32" if expected == 1.0 else "int8")
    assert inference.fallback_reason is None


def test_auto_leaves_the_8_bit_file_where_it_was_not_measured_to_be_faster(network: Path) -> None:
    assert gain(opened(network, "auto")) == 1.0
    assert gain(opened(network, "int8")) == GAIN_OF_INT8


@pytest.mark.usefixtures("cpu_prefers_int8")
def test_without_an_8_bit_file_auto_is_silent_and_int8_says_how_to_make_one(tmp_path: Path) -> None:
    path = write_red_network(tmp_path / "net.onnx", card_values())
    assert opened(path, "auto").precision == "fp32"
    with pytest.raises(ModelFileError, match=r"no net-int8\.onnx beside .* `uavdepth quantize`"):
        open_session(path, "cpu", 1, "int8")


@pytest.mark.usefixtures("cpu_prefers_int8")
def test_the_8_bit_file_of_a_replaced_network_does_not_fly(network: Path) -> None:
    write_red_network(network, card_values(name="another"), gain=3.0)
    with pytest.warns(ProviderFallbackWarning, match=r"in fp32: net-int8\.onnx was not made from this"):
        inference = open_session(network, "cpu", 1, "auto")
    assert gain(inference) == 3.0
    assert inference.fallback_reason is not None
    with pytest.raises(ModelFileError, match=r"was not made from this network"):
        open_session(network, "cpu", 1, "int8")


@pytest.mark.usefixtures("cpu_prefers_int8")
def test_a_broken_8_bit_file_leaves_the_network_flying(network: Path) -> None:
    int8_beside(network).write_bytes(b"not a network")
    with pytest.warns(ProviderFallbackWarning, match=r"net-int8\.onnx: .* cannot load it"):
        assert gain(open_session(network, "cpu", 1, "auto")) == 1.0


def test_an_unknown_precision_is_named(network: Path) -> None:
    with pytest.raises(ModelFileError, match="precision is 'int4': one of auto, float, int8 is needed"):
        open_session(network, "cpu", 1, "int4")


def test_the_model_says_what_it_computes_in(network: Path) -> None:
    picture = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    camera = CameraModel.from_fov(WIDTH, HEIGHT, 90.0)
    models = {name: DepthModel.load(network, "cpu", 1, precision=name) for name in ("float", "int8")}
    assert {name: model.precision for name, model in models.items()} == {"float": "fp32", "int8": "int8"}
    near = {name: float(model.infer(picture, camera).depth_m.mean()) for name, model in models.items()}
    assert near["int8"] < near["float"]


def test_8_bit_files_are_no_networks_of_their_own(network: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network_file, "WEIGHTS_FOLDER", network.parent)
    assert shipped_networks() == ["net"]


@pytest.mark.parametrize("name", shipped_networks())
def test_every_shipped_network_has_an_8_bit_file_that_was_made_from_it_and_sees_alike(name: str) -> None:
    exact, coarse = (DepthModel.load(name, "cpu", 1, precision=each) for each in ("float", "int8"))
    assert coarse.precision == "int8"
    said = coarse.card.measured["int8_against_float"]
    assert isinstance(said, dict)
    assert {"none", "ground", "ground+100 points"} == set(said)
    for cost in said.values():
        assert cost["int8_abs_rel"] <= 1.02 * cost["float_abs_rel"]
    camera = CameraModel.from_fov(320, 160, 90.0)
    world = load_scene("city", 900)
    picture = world.render(camera, CameraMount(), (0.0, 0.0, -3.0), Attitude(0.0, 0.0, 0.0)).image_bgr
    ratio = coarse.infer(picture, camera).depth_m / exact.infer(picture, camera).depth_m
    assert np.median(np.abs(np.log(ratio))) < 0.04
    assert not np.array_equal(ratio, np.ones_like(ratio))
