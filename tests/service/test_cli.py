"""The command line as a user meets it: one clear message, the right exit code, never a traceback."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper
from program_fakes import free_port

from service import cli
from service.cli import COMMANDS, Command
from uavdepth.model_card import CARD_METADATA_KEY

LIMIT_S = 60.0
SIZE = "width = 160\nheight = 96\nhorizontal_fov_deg = 80\n"
PROGRAM = [sys.executable, "-c", "from service.cli import main; main()"]


def uavdepth(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [*PROGRAM, *arguments], capture_output=True, text=True, timeout=LIMIT_S, cwd=cwd, check=False
    )
    assert "Traceback" not in done.stderr + done.stdout
    return done


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [*PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def write_network(path: Path, card: dict[str, object] | None) -> Path:
    """A network whose depth is the picture's red channel."""
    picture = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, 32, 48])
    depth = helper.make_tensor_value_info("log_inverse_depth", TensorProto.FLOAT, [1, 1, 32, 48])
    channels = helper.make_tensor("red", TensorProto.INT64, [1], [0])
    gather = helper.make_node("Gather", ["image", "red"], ["log_inverse_depth"], axis=1)
    graph = helper.make_graph([gather], "red", [picture], [depth], [channels])
    network = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    network.ir_version = 9
    if card is not None:
        helper.set_model_props(network, {CARD_METADATA_KEY: json.dumps(card)})
    onnx.save(network, str(path))
    return path


CARD: dict[str, object] = {
    "card_version": 1,
    "name": "red",
    "input_width": 48,
    "input_height": 32,
    "mean": [0.0, 0.0, 0.0],
    "std": [1.0, 1.0, 1.0],
    "output": "log_inverse_depth",
    "metric": False,
    "uncertainty": False,
    "focal_px": 40.0,
    "max_depth_m": 100.0,
    "training_data": "none",
    "licence": "Apache-2.0",
    "measured": {},
    "created": "2026-01-01T00:00:00Z",
}


def write_pictures(folder: Path, count: int = 2, size: tuple[int, int] = (96, 160)) -> Path:
    folder.mkdir()
    for number in range(count):
        assert cv2.imwrite(str(folder / f"{number}.png"), np.full((*size, 3), 90, np.uint8))
    return folder


def write_config(folder: Path, source: Path | str, model: Path | str | None = None, more: str = "") -> Path:
    if model is None:
        model = write_network(folder / "red.onnx", CARD)
    path = folder / "drone.toml"
    path.write_text(
        f"[camera]\nsource = '{source}'\n{SIZE}[model]\npath = '{model}'\n"
        f"[zenoh]\nenabled = false\n[autopilot]\nendpoint = 'udp:127.0.0.1:0'\n{more}"
    )
    return path


# -- help


def test_help_lists_every_command() -> None:
    done = uavdepth("--help")
    assert done.returncode == 0
    for name in COMMANDS:
        assert name in done.stdout


