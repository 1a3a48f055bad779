"""What came out of one run, as it is committed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from training.errors import EvaluationError
from training.metrics import DepthMetrics


@dataclass(frozen=True)
class ComparisonResult:
    """Errors of one network on the test sets.

    Args:
        network: its name.
        parameters: of the depth network.
        multiply_adds: of one picture at the run's size.
        settings: of the run, without places of files.
        images: pictures shown.
        trained_minutes: time the training took; other work may have run beside it.
        machine, date: of the measurement.
        scenes: by test scene, the report of `evaluate_disparity_network` as plain values.
    """

    network: str
    parameters: int
    multiply_adds: int
    settings: dict[str, Any]
    images: int
    trained_minutes: float
    machine: str
    date: str
    scenes: dict[str, Any]

    def metrics(self, scene: str) -> DepthMetrics:
        """Median-scaled errors on a scene's test pictures, each picture counting alike."""
        return DepthMetrics(**self.scenes[scene]["median_scaled"])

    def constant(self, scene: str) -> DepthMetrics:
        """Errors of one depth everywhere, the truth's median: what costs nothing."""
        return DepthMetrics(**self.scenes[scene]["constant_depth_median_scaled"])

    def write(self, folder: Path) -> Path:
        """Write `folder`/`network`.json. Raises EvaluationError."""
        path = folder / f"{self.network}.json"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise EvaluationError(f"cannot write the result {path}: {error.strerror}") from error
        return path

    @classmethod
    def read(cls, path: Path) -> ComparisonResult:
        """Read a result. Raises EvaluationError: it is missing or something else."""
        try:
            values: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
            return cls(**values)
        except FileNotFoundError as error:
            raise EvaluationError(
                f"no result at {path}: `uavdepth compare run {path.stem}` makes it"
            ) from error
        except (OSError, ValueError, TypeError) as error:
            raise EvaluationError(f"{path} is not a result of the comparison: {error}") from error
