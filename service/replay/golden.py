"""Golden scans: what a replay gave when a person called it right."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from service.errors import RecordError
from service.replay.player import Replayed
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, SectorState

FORMAT = 1
_MAX_BYTES = 64 * 1024 * 1024
_CLEAR, _UNKNOWN = "c", "u"
"""In the file each element is a distance in centimetres, `c` or `u`."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Tolerances(_Part):
    """How far a replay may be from its golden scans.

    Another machine's network differs in the last digits, and a pixel at the edge of a decision falls on the
    other side of it.

    Args:
        distance_m, distance_share: an element's distance may differ by the larger of the two.
        changed_elements: share of all elements, over the flight, whose state or distance may differ more.
        changed_in_scan: elements of one scan that may.
        changed_troubles: share of scans that may be trusted in one and not in the other.
    """

    distance_m: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    distance_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.03
    changed_elements: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    changed_in_scan: Annotated[int, Field(ge=0, le=SECTOR_COUNT)] = 6
    changed_troubles: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01


class GoldenScan(_Part):
    """One scan.

    Args:
        index: the picture's running number.
        at_ms: its capture, since the first picture.
        trouble: why it was not trusted; None if it was.
        elements: as text, separated by spaces.
    """

    index: Annotated[int, Field(ge=0, lt=2**53)]
    at_ms: int
    trouble: str | None
    elements: Annotated[str, Field(max_length=8 * SECTOR_COUNT)]

    @property
    def state(self) -> NDArray[np.uint8]:
        """(72,) uint8 of `SectorState`."""
        states = {_CLEAR: SectorState.CLEAR, _UNKNOWN: SectorState.UNKNOWN}
        return np.array([states.get(word, SectorState.OBSTACLE) for word in self.elements.split()], np.uint8)

    @property
    def distance_m(self) -> NDArray[np.float64]:
        """(72,) metres, NaN where no obstacle is."""
        words = self.elements.split()
        return np.array([int(word) / 100 if word.isdigit() else np.nan for word in words])


class Golden(_Part):
    """The scans of one flight.

    Args:
        format: version of the file.
        record: name of the record.
        network: what the scans were made with, for people.
        tolerances: how far a replay may be from them.
        scans: in the order of the pictures.
    """

    format: int = FORMAT
    record: str
    network: str
    tolerances: Tolerances = Tolerances()
    scans: tuple[GoldenScan, ...]

    def to_json(self) -> str:
        """One scan a line, so that a difference of two versions can be read."""
        head = json.dumps(self.model_dump(exclude={"scans"}))
        lines = ",\n".join(json.dumps(scan.model_dump()) for scan in self.scans)
        return f'{head[:-1]}, "scans": [\n{lines}\n]}}\n'


def golden_scans(replayed: Iterable[Replayed]) -> tuple[GoldenScan, ...]:
    """What a replay gave, as golden scans."""
    scans: list[GoldenScan] = []
    first_ns: int | None = None
    for one in replayed:
        first_ns = one.note.captured_ns if first_ns is None else first_ns
        result = one.result
        scans.append(
            GoldenScan(
                index=one.note.index,
                at_ms=round((one.note.captured_ns - first_ns) / 1e6),
                trouble=None if result.trouble is None else result.trouble.value,
                elements=_elements(result.scan.state, result.scan.distance_m),
            )
        )
    return tuple(scans)


def load_golden(path: Path) -> Golden:
    """Read a golden file.

    Raises:
        RecordError: it is not there or is none of this version.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise RecordError(f"golden {path}: more than {_MAX_BYTES} bytes")
        golden = Golden.model_validate_json(path.read_bytes())
    except FileNotFoundError as error:
        raise RecordError(f"golden {path}: no such file; --update makes it") from error
    except OSError as error:
        raise RecordError(f"golden {path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        problem = error.errors()[0]
        where = ".".join(str(part) for part in problem["loc"]) or "file"
        raise RecordError(f"golden {path}: {where}: {problem['msg']}") from error
    if golden.format != FORMAT:
        raise RecordError(f"golden {path}: format {golden.format}; this version reads format {FORMAT}")
    for scan in golden.scans:
        words = scan.elements.split()
        good = len(words) == SECTOR_COUNT and all(
            word in (_CLEAR, _UNKNOWN) or (word.isascii() and word.isdigit()) for word in words
        )
        if not good:
            raise RecordError(
                f"golden {path}: scan {scan.index}: {SECTOR_COUNT} elements are needed, "
                "each centimetres, c or u"
            )
    return golden


def save_golden(path: Path, golden: Golden) -> None:
    """Write a golden file. Raises RecordError if it cannot be written."""
    try:
        path.write_text(golden.to_json(), "utf-8")
    except OSError as error:
        raise RecordError(f"golden {path}: cannot be written: {error.strerror}") from error


def _elements(state: Sequence[int] | NDArray[np.uint8], distance_m: NDArray[np.float32]) -> str:
    words = []
    for one, metres in zip(state, distance_m, strict=True):
        if one == SectorState.OBSTACLE:
            words.append(str(int(np.floor(float(metres) * 100))))
        else:
            words.append(_CLEAR if one == SectorState.CLEAR else _UNKNOWN)
    return " ".join(words)
