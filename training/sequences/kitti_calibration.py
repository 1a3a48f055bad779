"""KITTI's calibration files: one matrix a line, `name: numbers`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from uavdepth.camera import CameraModel
from uavdepth.errors import CameraModelError

PIXEL_FROM_KITTI = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
"""KITTI's calibration counts pixels from 1 (its MATLAB development kit draws and reads them so, and every
published evaluation against its LiDAR takes the 1 off); here the centre of the first pixel is 0."""


def read_matrices(path: Path) -> dict[str, NDArray[np.float64]]:
    """Every line of numbers by its name; lines that hold text, such as the date, are left out.

    A line without a name is called P0, P1, ... by its order, as in copies of the odometry set that dropped
    the names.

    Raises:
        TrainingDataError: missing or unreadable.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrainingDataError(f"cannot read the calibration {path}: {error}") from error
    matrices: dict[str, NDArray[np.float64]] = {}
    for line in lines:
        name, colon, numbers = line.partition(":")
        if not colon:
            name, numbers = f"P{len(matrices)}", line
        try:
            values = np.array([float(word) for word in numbers.split()])
        except ValueError:
            continue
        if values.size:
            matrices[name.strip()] = values
    return matrices


def matrix(
    path: Path, matrices: Mapping[str, NDArray[np.float64]], name: str, rows: int, columns: int
) -> NDArray[np.float64]:
    """One matrix of a file.

    Raises:
        TrainingDataError: it is not in the file, is of another size, or holds a number that is not finite.
    """
    values = matrices.get(name)
    if values is None:
        raise TrainingDataError(f"{path} has no {name}; it has {', '.join(sorted(matrices)) or 'nothing'}")
    if values.size != rows * columns or not np.isfinite(values).all():
        raise TrainingDataError(
            f"{path}: {name} has {values.size} numbers: {rows} x {columns} finite ones are needed"
        )
    return values.reshape(rows, columns)


def projection(path: Path, matrices: Mapping[str, NDArray[np.float64]], name: str) -> NDArray[np.float64]:
    """(3, 4) projection onto pixels counted from 0. Raises TrainingDataError: as `matrix`."""
    return np.asarray(PIXEL_FROM_KITTI @ matrix(path, matrices, name, 3, 4))


def camera_from_projection(path: Path, p: NDArray[np.float64], width: int, height: int) -> CameraModel:
    """Intrinsics of a rectified camera from its (3, 4) `projection`.

    Raises:
        TrainingDataError: it is no camera's.
    """
    try:
        return CameraModel(width, height, float(p[0, 0]), float(p[1, 1]), float(p[0, 2]), float(p[1, 2]))
    except CameraModelError as error:
        raise TrainingDataError(f"{path}: {error}") from error
