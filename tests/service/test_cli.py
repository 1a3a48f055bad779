"""The command line as a user meets it: one clear message, the right exit code, never a traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from command_line import PROGRAM, uavdepth
from program_files import SIZE

from service import cli
from service.cli import COMMANDS, Command


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
    done = subprocess.run([*PROGRAM, "--version"], capture_output=True, text=True, check=True)
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
