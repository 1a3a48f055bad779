"""Metres for a network that has none, or that is not to be trusted with them.

Two sources: points measured by the vehicle's own motion, and the ground at a known height. What a reading
is: `points` and `ground_scale`; how readings become one scale: `filter`; how inverse depth up to scale and
shift gets both: `affine_fit`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.depth.depth_map import DepthMap
from uavdepth.errors import ImageSizeError
from uavdepth.model.hints import GroundHint, PointHints
from uavdepth.scale.affine_fit import AffineFit
from uavdepth.scale.filter import GROUND, POINTS, ScaleFilter, ScaleReading
from uavdepth.scale.ground_scale import GroundScale, GroundScaler
from uavdepth.scale.points import LEAST_POINTS, PointScale, sample, scale_from_points
from uavdepth.scale.suspicion import Disagreement

NetworkKind = Literal["relative", "affine", "metric"]

METRIC_FACTORS = (0.4, 2.5)
"""Ground that asks a network which is metric by itself for a larger correction is not the ground below:
a valley floor or a roof (over a valley factors near 0.25 came out, each with a small sigma)."""

WANDER_PER_SQRT_S = 0.06
"""A network's scale wanders with what it sees: relative sigma added by the square root of a second."""

_GROUND_DOUBT = 0.07
"""Relative error of metres from the ground that no single picture shows: 2 % of slope, half a degree of
attitude, the rangefinder over grass."""

_FRESH_SHARE = 0.4
"""Of the points' error by regions, what is another one in the next picture."""

_RECENT_S = 0.3


@dataclass(frozen=True)
class ScaleEstimate:
    """How the network's answer becomes metres.

    1 / depth_m = scale * raw + shift, raw being 1 / depth of a relative or metric network, or the inverse
    depth of an affine one.

    Args:
        scale: 1 / metres for each unit of `raw`.
        shift: 1 / metres where `raw` is 0; 0 unless the network is affine.
        relative_sigma: one standard deviation of metres over metres, of the scale alone.
        sources: what it rests on now, of "ground" and "points"; empty while it is held.
        age_s: time since one of them was last heard, seconds.
        suspicion: what the sources together say is wrong with the configuration, in words, or None.
        scatter: relative error of the network's depth from place to place as the points show it; 0 where
            they never did.
        covariance: of scale and shift, (variance, covariance, variance); zeros unless the network is affine.
    """

    scale: float
    shift: float
    relative_sigma: float
    sources: tuple[str, ...]
    age_s: float
    suspicion: str | None = None
    scatter: float = 0.0
    covariance: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def factor(self) -> float:
        """Metres for each unit of depth of a network that is not affine."""
        return 1.0 / self.scale


