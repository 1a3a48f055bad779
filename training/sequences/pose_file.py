"""Pose files: one frame a line, numbers apart by spaces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError


def read_rows(path: Path, columns: int) -> NDArray[np.float64]:
    """(N, columns) numbers of a text file; empty lines are left out.

    Raises:
        TrainingDataError: unreadable, or a line with another count of numbers or one that is not finite.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrainingDataError(f"cannot read the poses {path}: {error}") from error
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            row = [float(word) for word in line.split()]
        except ValueError as error:
            raise TrainingDataError(f"{path}, line {number}: {error}") from error
        if len(row) != columns or not np.isfinite(row).all():
            raise TrainingDataError(
                f"{path}, line {number} has {len(row)} numbers: {columns} finite ones are needed"
            )
        rows.append(row)
    return np.array(rows, np.float64).reshape(-1, columns)
