"""Property tests here have no deadline: how long an example takes says nothing about the world."""

from __future__ import annotations

from pathlib import Path

import pytest
from frames import make_store
from hypothesis import settings

from training.data.batches import FramePool

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture
def pool(tmp_path: Path) -> FramePool:
    """Frames of painted ground, stored under `frames`."""
    return FramePool(make_store(tmp_path / "frames"))
