"""The benchmark measures what it names; how fast anything is, no test says."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

pytest.importorskip("embreex", reason="the benchmark's pictures need the extra sim")
from service.benchmark.stages import measure_stages


def test_every_step_is_measured() -> None:
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, 255, (320, 640, 3), dtype=np.uint8) for _ in range(5)]
    times = measure_stages("default", pictures)
    assert all(value > 0 for value in dataclasses.astuple(times))
