"""Networks of other people fly with a card beside them, in whatever form they come."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from onnx import TensorProto
from onnx_files import HEIGHT, WIDTH, card_values, write_formatted_network, write_red_network, write_toml_card

from uavdepth import CameraModel, DepthMap, DepthModel, ModelCard, ModelCardError, ModelFileError
from uavdepth.model.card import OutputKind

CAMERA = CameraModel.from_fov(96, 64, 90)
DEPTH_ANYTHING = Path(__file__).parents[1] / "data" / "depth_anything_tiny.onnx"


def foreign_card(**changes: Any) -> dict[str, Any]:
    """What a user must say at least; a change to None takes the key away."""
    values: dict[str, Any] = {
        "card_version": 2,
        "name": "foreign",
        "input_width": WIDTH,
        "input_height": HEIGHT,
        "mean": [0, 0, 0],
        "std": [1, 1, 1],
        "output": "relative_inverse_depth",
        "input_name": "x",
        "output_name": "y",
    }
    values.update(changes)
    return {key: value for key, value in values.items() if value is not None}


def coloured(blue: int, green: int, red: int, camera: CameraModel = CAMERA) -> np.ndarray:
    return np.full((camera.height, camera.width, 3), (blue, green, red), np.uint8)


def load(path: Path, **changes: Any) -> DepthModel:
    write_toml_card(Path(f"{path}.toml"), foreign_card(**changes))
    return DepthModel.load(path, provider="cpu", threads=1)


class TestForms:
    @pytest.mark.parametrize(
        ("order", "expected"), [("rgb", 255 / 51), ("bgr", 255 / 102)], ids=["red first", "blue first"]
    )
    @pytest.mark.parametrize("layout", ["nchw", "nhwc"])
    def test_channels_come_in_the_order_and_layout_of_the_card(self, tmp_path, layout, order, expected):
        path = write_formatted_network(tmp_path / "n.onnx", layout=layout)
        model = load(path, layout=layout, channel_order=order)
        np.testing.assert_allclose(model.infer(coloured(102, 0, 51), CAMERA).depth_m, expected, rtol=1e-5)

    def test_mean_and_std_are_given_red_first_whatever_the_order(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        model = load(path, channel_order="bgr", mean=[0.9, 0.9, 0.2], std=[9, 9, 0.5])
        np.testing.assert_allclose(model.infer(coloured(102, 0, 0), CAMERA).depth_m, 2.5, rtol=1e-4)

    @pytest.mark.parametrize(
        "shape", [(1, 1, HEIGHT, WIDTH), (1, HEIGHT, WIDTH), (HEIGHT, WIDTH), (1, HEIGHT, WIDTH, 1)]
    )
    def test_the_output_may_have_any_axes_of_one(self, tmp_path, shape):
        path = write_formatted_network(tmp_path / "n.onnx", output_shape=shape)
        picture = coloured(0, 0, 51)
        picture[:32, :, 2] = 102
        depth = load(path).infer(picture, CAMERA).depth_m
        assert depth.shape == (64, 96)
        assert depth[60, 5] / depth[4, 5] == pytest.approx(2.0, rel=1e-4)

    def test_an_output_without_rows_and_columns_is_refused(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx", output_shape=(2, HEIGHT // 2, WIDTH))
        with pytest.raises(ModelCardError, match=r"output 'y' is \[2, 16, 48\]"):
            load(path)

    def test_half_precision_inputs_and_outputs(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx", element=TensorProto.FLOAT16)
        depth = load(path).infer(coloured(0, 0, 51), CAMERA).depth_m
        assert depth.dtype == np.float32
        np.testing.assert_allclose(depth, 5.0, rtol=2e-3)

    def test_a_card_given_by_its_path_wins_over_every_other(self, tmp_path):
        path = write_red_network(tmp_path / "n.onnx", card_values(name="inside"))
        write_toml_card(Path(f"{path}.toml"), card_values(name="beside"))
        given = write_toml_card(tmp_path / "given.toml", card_values(name="given"))
        assert DepthModel.load(path, provider="cpu", card=given).card.name == "given"

    def test_a_card_that_is_not_there_is_named(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        with pytest.raises(ModelCardError, match=r"gone\.toml: .*No such file"):
            DepthModel.load(path, provider="cpu", card=tmp_path / "gone.toml")

    @pytest.mark.parametrize("text", [b"name = ", b"\xff", b"[a\n"])
    def test_a_card_that_is_no_toml_is_refused_with_its_file(self, tmp_path, text):
        path = write_formatted_network(tmp_path / "n.onnx")
        Path(f"{path}.toml").write_bytes(text)
        with pytest.raises(ModelCardError, match=r"n\.onnx\.toml: the model card cannot be read"):
            DepthModel.load(path, provider="cpu")


class TestKinds:
    def test_relative_inverse_depth_is_depth_up_to_a_factor(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        picture = coloured(0, 0, 200)
        picture[:, :48, 2] = 100
        model = load(path)
        depth = model.infer(picture, CAMERA).depth_m
        assert not model.card.metric
        assert depth[0, 0] / depth[0, -1] == pytest.approx(2.0, rel=1e-4)
        assert np.isfinite(depth).all()

    def test_relative_inverse_depth_of_nothing_is_far_and_not_unknown(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        picture = coloured(0, 0, 255)
        picture[:, :48, 2] = 0
        depth = load(path).infer(picture, CAMERA).depth_m
        assert np.isfinite(depth).all()
        assert depth[0, 0] / depth[0, -1] == pytest.approx(1e4, rel=1e-3)

    def test_a_picture_without_any_relative_depth_is_unknown(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        assert np.isnan(load(path).infer(coloured(0, 0, 0), CAMERA).depth_m).all()

    def test_metric_depth_that_knows_no_focal_length_is_taken_as_it_is(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        model = load(path, output="depth", metric=True, max_depth_m=80.0, std=[0.1] * 3)
        for fov_deg in (60, 100):
            camera = CameraModel.from_fov(96, 64, fov_deg)
            depth = model.infer(coloured(0, 0, 51, camera), camera).depth_m
            np.testing.assert_allclose(depth, 2.0, rtol=1e-4)

    def test_affine_inverse_depth_is_no_depth_before_a_fit(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        picture = coloured(0, 0, 51)
        picture[:, :48, 2] = 255
        answer = load(path, output="affine_inverse_depth").infer(picture, CAMERA)
        assert np.isnan(answer.depth_m).all()
        assert answer.affine_inverse_depth is not None
        np.testing.assert_allclose(answer.affine_inverse_depth[:, [0, -1]], [[1.0, 0.2]] * 64, rtol=1e-5)
        # 1/5 and 1/25 of a metre: scale 0.2, shift 0.
        fitted = answer.fitted(0.2, 0.0)
        np.testing.assert_allclose(fitted.depth_m[:, [0, -1]], [[5.0, 25.0]] * 64, rtol=1e-5)
        # What a fit puts beyond infinity is not known to be free.
        assert np.isnan(answer.fitted(0.2, -0.1).depth_m[0, -1])

    @pytest.mark.parametrize("fit", [(0.0, 1.0), (-1.0, 1.0), (np.nan, 0.0), (1.0, np.inf)])
    def test_a_fit_that_cannot_be_is_refused(self, fit):
        affine = DepthMap.from_affine(np.ones((2, 2), np.float32))
        with pytest.raises(ValueError, match="scale above 0"):
            affine.fitted(*fit)

    def test_depth_that_is_depth_already_is_not_fitted(self):
        with pytest.raises(ValueError, match="needs no fit"):
            DepthMap(np.ones((2, 2), np.float32)).fitted(1.0, 0.0)

    @pytest.mark.parametrize(
        ("changes", "text"),
        [
            ({"metric": True}, "'relative_inverse_depth' has no metres"),
            ({"focal_px": 300.0}, "'focal_px' means nothing for 'relative_inverse_depth'"),
            ({"output": "depth", "max_depth_m": 80.0}, "lacks the key 'metric'"),
            ({"output": "depth", "metric": True}, "lacks the key 'max_depth_m'"),
            ({"multiple_of": 0}, "key 'multiple_of'"),
            ({"layout": "chw"}, "key 'layout'"),
            ({"std": None}, "lacks the key 'std'"),
            ({"card_version": 1}, "'output' is 'relative_inverse_depth': it needs card_version = 2"),
        ],
    )
    def test_keys_that_contradict_each_other_are_named(self, tmp_path, changes, text):
        path = write_formatted_network(tmp_path / "n.onnx")
        with pytest.raises(ModelCardError, match=rf"n\.onnx\.toml: .*{text}"):
            load(path, **changes)


class TestDepthAnything:
    """`tests/data/make_depth_anything_tiny.py` exported the file from transformers with random weights."""

    card = foreign_card(
        name="depth-anything-tiny",
        input_width=140,
        input_height=70,
        multiple_of=14,
        mean=[0.485, 0.456, 0.406],
        std=[0.229, 0.224, 0.225],
        output="affine_inverse_depth",
        input_name="pixel_values",
        output_name="predicted_depth",
    )

    def model(self, folder: Path, **changes: Any) -> DepthModel:
        card = write_toml_card(folder / "card.toml", {**self.card, **changes})
        return DepthModel.load(DEPTH_ANYTHING, provider="cpu", threads=1, card=card)

    @pytest.mark.parametrize(
        ("camera_size", "network_size"),
        [((640, 320), (140, 70)), ((640, 480), (112, 84)), ((480, 640), (84, 112)), ((1000, 100), (308, 28))],
    )
    def test_the_size_is_whole_patches_in_the_cameras_shape(self, tmp_path, camera_size, network_size):
        model = self.model(tmp_path)
        camera = CameraModel.from_fov(*camera_size, 80)
        assert model.card.input_size(camera) == network_size
        picture = np.random.default_rng(0).integers(0, 256, (*camera_size[::-1], 3), dtype=np.uint8)
        values = model.infer(picture, camera).affine_inverse_depth
        assert values is not None
        assert values.shape == camera_size[::-1]
        assert np.isfinite(values).all()
        assert values.std() > 0.1

    def test_it_computes_what_the_graph_does(self, tmp_path):
        import onnxruntime as ort

        camera = CameraModel.from_fov(140, 70, 80)
        picture = np.random.default_rng(1).integers(0, 256, (70, 140, 3), dtype=np.uint8)
        mean, std = np.array(self.card["mean"]), np.array(self.card["std"])
        normalised = ((picture[..., ::-1] / 255 - mean) / std).transpose(2, 0, 1)[None].astype(np.float32)
        session = ort.InferenceSession(str(DEPTH_ANYTHING), providers=["CPUExecutionProvider"])
        (wanted,) = session.run(None, {"pixel_values": normalised})
        answer = self.model(tmp_path).infer(picture, camera)
        np.testing.assert_allclose(answer.affine_inverse_depth, wanted[0], atol=1e-4)

    @pytest.mark.parametrize(
        ("changes", "text"),
        [
            ({"input_width": 150}, "input_width is 150, no multiple of 14"),
            ({"output_name": "depth"}, "output_name is 'depth'"),
            ({"layout": "nhwc"}, r"free: \[1, 'height', 'width', 3\], the network's is \[1, 3,"),
        ],
    )
    def test_a_wrong_card_is_refused_before_it_flies(self, tmp_path, changes, text):
        with pytest.raises(ModelCardError, match=text):
            self.model(tmp_path, **changes)

    def test_a_network_of_one_size_is_not_free(self, tmp_path):
        path = write_formatted_network(tmp_path / "n.onnx")
        with pytest.raises(ModelCardError, match="multiple_of says that the size is free"):
            load(path, multiple_of=16)


def test_an_output_that_turns_out_to_be_no_picture_is_an_error_with_the_file(tmp_path: Path) -> None:
    path = write_formatted_network(tmp_path / "n.onnx")
    model = load(path)
    model._session = type("Odd", (), {"run": lambda *_: [np.zeros((1, 3, 4, 5), np.float32)]})()
    with pytest.raises(ModelFileError, match=r"n\.onnx: the network's output is \(1, 3, 4, 5\)"):
        model.infer(coloured(0, 0, 0), CAMERA)


def test_a_free_size_keeps_the_cameras_shape_and_the_cards_area() -> None:
    values = foreign_card(multiple_of=14, input_width=518, input_height=518)
    card = ModelCard.from_json(json.dumps(values), "card")
    width, height = card.input_size(CameraModel.from_fov(1920, 1080, 80))
    assert width % 14 == height % 14 == 0
    assert width / height == pytest.approx(1920 / 1080, rel=0.05)
    assert width * height == pytest.approx(518 * 518, rel=0.05)


DOCUMENT = Path(__file__).parents[2] / "docs" / "foreign-networks.md"
EXAMPLES = re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("text", EXAMPLES)
def test_the_cards_in_the_documentation_can_be_read(text: str) -> None:
    assert ModelCard.from_toml(text.encode(), str(DOCUMENT)).card_version == 2


def test_the_documentation_has_cards_and_names_every_output() -> None:
    assert len(EXAMPLES) == 2
    text = DOCUMENT.read_text(encoding="utf-8")
    for kind in get_args(OutputKind):
        assert f"`{kind}`" in text
