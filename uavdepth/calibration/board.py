"""The printed board whose corners are looked for."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import CalibrationError

DEFAULT_DICTIONARY = "5X5_100"
_FORMS = (
    "chessboard:COLUMNSxROWS:SIDE counts inner corners, charuco:COLUMNSxROWS:SIDE:MARKER[:DICTIONARY] counts "
    "squares, for example chessboard:9x6:25mm or charuco:7x5:30mm:22mm:5X5_100"
)
_SIZE = re.compile(r"(\d+)x(\d+)")
_LENGTH = re.compile(r"(\d+(?:\.\d+)?)(mm|cm|m)")
_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_FEWEST = 3
_MOST = 40
_SIDES_M = (0.002, 2.0)


@dataclass(frozen=True)
class Board:
    """A chessboard, or a chessboard with ArUco markers in its white squares (ChArUco).

    Args:
        columns, rows: squares of the whole board.
        square_m: side of a square, metres.
        marker_m: side of a marker, metres; None makes it a plain chessboard.
        dictionary: OpenCV's name of the markers, without `DICT_`.
        legacy: ChArUco as OpenCV drew it before 4.6: with an even number of rows the first square is white.

    Raises:
        CalibrationError: a board that cannot be printed or that no detector knows.
    """

    columns: int
    rows: int
    square_m: float
    marker_m: float | None = None
    dictionary: str = DEFAULT_DICTIONARY
    legacy: bool = False

    def __post_init__(self) -> None:
        fewest = _FEWEST if self.is_charuco else _FEWEST + 1
        for name, value in (("columns", self.columns), ("rows", self.rows)):
            if not fewest <= value <= _MOST:
                raise CalibrationError(f"board: {value} {name} of squares: {fewest} to {_MOST} are possible")
        low, high = _SIDES_M
        if not low <= self.square_m <= high:
            raise CalibrationError(
                f"board: squares of {self.square_m * 1e3:g} mm: {low * 1e3:g} to {high * 1e3:g} are possible"
            )
        if self.marker_m is None:
            return
        if not 0 < self.marker_m < self.square_m:
            raise CalibrationError(
                f"board: markers of {self.marker_m * 1e3:g} mm do not fit into "
                f"squares of {self.square_m * 1e3:g} mm"
            )
        names = dictionary_names()
        if self.dictionary not in names:
            raise CalibrationError(f"board: no dictionary {self.dictionary}; known are {', '.join(names)}")
        have, need = len(_dictionary(self.dictionary).bytesList), self.columns * self.rows // 2
        if need > have:
            raise CalibrationError(
                f"board: {need} markers are needed, dictionary {self.dictionary} has {have}"
            )

    @property
    def is_charuco(self) -> bool:
        """Whether it has markers, so that a part of it is enough."""
        return self.marker_m is not None

    @property
    def inner(self) -> tuple[int, int]:
        """Columns and rows of inner corners."""
        return self.columns - 1, self.rows - 1

    @property
    def corners_m(self) -> NDArray[np.float32]:
        """(N, 3) float32 inner corners row by row, metres from the first, z = 0."""
        columns, rows = self.inner
        x, y = np.meshgrid(np.arange(columns), np.arange(rows))
        points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3) * self.square_m
        return points.astype(np.float32)

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of all squares together, metres."""
        return self.columns * self.square_m, self.rows * self.square_m

    @property
    def name(self) -> str:
        """The board in words."""
        if self.marker_m is None:
            columns, rows = self.inner
            return f"chessboard with {columns}x{rows} inner corners, squares of {self.square_m * 1e3:g} mm"
        return (
            f"ChArUco board of {self.columns}x{self.rows} squares of {self.square_m * 1e3:g} mm, "
            f"markers of {self.marker_m * 1e3:g} mm from {self.dictionary}"
        )

    def charuco(self) -> cv2.aruco.CharucoBoard:
        """OpenCV's own ChArUco board. Raises CalibrationError for a plain chessboard."""
        if self.marker_m is None:
            raise CalibrationError(f"board: a {self.name} has no markers")
        board = cv2.aruco.CharucoBoard(
            (self.columns, self.rows), self.square_m, self.marker_m, _dictionary(self.dictionary)
        )
        board.setLegacyPattern(self.legacy)
        return board

    def draw(self, square_px: int) -> NDArray[np.uint8]:
        """(rows * square_px, columns * square_px) uint8 the squares without a margin."""
        if self.marker_m is None:
            light = np.add.outer(np.arange(self.rows), np.arange(self.columns)) % 2
            return np.kron(light * 255, np.ones((square_px, square_px))).astype(np.uint8)
        # CharucoBoard.generateImage fails where a marker is no whole number of pixels (OpenCV 5.0).
        board = self.charuco()
        dictionary = board.getDictionary()
        drawn = np.zeros((self.rows * square_px, self.columns * square_px), np.uint8)
        side_px = round(self.marker_m / self.square_m * square_px)
        inset_px = (square_px - side_px) // 2
        for number, corners in zip(board.getIds(), board.getObjPoints(), strict=True):
            middle = np.mean(np.asarray(corners), axis=0) / self.square_m
            x, y = int(middle[0]) * square_px, int(middle[1]) * square_px
            drawn[y : y + square_px, x : x + square_px] = 255
            marker = dictionary.generateImageMarker(int(number), side_px)
            x, y = x + inset_px, y + inset_px
            drawn[y : y + side_px, x : x + side_px] = marker
        return drawn


def parse_board(text: str) -> Board:
    """The board that `chessboard:9x6:25mm` or `charuco:7x5:30mm:22mm[:DICTIONARY]` means.

    `charuco-legacy:...` is a ChArUco board as OpenCV drew it before 4.6.

    Raises:
        CalibrationError: text of another form, or a board that cannot be.
    """
    kind, *words = text.strip().split(":")
    if kind == "chessboard" and len(words) == 2:
        columns, rows = _size(words[0], text)
        return Board(columns + 1, rows + 1, _length(words[1], text))
    if kind in ("charuco", "charuco-legacy") and len(words) in (3, 4):
        columns, rows = _size(words[0], text)
        dictionary = words[3] if len(words) == 4 else DEFAULT_DICTIONARY
        return Board(
            columns,
            rows,
            _length(words[1], text),
            _length(words[2], text),
            dictionary.upper().removeprefix("DICT_"),
            kind == "charuco-legacy",
        )
    raise CalibrationError(f"board {text!r}: {_FORMS}")


def dictionary_names() -> tuple[str, ...]:
    """The marker dictionaries of this OpenCV, without `DICT_`."""
    names = (name.removeprefix("DICT_").upper() for name in dir(cv2.aruco) if name.startswith("DICT_"))
    return tuple(sorted(set(names)))


def _dictionary(name: str) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def _size(text: str, whole: str) -> tuple[int, int]:
    match = _SIZE.fullmatch(text)
    if match is None:
        raise CalibrationError(f"board {whole!r}: {text!r} is no size such as 9x6; {_FORMS}")
    return int(match[1]), int(match[2])


def _length(text: str, whole: str) -> float:
    match = _LENGTH.fullmatch(text)
    if match is None or not math.isfinite(float(match[1])):
        raise CalibrationError(f"board {whole!r}: {text!r} is no length such as 25mm or 2.5cm; {_FORMS}")
    return float(match[1]) * _METRES[match[2]]