def test_help_imports_none_of_the_heavy_packages() -> None:
    code = (
        "import sys\nfrom service.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'onnxruntime', 'zenoh', 'pymavlink', 'torch', 'numba', 'pydantic'}\n"
        "print('HEAVY', sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "HEAVY []" in done.stdout


def test_the_version_is_the_packages() -> None:
    done = uavdepth("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("uavdepth ")


@pytest.mark.parametrize("arguments", [["fly"], ["run", "--nonsense"], ["config", "rfeerence"], ["config"]])
def test_a_wrong_command_line_is_exit_code_2(arguments: list[str]) -> None:
    assert uavdepth(*arguments).returncode == 2


@pytest.mark.parametrize("name", ["run", "watch", "config", "fake-autopilot"])
def test_every_command_explains_itself(name: str) -> None:
    done = uavdepth(name, "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout


def test_a_command_whose_extra_is_not_installed_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "lacking.py").write_text("import surely_not_installed\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(COMMANDS, "train", Command("lacking", "train", "Train.", "train"))
    with pytest.raises(SystemExit) as end:
        cli.main(["train"])
    assert end.value.code == 1
    words = capsys.readouterr().err
    assert "uavdepth train needs surely_not_installed: pip install 'uavdepth[train]'" in words


# -- config


def test_config_reference_and_example_are_complete_and_agree(tmp_path: Path) -> None:
    reference = uavdepth("config", "reference")
    example = uavdepth("config", "example")
    assert reference.returncode == example.returncode == 0
    for section in ("camera", "autopilot", "zenoh"):
        assert f"## [{section}]" in reference.stdout
        assert f"[{section}]" in example.stdout
    path = tmp_path / "example.toml"
    path.write_text(example.stdout)
    check = uavdepth("config", "check", str(path))
    assert check.returncode == 0
    assert "valid" in check.stdout


def test_config_check_names_file_and_key(tmp_path: Path) -> None:
    path = tmp_path / "drone.toml"
    path.write_text(f"[camera]\nsource = '0'\n{SIZE}fps = 500\nlatncy_ms = 3\n")
    done = uavdepth("config", "check", str(path))
    assert done.returncode == 2
    assert str(path) in done.stderr
    assert "[camera] fps: 500 is above 240" in done.stderr
    assert "[camera] latncy_ms: unknown key; did you mean latency_ms?" in done.stderr


# -- run, refused


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


# -- run, running


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


# -- watch


@pytest.mark.parametrize(
    ("thread", "taken_down"), [("zenoh-scan", False), ("camera", False), ("no business of ours", True)]
)
def test_an_interpreter_is_not_taken_down_under_a_thread_that_is_inside_a_library(
    thread: str, taken_down: bool
) -> None:
    program = (
        "import atexit, threading\n"
        "from service.process_end import end_process\n"
        f"threading.Thread(target=threading.Event().wait, name={thread!r}, daemon=True).start()\n"
        "atexit.register(print, 'taken down')\n"
        "print('done')\n"
        "end_process(3)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert ended.returncode == 3
    assert ended.stdout.split("\n")[0] == "done"
    assert ("taken down" in ended.stdout) is taken_down


def test_watch_once_without_a_vehicle_is_exit_code_1() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    done = uavdepth("watch", "--once", "--json", "--timeout", "0.2", "--connect", endpoint)
    assert done.returncode == 1
    assert json.loads(done.stdout) == {"vehicles": {}, "bad_samples": 0}


def test_watch_refuses_an_endpoint_that_is_none() -> None:
    done = uavdepth("watch", "--connect", "localhost")
    assert done.returncode == 2
    assert "--connect: 'localhost' is no endpoint" in done.stderr


def test_watch_sees_a_running_service_and_both_end_when_told_to(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = write_config(tmp_path, write_pictures(tmp_path / "pictures"), more="[vehicle]\nname = 'kite'\n")
    with started(
        "run",
        "--config",
        str(config),
        "--set",
        "camera.loop=true",
        "--set",
        "zenoh.enabled=true",
        "--set",
        f"zenoh.listen=['{endpoint}']",
    ) as service:
        once = uavdepth("watch", "--once", "--json", "--timeout", "30", "--connect", endpoint)
        assert once.returncode == 0, once.stderr
        kite = json.loads(once.stdout)["vehicles"]["kite"]
        assert kite["alive"]
        assert kite["scan"]["trusted"] is False
        assert kite["nearest_m"] is None
        assert kite["status"]["camera"] == "delivering"
        with started("watch", "--json", "--connect", endpoint) as watch:
            assert watch.stdout is not None
            watch.stdout.readline()
            watch.send_signal(signal.SIGINT)
            _, words = watch.communicate(timeout=LIMIT_S)
            assert watch.returncode == 0, words
        service.send_signal(signal.SIGTERM)
        service.communicate(timeout=LIMIT_S)
    assert service.returncode == 0
