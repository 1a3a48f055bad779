"""What became of one picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from service.frame import Frame
from service.scale_status import ScaleStatus
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.depth.depth_map import DepthMap
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg


@dataclass(frozen=True)
class PerceptionResult:
    """What became of one picture.

    Args:
        frame: the picture.
        telemetry: the vehicle at its capture time.
        depth: metric depth at the camera's pixels; None where it has no scale.
        scale: the metric scale used, or one that was not good enough; None if there was none.
        scan: the obstacles; every element UNKNOWN while `trouble` is set.
        trouble: why the scan is not to be trusted; None if it is.
        detail: more words on the trouble, for the log.
        points: points of this picture that the vehicle's motion measured.
    """

    frame: Frame
    telemetry: Telemetry
    depth: DepthMap | None
    scale: ScaleStatus | None
    scan: ObstacleScan
    trouble: Trouble | None = None
    detail: str = ""
    points: int = 0

    @property
    def captured_ns(self) -> int:
        """Capture time of the picture on the service's clock."""
        return self.frame.captured_ns

    @property
    def trusted(self) -> bool:
        """Whether the autopilot may be told of it."""
        return self.trouble is None

    def distrusted(self, trouble: Trouble) -> PerceptionResult:
        """The same picture with its scan taken back."""
        unknown = unknown_scan(self.scan.min_distance_m, self.scan.max_distance_m)
        return replace(self, scan=unknown, trouble=trouble)


def unknown_scan(min_distance_m: float, max_distance_m: float) -> ObstacleScan:
    """A scan that knows nothing in any direction."""
    return ObstacleScan(
        np.full(SECTOR_COUNT, np.nan, np.float32),
        np.full(SECTOR_COUNT, SectorState.UNKNOWN, np.uint8),
        sector_bearings_deg(),
        min_distance_m,
        max_distance_m,
    )
