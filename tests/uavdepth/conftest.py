"""The camera most tests look through, and its vehicle."""

from __future__ import annotations

import pytest
from hypothesis import settings

from uavdepth import Attitude, CameraModel, CameraMount

# The same examples every time, and no time limit: tests run on loaded machines too.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.load_profile("steady")


@pytest.fixture(scope="session")
def camera() -> CameraModel:
    return CameraModel.from_fov(640, 320, 90)


@pytest.fixture(scope="session")
def mount() -> CameraMount:
    return CameraMount()


@pytest.fixture(scope="session")
def level() -> Attitude:
    return Attitude(0.0, 0.0, 0.0)
