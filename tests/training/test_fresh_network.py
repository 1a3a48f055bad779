"""A reference network with fresh weights becomes an ONNX file that computes what PyTorch does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from training.errors import TrainingSettingsError
from training.fresh_network import OUTPUT_NAME, export_fresh_network
from training.networks.catalogue import build_network


def test_the_file_gives_the_finest_disparity(tmp_path: Path) -> None:
    path = tmp_path / "monodepth2.onnx"
    export_fresh_network("monodepth2", 96, 64, path)
    picture = np.random.default_rng(0).random((1, 3, 64, 96), dtype=np.float32)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    (answer,) = session.run([OUTPUT_NAME], {"image": picture})
    torch.manual_seed(0)
    with torch.no_grad():
        wanted = build_network("monodepth2").eval()(torch.from_numpy(picture))[0]
    assert answer.shape == (1, 1, 64, 96)
    np.testing.assert_allclose(answer, wanted.numpy(), rtol=1e-3)


def test_an_unknown_network_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TrainingSettingsError, match="no network 'unet'"):
        export_fresh_network("unet", 64, 32, tmp_path / "n.onnx")
