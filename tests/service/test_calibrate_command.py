"""`uavdepth calibrate`: from a folder or a video to a [camera] section that the settings read."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import typer
from numpy.typing import NDArray
from typer.testing import CliRunner, Result

sys.path.insert(0, str(Path(__file__).parents[1] / "uavdepth"))

from board_pictures import board_picture, board_pose, varied_pictures

from service.calibrate_command import calibrate
from service.calibration_pictures import read_pictures
from service.clock import ManualClock
from service.errors import ConfigError
from service.settings.load import load_settings
from uavdepth.calibration.board import parse_board
from uavdepth.camera import CameraModel
from uavdepth.errors import CalibrationError

BOARD = "charuco:9x7:30mm:22mm"
TRUE = CameraModel(320, 240, 250.0, 251.0, 161.0, 118.0, (-0.1, 0.02, 0.0, 0.0, 0.0))
app = typer.Typer()
app.command()(calibrate)


@pytest.fixture(scope="module")
def pictures() -> list[NDArray[np.uint8]]:
    return varied_pictures(parse_board(BOARD), TRUE, 12)


@pytest.fixture
def folder(pictures: list[NDArray[np.uint8]], tmp_path: Path) -> Path:
    made = tmp_path / "board"
    made.mkdir()
    for number, picture in enumerate(pictures):
        cv2.imwrite(str(made / f"{number}.png"), picture)
    return made


def run(*words: str | Path, board: str = BOARD) -> Result:
    return CliRunner().invoke(app, ["--board", board, *map(str, words)])


def test_a_folder_becomes_a_section_that_the_settings_read(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "camera.toml"
    result = run(folder, "--output", file)
    assert result.exit_code == 0, result.output
    camera = load_settings(file).camera
    assert camera.source == "0"
    assert (camera.width, camera.height) == (320, 240)
    assert camera.model.fx == pytest.approx(TRUE.fx, rel=0.01)
    assert camera.model.cy == pytest.approx(TRUE.cy, abs=3)
    assert len(camera.distortion) == 5
    assert "Re-projection error" in file.read_text()


def test_without_a_file_the_section_alone_goes_to_standard_output(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "camera.toml"
    file.write_text(run(folder, "--distortion", "none", "--force").stdout)
    assert load_settings(file).camera.distortion == ()


def test_blurred_empty_and_broken_pictures_are_named(folder: Path) -> None:
    sharp = cv2.imread(str(folder / "4.png"))
    cv2.imwrite(str(folder / "soft.png"), cv2.GaussianBlur(sharp, (0, 0), 2.2))
    cv2.imwrite(str(folder / "empty.png"), np.full_like(sharp, 90))
    (folder / "broken.png").write_bytes(b"no picture")
    result = run(folder)
    assert result.exit_code == 0, result.output
    lines = result.stderr.splitlines()
    assert any("empty.png" in line and "no board found" in line for line in lines)
    assert any("broken.png" in line and "not a picture that can be read" in line for line in lines)
    assert any("soft.png" in line and "blurred" in line for line in lines)


def test_json_holds_camera_errors_coverage_and_refusals(folder: Path) -> None:
    result = run(folder, "--json", "--max-pictures", 8, "--force")
    answer = json.loads(result.stdout)
    assert answer["camera"]["width"] == 320
    assert len(answer["pictures"]) <= 8
    assert (
        answer["not_needed"] + len(answer["pictures"]) + len(answer["refused"]) + len(answer["left_out"])
        == 12
    )
    assert set(answer["sigma"]) == {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"}
    assert answer["error_px"] < 0.5
    assert len(answer["coverage"]["counts"]) == 6


def test_the_coverage_picture_is_written(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "coverage.png"
    assert run(folder, "--picture", file).exit_code == 0
    assert cv2.imread(str(file)).shape[1] == 1200


def test_files_are_never_overwritten_without_force(folder: Path, tmp_path: Path) -> None:
    file = tmp_path / "camera.toml"
    file.write_text("mine")
    result = run(folder, "--output", file)
    assert isinstance(result.exception, ConfigError)
    assert "exists already: --force" in str(result.exception)
    assert file.read_text() == "mine"
    assert run(folder, "--output", file, "--force").exit_code == 0
    assert "[camera]" in file.read_text()


def test_a_video_is_read_every_so_many_pictures(pictures: list[NDArray[np.uint8]], tmp_path: Path) -> None:
    file = tmp_path / "board.avi"
    writer = cv2.VideoWriter(str(file), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"FFV1"), 30, (320, 240))
    for picture in pictures:
        for _ in range(2):
            writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()
    read = list(read_pictures(str(file), 2, None, ManualClock(), 1.0))
    assert [each.name for each in read] == [f"picture {2 * number}" for number in range(12)]
    result = run(file, "--every", "2", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["camera"]["fx"] == pytest.approx(TRUE.fx, rel=0.01)


def test_pictures_of_different_sizes_are_refused_by_name(folder: Path) -> None:
    cv2.imwrite(str(folder / "0.png"), np.zeros((200, 320), np.uint8))
    result = run(folder)
    assert isinstance(result.exception, CalibrationError)
    assert "0.png has 320x200, 1.png has 320x240" in str(result.exception)


def test_a_board_of_another_size_is_an_error_that_says_what_is_there(folder: Path) -> None:
    result = run(folder, board="charuco:7x5:30mm:22mm")
    assert isinstance(result.exception, CalibrationError)
    assert "0 of 12 pictures" in str(result.exception)
    assert "markers 0 to 16" in str(result.exception)


def test_too_few_pictures_are_an_error(folder: Path) -> None:
    for file in sorted(folder.iterdir())[3:]:
        file.unlink()
    result = run(folder)
    assert isinstance(result.exception, CalibrationError)
    assert "3 of 3 pictures" in str(result.exception)
    assert "at least 4" in str(result.exception)


def test_a_serious_remark_keeps_the_section_back(tmp_path: Path) -> None:
    folder = tmp_path / "flat"
    folder.mkdir()
    for number, picture in enumerate(_frontal_pictures()):
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    file = tmp_path / "camera.toml"
    result = run(folder, "--output", file)
    assert isinstance(result.exception, CalibrationError)
    assert "serious" in str(result.exception)
    assert "SERIOUS" in result.stderr
    assert not file.exists()


def _frontal_pictures() -> list[NDArray[np.uint8]]:
    board = parse_board(BOARD)
    camera = CameraModel(320, 240, 250.0, 250.0, 159.5, 119.5)
    places = [(0.4, 0.4), (0.6, 0.4), (0.5, 0.5), (0.4, 0.6), (0.6, 0.6)]
    return [board_picture(board, camera, *board_pose(board, camera, at, 0.36)) for at in places]


def test_the_board_to_print_is_written_with_its_size_in_words(tmp_path: Path) -> None:
    file = tmp_path / "board.png"
    result = run("--print-board", file, board="chessboard:9x6:25mm")
    assert result.exit_code == 0
    assert "250 x 175 mm" in result.stdout
    assert b"pHYs" in file.read_bytes()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ((), "name a folder"),
        (("nowhere",), "no such file or folder"),
        (("sim:city",), "needs no calibration"),
        (("0", "--size", "wide"), "WIDTHxHEIGHT"),
        (("--print-board", "board.jpg"), "must end in .png"),
        (("x", "--output", "no/such/folder.toml"), "no such folder"),
    ],
)
def test_a_command_that_cannot_work_says_why(words: tuple[str, ...], text: str) -> None:
    result = run(*words)
    assert isinstance(result.exception, ConfigError)
    assert text in str(result.exception)


def test_the_default_board_fits_on_a_sheet_of_a4(tmp_path: Path) -> None:
    file = tmp_path / "board.png"
    assert CliRunner().invoke(app, ["--print-board", str(file)]).exit_code == 0
    height, width = cv2.imread(str(file)).shape[:2]
    data = file.read_bytes()
    per_m = int.from_bytes(data[data.index(b"pHYs") + 4 :][:4], "big")
    assert width / per_m < 0.285
    assert height / per_m < 0.2
