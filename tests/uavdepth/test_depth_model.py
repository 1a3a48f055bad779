"""A network file in, depth at the camera's pixels out, and a clear word where that cannot be."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from onnx_files import HEIGHT, MEAN, STD, WIDTH, card_values, write_red_network, write_toml_card

from uavdepth import CameraModel, DepthModel, ImageSizeError, ModelCardError, ModelFileError

needs_openvino = pytest.mark.skipif(
    importlib.util.find_spec("onnxruntime_ep_openvino") is None,
    reason="the OpenVINO plug-in is not installed",
)


@pytest.fixture
def camera() -> CameraModel:
    return CameraModel.from_fov(96, 64, 90)


def network(folder: Path, **changes: object) -> Path:
    return write_red_network(folder / "net.onnx", card_values(**changes))


def red(value: int, width: int = 96, height: int = 64) -> np.ndarray:
    picture = np.zeros((height, width, 3), np.uint8)
    picture[..., 2] = value
    return picture


class TestInference:
    def test_log_inverse_depth_becomes_metres_by_the_cards_focal_length(self, tmp_path, camera):
        model = DepthModel.load(network(tmp_path), provider="cpu", threads=1)
        depth = model.infer(red(200), camera).depth_m
        focal_in_network = camera.fx * WIDTH / camera.width
        output = (200 / 255 - MEAN[0]) / STD[0]
        assert depth.shape == (64, 96)
        assert depth.dtype == np.float32
        np.testing.assert_allclose(depth, focal_in_network / 40.0 * math.exp(-output), rtol=1e-5)

    @pytest.mark.parametrize(
        ("kind", "metres"), [("inverse_depth", lambda out: 1 / out), ("depth", lambda out: out)]
    )
    def test_foreign_kinds_of_output(self, tmp_path, camera, kind, metres):
        path = network(tmp_path, output=kind, mean=[0.0] * 3, std=[1.0] * 3, focal_px=24.0)
        depth = DepthModel.load(path, provider="cpu", threads=1).infer(red(51), camera).depth_m
        np.testing.assert_allclose(depth, camera.fx * 0.5 / 24.0 * metres(0.2), rtol=1e-5)

    def test_a_longer_lens_makes_the_same_picture_deeper(self, tmp_path):
        model = DepthModel.load(network(tmp_path), provider="cpu", threads=1)
        wide, long = CameraModel.from_fov(96, 64, 90), CameraModel.from_fov(96, 64, 53.13010235)
        ratio = model.infer(red(99), long).depth_m / model.infer(red(99), wide).depth_m
        np.testing.assert_allclose(ratio, 2.0, rtol=1e-5)

    def test_depth_lies_where_the_picture_has_it(self, tmp_path, camera):
        model = DepthModel.load(network(tmp_path), provider="cpu", threads=1)
        picture = red(0)
        picture[10:20, 60:80, 2] = 255
        depth = model.infer(picture, camera).depth_m
        assert (depth[11:19, 61:79] < depth[0, 0]).all()
        assert (depth[21:, :] == depth[0, 0]).all()
        assert (depth[:, :59] == depth[0, 0]).all()

    def test_an_edge_stays_an_edge_when_brought_to_the_cameras_pixels(self, tmp_path):
        camera = CameraModel.from_fov(640, 320, 90)
        model = DepthModel.load(network(tmp_path), provider="cpu", threads=1)
        picture = cv2.resize(np.where(np.arange(WIDTH) < 20, 0, 255)[None].astype(np.uint8), (WIDTH, HEIGHT))
        large = cv2.resize(picture, (640, 320), interpolation=cv2.INTER_NEAREST_EXACT)
        depth = model.infer(np.dstack([0 * large, 0 * large, large]), camera).depth_m
        # One column of the network straddles the edge; nothing else lies between.
        assert len(np.unique(depth)) <= 3

    def test_smaller_logarithms_are_enlarged_between_pixels_and_metres_are_not(self, tmp_path):
        """As a network enlarges its own last map; metres half way between two things are of neither."""
        camera = CameraModel.from_fov(WIDTH, HEIGHT, 90)
        picture = red(51, WIDTH, HEIGHT)
        picture[:, 24:, 2] = 204
        depths = {}
        for kind in ("log_inverse_depth", "depth"):
            card = card_values(output=kind, mean=[0.0] * 3, std=[1.0] * 3, uncertainty=True)
            path = write_red_network(tmp_path / f"{kind}.onnx", card, uncertainty=-1.0, halved=True)
            answer = DepthModel.load(path, provider="cpu", threads=1).infer(picture, camera)
            assert answer.depth_m.shape == answer.relative_sigma.shape == (HEIGHT, WIDTH)
            np.testing.assert_allclose(answer.relative_sigma, math.exp(-1.0), rtol=1e-5)
            depths[kind] = answer.depth_m / (camera.fx / 40.0)
        expected = np.exp(-np.array([0.2, 0.2, 0.35, 0.65, 0.8, 0.8]))
        np.testing.assert_allclose(depths["log_inverse_depth"][5, 21:27], expected, rtol=1e-5)
        np.testing.assert_allclose(depths["depth"][5, 21:27], [0.2, 0.2, 0.2, 0.8, 0.8, 0.8], rtol=1e-5)

    def test_sigma_comes_out_relative(self, tmp_path, camera):
        path = write_red_network(tmp_path / "n.onnx", card_values(uncertainty=True), uncertainty=-2.0)
        result = DepthModel.load(path, provider="cpu", threads=1).infer(red(10), camera)
        np.testing.assert_allclose(result.relative_sigma, math.exp(-2.0), rtol=1e-5)
        assert result.relative_sigma.shape == (64, 96)

    def test_without_the_second_output_there_is_no_sigma(self, tmp_path, camera):
        assert DepthModel.load(network(tmp_path), provider="cpu").infer(red(1), camera).relative_sigma is None

    def test_depth_is_clipped_to_what_the_network_was_trained_for(self, tmp_path, camera):
        path = write_red_network(tmp_path / "n.onnx", card_values(max_depth_m=50.0), gain=100.0)
        depth = DepthModel.load(path, provider="cpu").infer(red(0), camera).depth_m
        assert (depth == 50.0).all()

    @pytest.mark.parametrize("halved", [False, True])
    @pytest.mark.parametrize("gain", [math.nan, math.inf, -math.inf, 1000.0])
    def test_a_prediction_off_the_scale_is_unknown(self, tmp_path, camera, gain, halved):
        path = write_red_network(tmp_path / "n.onnx", card_values(), gain=gain, halved=halved)
        assert np.isnan(DepthModel.load(path, provider="cpu").infer(red(255), camera).depth_m).all()

    @needs_openvino
    def test_openvino_gives_the_same_depth(self, tmp_path, camera):
        path = network(tmp_path)
        plain = DepthModel.load(path, provider="cpu", threads=1)
        other = DepthModel.load(path, provider="openvino", threads=1)
        assert other.provider == "openvino"
        picture = np.random.default_rng(0).integers(0, 256, (64, 96, 3), dtype=np.uint8)
        np.testing.assert_allclose(
            other.infer(picture, camera).depth_m, plain.infer(picture, camera).depth_m, rtol=0.02
        )


class TestPictures:
    @pytest.mark.parametrize(
        ("picture", "text"),
        [
            (np.zeros((48, 64, 3), np.uint8), "64x48 pixels, the camera is 96x64"),
            (np.zeros((64, 96), np.uint8), r"uint8 \(64, 96\)"),
            (np.zeros((64, 96, 4), np.uint8), r"uint8 \(64, 96, 4\)"),
            (np.zeros((64, 96, 3), np.float32), "float32"),
            (None, "NoneType"),
        ],
    )
    def test_a_picture_that_is_not_the_cameras_is_refused(self, tmp_path, camera, picture, text):
        model = DepthModel.load(network(tmp_path), provider="cpu")
        with pytest.raises(ImageSizeError, match=text):
            model.infer(picture, camera)


class TestFiles:
    def test_a_file_without_a_card_is_refused_by_the_missing_key(self, tmp_path):
        path = write_red_network(tmp_path / "bare.onnx", None)
        with pytest.raises(
            ModelCardError, match=r"bare\.onnx.*'uavdepth\.card' is missing.*bare\.onnx\.toml"
        ):
            DepthModel.load(path, provider="cpu")

    def test_a_card_that_lacks_a_key_is_refused_by_that_key(self, tmp_path):
        with pytest.raises(ModelCardError, match="lacks the key 'focal_px'"):
            DepthModel.load(network(tmp_path, focal_px=None), provider="cpu")

    def test_a_foreign_network_takes_the_card_beside_it(self, tmp_path, camera):
        path = write_red_network(tmp_path / "foreign.onnx", None)
        write_toml_card(tmp_path / "foreign.onnx.toml", card_values(name="foreign"))
        model = DepthModel.load(path, provider="cpu")
        assert model.card.name == "foreign"
        assert np.isfinite(model.infer(red(9), camera).depth_m).all()

    def test_the_networks_own_card_wins_over_the_one_beside_it(self, tmp_path):
        path = network(tmp_path, name="inside")
        write_toml_card(Path(f"{path}.toml"), card_values(name="beside"))
        assert DepthModel.load(path, provider="cpu").card.name == "inside"

    @pytest.mark.parametrize(
        ("changes", "text"),
        [
            ({"input_width": 64}, r"\[1, 3, 32, 64\], the network's is \[1, 3, 32, 48\]"),
            ({"uncertainty": True}, "uncertainty_name is 'log_sigma'"),
            ({"output_name": "depth"}, "output_name is 'depth'"),
            ({"input_name": "x"}, "input_name is 'x'"),
        ],
    )
    def test_a_card_of_another_network_is_refused(self, tmp_path, changes, text):
        with pytest.raises(ModelCardError, match=text):
            DepthModel.load(network(tmp_path, **changes), provider="cpu")

    @pytest.mark.parametrize("provider", ["cpu", "auto"])
    def test_a_missing_file_is_named(self, tmp_path, provider):
        with pytest.raises(ModelFileError, match=r"gone\.onnx: no such network file"):
            DepthModel.load(tmp_path / "gone.onnx", provider=provider)

    def test_an_unknown_name_is_told_with_the_known_ones(self):
        with pytest.raises(ModelFileError, match="no network named 'deafult'"):
            DepthModel.load("deafult")

    @pytest.mark.parametrize("content", [b"", b"not a network", b"\x08\x08" + bytes(500)])
    @pytest.mark.parametrize("provider", ["cpu", "auto"])
    def test_a_broken_file_is_refused(self, tmp_path, content, provider):
        path = tmp_path / "broken.onnx"
        path.write_bytes(content)
        with pytest.raises((ModelFileError, ModelCardError), match=r"broken\.onnx"):
            DepthModel.load(path, provider=provider)

    def test_a_cut_file_is_refused(self, tmp_path):
        path = network(tmp_path)
        path.write_bytes(path.read_bytes()[:150])
        with pytest.raises((ModelFileError, ModelCardError), match=r"net\.onnx"):
            DepthModel.load(path, provider="cpu")

    @pytest.mark.parametrize(
        ("settings", "text"),
        [({"provider": "npu"}, "provider is 'npu'"), ({"threads": 0}, "threads is 0")],
    )
    def test_impossible_settings_are_refused_by_value(self, tmp_path, settings, text):
        with pytest.raises(ModelFileError, match=text):
            DepthModel.load(network(tmp_path), **settings)
