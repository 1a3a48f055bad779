"""The camera most tests look through, and its vehicle."""

from __future__ import annotations

import pytest

from uavdepth import Attitude, CameraModel, CameraMount


@pytest.fixture(scope="session")
def camera() -> CameraModel:
    return CameraModel.from_fov(640, 320, 90)


@pytest.fixture(scope="session")
def mount() -> CameraMount:
    return CameraMount()


@pytest.fixture(scope="session")
def level() -> Attitude:
    return Attitude(0.0, 0.0, 0.0)
