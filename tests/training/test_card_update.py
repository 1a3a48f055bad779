"""The card of a network that is there already: errors measured with it, and its 8-bit file's card."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnx
import pytest
from frames import ground_frame
from small_runs import two_steps

from training.card_command import card as card_command
from training.card_update import update_card
from training.errors import EvaluationError, ExportError
from training.export import export_checkpoint
from training.onnx_file import write_checked
from uavdepth.errors import ModelFileError
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.int8_file import SOURCE_METADATA_KEY, digest, int8_beside


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("network") / "net.onnx"
    checkpoint = two_steps(tmp_path_factory.mktemp("frames"))
    export_checkpoint(checkpoint, path, "narrow", {"old": 1, "sigma_calibration": {"factor": 1.0}})
    return path.read_bytes()


@pytest.fixture
def network(exported: bytes, tmp_path: Path) -> Path:
    """A network with what passes for its 8-bit file: the same graph under that name."""
    path = tmp_path / "net.onnx"
    path.write_bytes(exported)
    graph = onnx.load(str(path))
    card = DepthModel.load(path, "cpu", 1).card
    second = card.model_copy(update={"measured": {**card.measured, "int8_against_float": {"none": 2}}})
    write_checked(graph, second, int8_beside(path), lambda _path: None, {SOURCE_METADATA_KEY: digest(path)})
    return path


def test_both_files_get_the_errors_and_still_fly_together(network: Path, tmp_path: Path) -> None:
    frame = ground_frame()
    before = DepthModel.load(network, "cpu", 1).infer(frame.image_bgr, frame.camera).depth_m
    result = tmp_path / "result.json"
    result.write_text(json.dumps({"summary": {"frames": 7}}))
    card_command(str(network), result, "5 pictures; 1 hour")

    in_float = DepthModel.load(network, "cpu", 1, precision="float")
    assert in_float.card.measured == {"frames": 7, "sigma_calibration": {"factor": 1.0}}
    assert in_float.card.effort == "5 pictures; 1 hour"
    assert np.array_equal(in_float.infer(frame.image_bgr, frame.camera).depth_m, before)
    second = DepthModel.load(network, "cpu", 1, precision="int8").card
    assert second.measured == {**in_float.card.measured, "int8_against_float": {"none": 2}}
    assert second.effort == "5 pictures; 1 hour"


def test_what_is_not_given_stays(network: Path) -> None:
    before = DepthModel.load(network, "cpu", 1).card
    assert update_card(network, effort="more") == (network, int8_beside(network))
    assert DepthModel.load(network, "cpu", 1).card == before.model_copy(update={"effort": "more"})


def test_an_8_bit_file_of_another_network_is_not_adopted(network: Path) -> None:
    update_card(network, effort="more")
    int8_beside(network).rename(network.with_name("kept"))
    update_card(network, effort="most")
    network.with_name("kept").rename(int8_beside(network))
    files = [path.read_bytes() for path in (network, int8_beside(network))]
    with pytest.raises(ExportError, match=r"was made from another file than .* quantize it anew"):
        update_card(network, effort="too much")
    assert [path.read_bytes() for path in (network, int8_beside(network))] == files
    with pytest.raises(ModelFileError):
        DepthModel.load(network, "cpu", 1, precision="int8")


def test_an_8_bit_file_alone_is_not_updated(network: Path) -> None:
    before = int8_beside(network).read_bytes()
    with pytest.raises(ExportError, match="is an 8-bit file: name the network"):
        update_card(int8_beside(network), effort="more")
    assert int8_beside(network).read_bytes() == before


def test_a_file_without_a_card_is_refused(network: Path) -> None:
    graph = onnx.load(str(network))
    onnx.helper.set_model_props(graph, {})
    onnx.save(graph, str(network))
    with pytest.raises(ExportError, match=r"net\.onnx has no card inside"):
        update_card(network, effort="none")


@pytest.mark.parametrize("text", [None, "{", "{}", "[]"])
def test_errors_that_were_not_measured_are_refused(network: Path, tmp_path: Path, text: str | None) -> None:
    result = tmp_path / "result.json"
    if text is not None:
        result.write_text(text)
    before = network.read_bytes()
    with pytest.raises(EvaluationError, match=r"result\.json"):
        card_command(str(network), result)
    assert network.read_bytes() == before


def test_nothing_to_write_is_refused(network: Path) -> None:
    with pytest.raises(ExportError, match="nothing to write"):
        card_command(str(network))
