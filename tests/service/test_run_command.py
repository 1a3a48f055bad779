"""`uavdepth run` as a user meets it: what it refuses in which words, and how it ends."""

from __future__ import annotations

import json
import signal
import socket
from pathlib import Path

import pytest
from command_line import LIMIT_S, started, uavdepth
from program_files import CARD, write_config, write_network, write_pictures

from uavdepth.model.card import CARD_METADATA_KEY


def test_run_without_anything_says_what_it_needs() -> None:
    done = uavdepth("run")
    assert done.returncode == 2
    assert "[camera] source: is missing" in done.stderr


def test_run_refuses_a_missing_file() -> None:
    done = uavdepth("run", "--config", "nothing.toml")
    assert done.returncode == 2
    assert "nothing.toml: no such file" in done.stderr


def test_run_refuses_a_wrong_override() -> None:
    done = uavdepth("run", "--camera", "sim:city", "--set", "camera.fps=fast")
    assert done.returncode == 2
    assert "[camera] fps: 'fast' is not a number" in done.stderr


def test_run_refuses_a_wrong_autopilot() -> None:
    done = uavdepth("run", "--camera", "sim:city", "--autopilot", "carrier-pigeon")
    assert done.returncode == 2
    assert "[autopilot] endpoint" in done.stderr
    assert "carrier-pigeon" in done.stderr


def test_run_refuses_a_camera_that_does_not_exist(tmp_path: Path) -> None:
    done = uavdepth("run", "--config", str(write_config(tmp_path, tmp_path / "flight.mp4")))
    assert done.returncode == 2
    assert "[camera] source:" in done.stderr
    assert "flight.mp4: no such file" in done.stderr


def test_run_refuses_a_network_that_is_missing_broken_or_without_card(tmp_path: Path) -> None:
    pictures = write_pictures(tmp_path / "pictures")
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a network")
    cases = [
        (tmp_path / "missing.onnx", "missing.onnx"),
        (broken, "broken.onnx"),
        (write_network(tmp_path / "cardless.onnx", None), CARD_METADATA_KEY),
        (
            write_network(tmp_path / "keyless.onnx", {k: v for k, v in CARD.items() if k != "licence"}),
            "licence",
        ),
    ]
    for model, words in cases:
        done = uavdepth("run", "--config", str(write_config(tmp_path, pictures, model)))
        assert done.returncode == 2, done.stderr
        assert "[model] path:" in done.stderr
        assert words in done.stderr


def test_run_refuses_pictures_of_another_size(tmp_path: Path) -> None:
    pictures = write_pictures(tmp_path / "pictures", size=(48, 64))
    done = uavdepth("run", "--config", str(write_config(tmp_path, pictures)))
    assert done.returncode == 2
    assert "delivers 64x48, the configuration says 160x96" in done.stderr


def test_run_names_a_port_in_use(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        config = write_config(tmp_path, write_pictures(tmp_path / "pictures"))
        done = uavdepth("run", "--config", str(config), "--autopilot", f"udp:127.0.0.1:{port}")
    assert done.returncode == 1
    assert f"127.0.0.1:{port}" in done.stderr
    assert "in use" in done.stderr


def test_run_ends_with_its_pictures(tmp_path: Path) -> None:
    done = uavdepth("run", "--config", str(write_config(tmp_path, write_pictures(tmp_path / "pictures"))))
    assert done.returncode == 0
    assert "The pictures are over" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_run_ends_cleanly_when_told_to(tmp_path: Path, number: signal.Signals) -> None:
    """An autopilot that never speaks and a camera that is not there are waited for, not feared."""
    config = write_config(tmp_path, "/dev/video63", more="[log]\nformat = 'json'\n")
    with started("run", "--config", str(config)) as process:
        assert process.stderr is not None
        lines = (json.loads(line) for line in process.stderr)
        lost = next(line for line in lines if line["event"].startswith("camera lost"))
        assert "camera /dev/video63: no such device" in lost["reason"]
        process.send_signal(number)
        _, rest = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0
    assert "Traceback" not in rest