class ScaleEstimator:
    """The scale of one network's depth, from picture to picture.

    In hover points are carried for a while and the ground goes on; without either the last scale is held
    with a doubt that grows. Times are passed in.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        kind: "relative": depth up to one factor; "affine": inverse depth up to scale and shift;
            "metric": depth in metres that are doubted.
        hold_s: how long a scale is held after the last source spoke, seconds.

    Raises:
        ValueError: a kind that is none of these, or a time that is not finite or below 0.
    """

    def __init__(
        self, camera: CameraModel, mount: CameraMount, kind: NetworkKind = "relative", hold_s: float = 30.0
    ) -> None:
        if kind not in ("relative", "affine", "metric"):
            raise ValueError(f"kind is {kind!r}: 'relative', 'affine' or 'metric' is needed")
        if not (math.isfinite(hold_s) and hold_s >= 0):
            raise ValueError(f"hold_s is {hold_s}: a finite time of 0 s or more is needed")
        self.camera = camera
        self.mount = mount
        self.kind = kind
        self.hold_s = hold_s
        self._plausible = METRIC_FACTORS if kind == "metric" else None
        self._scaler = GroundScaler(camera, mount, self._plausible)
        self._filter = ScaleFilter(WANDER_PER_SQRT_S)
        self._fit = AffineFit(camera, mount, self._scaler)
        self._disagreement = Disagreement()
        self.clear()

    def clear(self) -> None:
        """Forget everything: the camera or the network was changed, or time went back."""
        self._filter.clear()
        self._disagreement.clear()
        self._fit.clear()
        self._scatter = 0.0
        self._region_sigma = 0.0
        self._at_ns: int | None = None

    def update(
        self, depth: DepthMap, ground: GroundHint | None, points: PointHints | None, captured_ns: int
    ) -> ScaleEstimate | None:
        """The scale to use for one picture.

        Args:
            depth: the network's answer, in its own unit.
            ground: level ground at a known height, or None.
            points: measured points, or None.
            captured_ns: when the picture was taken. A step back in time begins anew.

        Returns:
            None as long as nothing was measured, and `hold_s` after the last measurement.

        Raises:
            ImageSizeError: depth that is not (H, W) of the camera.
        """
        if depth.depth_m.shape != (self.camera.height, self.camera.width):
            raise ImageSizeError(
                f"the depth map's shape is {depth.depth_m.shape}, "
                f"the camera's is {(self.camera.height, self.camera.width)}"
            )
        passed_s = 0.0 if self._at_ns is None else (captured_ns - self._at_ns) * 1e-9
        if passed_s < 0:
            self.clear()
            passed_s = 0.0
        self._at_ns = captured_ns
        self._filter.predict(passed_s)
        if self.kind != "affine":
            by_ground = None
            if ground is not None:
                by_ground = self._scaler.estimate(depth.depth_m, ground.attitude, ground.height_m)
            # What is doubtful is left out: the filter takes the doubt of one source for lasting.
            sure = by_ground if by_ground is not None and by_ground.is_sure else None
            self._listen(depth.depth_m, sure, points, passed_s)
            return self._estimate()
        values = depth.affine_inverse_depth
        if values is None:
            raise ValueError("an affine network's depth map has affine_inverse_depth; this one has none")
        # The filter's log factor is against the fit, so it moves with it.
        self._filter.shift(self._fit.update(values, ground, points, passed_s))
        if self._fit.shape is None:
            return None
        self._listen(self._fit.depth_m(values), self._fit.ground, points, passed_s)
        return self._estimate()

    def _listen(
        self,
        depth_m: NDArray[np.float32],
        by_ground: GroundScale | None,
        points: PointHints | None,
        passed_s: float,
    ) -> None:
        """What both sources say of depth in the network's (or the fit's) unit."""
        readings = []
        by_points = None
        if points is not None and len(points) >= LEAST_POINTS:
            by_points = self._plausible_points(scale_from_points(sample(depth_m, points, self.camera)))
        if by_points is not None:
            readings.append(
                ScaleReading(
                    POINTS,
                    by_points.log_factor,
                    by_points.shared_sigma,
                    _FRESH_SHARE * by_points.region_sigma,
                )
            )
            share = 1.0 - math.exp(-passed_s) if self._scatter else 1.0
            self._scatter += share * (by_points.scatter - self._scatter)
            self._region_sigma += share * (by_points.region_sigma - self._region_sigma)
        if by_ground is not None:
            lasting = math.hypot(by_ground.relative_sigma, _GROUND_DOUBT)
            readings.append(ScaleReading(GROUND, math.log(by_ground.factor), lasting, 0.02))
        if by_points is not None and by_ground is not None:
            self._disagreement.add(math.log(by_ground.factor), by_points.log_factor, passed_s)
        else:
            self._disagreement.rest(passed_s)
        self._filter.take(readings, passed_s)

    def _plausible_points(self, found: PointScale | None) -> PointScale | None:
        if found is None or self._plausible is None:
            return found
        low, high = self._plausible
        return found if low <= math.exp(found.log_factor) <= high else None

    def _estimate(self) -> ScaleEstimate | None:
        held = self._filter
        if not held.known or held.age_s() > self.hold_s:
            return None
        sources = tuple(source for source in (GROUND, POINTS) if held.age_s(source) <= _RECENT_S)
        # Errors of regions come in every reading anew, but not by chance: they do not average out.
        sigma = math.hypot(held.sigma, self._region_sigma)
        scale, shift, covariance = math.exp(-held.log_factor), 0.0, (0.0, 0.0, 0.0)
        shape = self._fit.shape
        if shape is not None:
            theta = scale * np.array([shape.scale, shape.shift])
            whole = scale**2 * shape.relative() + sigma**2 * np.outer(theta, theta)
            covariance = float(whole[0, 0]), float(whole[0, 1]), float(whole[1, 1])
            scale, shift = float(theta[0]), float(theta[1])
        return ScaleEstimate(
            scale,
            shift,
            sigma,
            sources,
            held.age_s(),
            self._disagreement.text,
            self._scatter,
            covariance,
        )


def apply(estimate: ScaleEstimate, depth: DepthMap) -> DepthMap:
    """Metric depth, its relative sigma with the doubt of the scale in it.

    Where the network tells no doubt of its own, the scatter that points have shown stands for it.

    Args:
        estimate: of the same picture or of one shortly before.
        depth: the network's answer, in its own unit.
    """
    if depth.affine_inverse_depth is not None:
        fitted = depth.fitted(estimate.scale, estimate.shift)
        raw = depth.affine_inverse_depth
        first, both, second = (np.float32(each) for each in estimate.covariance)
        variance = (first * raw + 2 * both) * raw + second
        sigma = np.sqrt(np.maximum(variance, 0) * fitted.depth_m**2 + np.float32(estimate.scatter**2))
        return DepthMap(fitted.depth_m, sigma.astype(np.float32))
    own = np.float32(estimate.scatter) if depth.relative_sigma is None else depth.relative_sigma
    metres = depth.depth_m * np.float32(estimate.factor)
    sigma = np.hypot(own, np.float32(estimate.relative_sigma)).astype(np.float32)
    return DepthMap(metres, np.where(np.isnan(metres), np.float32(np.nan), sigma))
