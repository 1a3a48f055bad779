"""Calibration of sigma: one factor that makes it as large as the errors on worlds kept for choices."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from frames import ground_frame, make_store
from knowing_network import KnowingNetwork

from training.doubt_calibration import calibrate_doubt
from training.errors import EvaluationError
from training.evaluation_frames import EvaluationPlan


class ErringNetwork(KnowingNetwork):
    """Errs by a normal distribution of one width, and says a sigma of another."""

    def __init__(self, error: float, said: float) -> None:
        super().__init__(ground_frame(1.5).depth_m, hints=("ground", "points"), sigma=said)
        self._truths = [ground_frame(height).depth_m for height in (1.5, 3.0, 6.0)]
        self._rng = np.random.default_rng(0)
        self._width = error
        self._calls = 0

    def infer(self, *arguments: Any, **named: Any) -> Any:
        # Three frames a world, each asked about with none, ground, and ground and points.
        self._depth_m = self._truths[self._calls // 3 % 3] * np.exp(
            self._rng.normal(0.0, self._width, self._depth_m.shape)
        ).astype(np.float32)
        self._calls += 1
        return super().infer(*arguments, **named)


def plan(store: Path, seeds: tuple[int, ...] = (900,)) -> EvaluationPlan:
    return EvaluationPlan(("city",), seeds, 3, store)


@pytest.mark.parametrize("said", [0.05, 0.1, 0.4])
def test_the_factor_makes_of_what_is_said_what_the_errors_are(tmp_path: Path, said: float) -> None:
    store = make_store(tmp_path, (("city", 900),))
    found = calibrate_doubt(cast(Any, ErringNetwork(0.1, said)), plan(store))
    assert found.factor == pytest.approx(0.1 / said, rel=0.05)
    assert found.frames == 3
    assert set(found.coverage) == {"none", "ground", "ground+100 points"}
    covers_more = all(share > 0.683 for share in found.coverage.values())
    if said != 0.1:
        assert covers_more == (said > 0.1)


def test_worlds_that_are_kept_for_tests_are_refused(tmp_path: Path) -> None:
    store = make_store(tmp_path, (("city", 1000),))
    with pytest.raises(EvaluationError, match="1000 is for tests"):
        calibrate_doubt(cast(Any, ErringNetwork(0.1, 0.1)), plan(store, (1000,)))
