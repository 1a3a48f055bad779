"""`uavdepth calibrate`: from pictures of a printed board to the `[camera]` section of the configuration."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Annotated

import cv2
import typer

from service.calibration_pictures import NamedPicture, is_live, read_pictures
from service.calibration_report import as_json, camera_section, reasons, words
from service.clock import MonotonicClock
from service.errors import ConfigError
from uavdepth.calibration.advice import advise
from uavdepth.calibration.board import Board, parse_board
from uavdepth.calibration.coverage import cover
from uavdepth.calibration.detection import BoardDetector, Refusal, View, other_board
from uavdepth.calibration.picture import draw_coverage
from uavdepth.calibration.print_board import board_png, size_words
from uavdepth.calibration.selection import choose_views
from uavdepth.calibration.solve import FEWEST_VIEWS, Distortion, solve
from uavdepth.errors import CalibrationError

_EVERY_OF_STREAMS = 10
_PICTURES_ASKED = 3
"""Where no picture shows the board, so many are asked what they show instead."""

_SIZE = re.compile(r"(\d{2,5})x(\d{2,5})")


def calibrate(
    source: Annotated[
        str | None,
        typer.Argument(help="Folder of pictures, video file, camera number, /dev/videoN or rtsp://..."),
    ] = None,
    board: Annotated[
        str,
        typer.Option(
            help="chessboard:9x6:25mm (inner corners, side) or charuco:7x5:30mm:22mm:5X5_100 "
            "(squares, side, marker, dictionary)."
        ),
    ] = "charuco:9x7:22mm:16mm",
    distortion: Annotated[
        Distortion, typer.Option(help="Lens model; rational8 for very wide lenses.")
    ] = Distortion.BROWN5,
    every: Annotated[
        int | None,
        typer.Option(min=1, help="Take each so many-th picture; 1 for folders, else 10.", show_default=False),
    ] = None,
    max_pictures: Annotated[
        int, typer.Option(min=FEWEST_VIEWS, max=200, help="Use so many at most, the most different ones.")
    ] = 40,
    size: Annotated[
        str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Picture size to ask of a live camera.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(min=1.0, max=3600.0, help="How long to listen to a live camera.")
    ] = 60.0,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Write the camera section there, not to the terminal."),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Write the coverage picture there (.png or .jpg).")
    ] = None,
    print_board: Annotated[
        Path | None, typer.Option(help="Write the board there as a PNG to print, and end.")
    ] = None,
    force: Annotated[
        bool,
        typer.Option("--force", help="Overwrite files, and give the section in spite of serious remarks."),
    ] = False,
    as_json_text: Annotated[
        bool, typer.Option("--json", help="Print everything as JSON in place of words.")
    ] = False,
) -> None:
    """Calibrate a camera from pictures of a printed board.

    Exit code 1 if it failed or a serious remark forbids to fly with the result.
    """
    wanted = parse_board(board)
    for file in (output, picture, print_board):
        _check_free(file, force)
    if print_board is not None:
        _print_board(wanted, print_board)
        return
    if source is None:
        raise ConfigError(
            "calibrate: name a folder of pictures, a video or a camera, or give --print-board FILE"
        )
    views, refused, picture_size = _look(source, wanted, every, _parse_size(size), seconds, max_pictures)
    chosen = choose_views(views, picture_size, wanted, max_pictures)
    calibration = solve(chosen, picture_size, wanted, distortion)
    coverage = cover(calibration)
    remarks = advise(calibration, coverage, refused)
    unused = len(views) - len(chosen)
    if picture is not None:
        _write_picture(picture, draw_coverage(calibration, coverage))
    if as_json_text:
        typer.echo(as_json(calibration, coverage, refused, unused, remarks))
    else:
        for line in words(calibration, coverage, refused, unused, remarks):
            typer.echo(line, err=True)
    section = camera_section(calibration, source if is_live(source) else None, wanted)
    if any(remark.serious for remark in remarks) and not force:
        raise CalibrationError("the result is not given because of the serious remarks; --force gives it")
    if output is not None:
        output.write_text(section, encoding="utf-8")
        typer.echo(f"{output}: written", err=True)
    elif not as_json_text:
        typer.echo(section, nl=False)


def _look(
    source: str,
    board: Board,
    every: int | None,
    size: tuple[int, int] | None,
    seconds: float,
    max_pictures: int,
) -> tuple[list[View], list[Refusal], tuple[int, int]]:
    """The boards in all pictures, what was refused, and the size of the pictures."""
    detector = BoardDetector(board)
    step = every or (1 if Path(source).expanduser().is_dir() else _EVERY_OF_STREAMS)
    views: list[View] = []
    refused: list[Refusal] = []
    unseen: list[NamedPicture] = []
    seen_size = (0, 0)
    pictures = read_pictures(source, step, size, MonotonicClock(), seconds)
    try:
        for taken in pictures:
            if taken.image_bgr is None:
                refused.append(Refusal(taken.name, "not a picture that can be read"))
                continue
            seen_size = (taken.image_bgr.shape[1], taken.image_bgr.shape[0])
            found = detector.detect(taken.image_bgr, taken.name)
            if isinstance(found, View):
                views.append(found)
            else:
                refused.append(found)
                if len(unseen) < _PICTURES_ASKED:
                    unseen.append(taken)
            if is_live(source):
                typer.echo(f"{taken.name}: {_answer(found)}; {len(views)} with a board", err=True)
    except KeyboardInterrupt:
        # Ctrl-C ends looking at a live camera, not the work; before there is enough to solve it ends all.
        if not is_live(source) or len(views) < FEWEST_VIEWS:
            raise
    if len(views) < FEWEST_VIEWS:
        raise CalibrationError(_too_few(board, views, refused, unseen))
    return views, refused, seen_size


def _answer(found: View | Refusal) -> str:
    return "seen" if isinstance(found, View) else found.reason


def _too_few(board: Board, views: list[View], refused: list[Refusal], unseen: list[NamedPicture]) -> str:
    total = len(views) + len(refused)
    text = (
        f"{len(views)} of {total} pictures show a usable {board.name}, "
        f"at least {FEWEST_VIEWS} are needed and 20 are good"
    )
    shown = (other_board(board, taken.image_bgr) for taken in unseen if taken.image_bgr is not None)
    instead = Counter(each for each in shown if each is not None).most_common(1)
    if instead:
        text += f"; seen instead: {instead[0][0]}"
        if not board.is_charuco:
            text += " (--board chessboard counts inner corners, one less than squares)"
    return "\n".join([text, *(f"  {line}" for line in reasons(refused))])


def _parse_size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    match = _SIZE.fullmatch(text)
    if match is None:
        raise ConfigError(f"--size {text!r}: WIDTHxHEIGHT is needed, for example 1280x720")
    return int(match[1]), int(match[2])


def _check_free(file: Path | None, force: bool) -> None:
    if file is None:
        return
    if file.exists() and not force:
        raise ConfigError(f"{file} exists already: --force overwrites it")
    if not file.absolute().parent.is_dir():
        raise ConfigError(f"{file}: no such folder")


def _print_board(board: Board, file: Path) -> None:
    if file.suffix.lower() != ".png":
        raise ConfigError(f"--print-board {file}: the file must end in .png, which carries the true size")
    file.write_bytes(board_png(board))
    for line in size_words(board):
        typer.echo(line)
    typer.echo(f"{file}: written. Measure the print and give --board the measured side.")


def _write_picture(file: Path, drawing: cv2.typing.MatLike) -> None:
    try:
        written = cv2.imwrite(str(file), drawing)
    except cv2.error as error:
        raise ConfigError(f"--picture {file}: .png or .jpg is needed: {error.err}") from error
    if not written:
        raise ConfigError(f"--picture {file}: cannot be written")
