"""Metres for networks that have none, from points and from the ground."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from solids import Solid, box, depth_of, ground, slope, smooth_noise, wall

from uavdepth import (
    Attitude,
    CameraModel,
    CameraMount,
    DepthMap,
    GroundHint,
    GroundScaler,
    ImageSizeError,
    PointHints,
)
from uavdepth.scale.affine_fit import AffineFit
from uavdepth.scale.estimator import ScaleEstimate, ScaleEstimator, apply

CAMERA = CameraModel.from_fov(320, 160, 90)
MOUNT = CameraMount(pitch_deg=-10)
LEVEL = Attitude(0.0, 0.0, 0.0)
HEIGHT_M = 3.0
UNIT_M = 1.7
STEP_NS = 100_000_000

STREET = depth_of(
    [ground(HEIGHT_M), box((6, -6, -2), (9, -3, 3)), box((12, 2, -4), (16, 7, 3)), wall(30)],
    CAMERA,
    MOUNT,
    LEVEL,
)
GROUND = GroundHint(MOUNT, LEVEL, HEIGHT_M)


def points_on(
    truth_m: NDArray[np.float32],
    rng: np.random.Generator,
    *,
    count: int = 80,
    sigma: float = 0.05,
    fresh: float | None = None,
    wrong: float = 1.0,
) -> PointHints:
    """Points of exact depth times `wrong`, each with a fresh error."""
    rows, columns = np.nonzero(np.isfinite(truth_m) & (truth_m < 40))
    chosen = rng.choice(len(rows), count)
    row, column = rows[chosen], columns[chosen]
    errors = np.exp(rng.normal(0, sigma if fresh is None else fresh, count))
    return PointHints(
        np.stack([column, row], axis=1), truth_m[row, column] * wrong * errors, np.full(count, sigma)
    )


def relative(truth_m: NDArray[np.float32] = STREET) -> DepthMap:
    return DepthMap((truth_m / UNIT_M).astype(np.float32))


def affine(truth_m: NDArray[np.float32] = STREET) -> DepthMap:
    return DepthMap.from_affine((7.0 / truth_m - 0.4).astype(np.float32))


def flown(
    estimator: ScaleEstimator,
    depth: DepthMap,
    ground_hint: GroundHint | None,
    points: Callable[[], PointHints | None],
    pictures: int = 20,
    start: int = 0,
    step_ns: int = STEP_NS,
) -> ScaleEstimate | None:
    """The estimate after some pictures, ten a second."""
    found = None
    for number in range(start, start + pictures):
        found = estimator.update(depth, ground_hint, points(), number * step_ns)
    return found


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def off(found: ScaleEstimate | None, depth: DepthMap, truth_m: NDArray[np.float32] = STREET) -> float:
    """Median of metres over truth, minus 1."""
    assert found is not None
    metres = apply(found, depth).depth_m
    known = np.isfinite(truth_m) & np.isfinite(metres)
    return float(np.median(metres[known] / truth_m[known]) - 1)


@pytest.mark.parametrize("network", [relative, affine], ids=["relative", "affine"])
@pytest.mark.parametrize("sources", ["points", "ground", "both"])
def test_either_source_gives_the_metres_of_a_network_without_any(
    network: Callable[[], DepthMap], sources: str, rng: np.random.Generator
) -> None:
    kind = "affine" if network is affine else "relative"
    hint = None if sources == "points" else GROUND
    estimator = ScaleEstimator(CAMERA, MOUNT, kind)
    found = flown(estimator, network(), hint, lambda: None if sources == "ground" else points_on(STREET, rng))
    assert abs(off(found, network())) < 0.03
    assert found is not None
    assert found.sources == (("ground", "points") if sources == "both" else (sources,))
    assert 0.01 < found.relative_sigma < 0.1
    assert found.suspicion is None


def test_an_affine_network_s_near_and_far_things_are_both_right(rng: np.random.Generator) -> None:
    found = flown(ScaleEstimator(CAMERA, MOUNT, "affine"), affine(), None, lambda: points_on(STREET, rng))
    assert found is not None
    metres = apply(found, affine()).depth_m
    for nearest, farthest in ((3, 7), (15, 31)):
        band = (nearest < STREET) & (farthest > STREET)
        assert abs(np.median(metres[band] / STREET[band]) - 1) < 0.05


def test_farther_than_the_points_an_affine_network_s_metres_are_less_sure(rng: np.random.Generator) -> None:
    found = flown(ScaleEstimator(CAMERA, MOUNT, "affine"), affine(), None, lambda: points_on(STREET, rng), 2)
    assert found is not None
    metres = apply(found, DepthMap.from_affine(np.array([[7.0 / 8 - 0.4, 7.0 / 150 - 0.4]], np.float32)))
    assert metres.relative_sigma is not None
    assert metres.relative_sigma[0, 1] > 1.5 * metres.relative_sigma[0, 0]


def test_the_scale_makes_up_for_a_shape_that_moves(rng: np.random.Generator) -> None:
    fit, values = AffineFit(CAMERA, MOUNT, GroundScaler(CAMERA, MOUNT)), affine().affine_inverse_depth
    assert values is not None
    fit.update(values, None, points_on(STREET, rng), 0.1)
    before_m = fit.depth_m(values)
    made_up = fit.update(values, None, points_on(STREET, rng, wrong=1.3), 2.0)
    after_m = fit.depth_m(values)
    known = STREET < 15
    assert np.median(after_m[known] / before_m[known]) > 1.1
    assert np.median(np.exp(made_up) * after_m[known] / before_m[known]) == pytest.approx(1.0, abs=0.03)


def test_points_at_one_depth_do_not_tell_scale_and_shift(rng: np.random.Generator) -> None:
    flat = np.full_like(STREET, 9.0)
    found = flown(ScaleEstimator(CAMERA, MOUNT, "affine"), affine(flat), None, lambda: points_on(flat, rng))
    assert found is None


def test_a_wrong_velocity_does_not_average_out(rng: np.random.Generator) -> None:
    """All points share it: a hundred points in fifty pictures are as wrong as one."""
    estimator = ScaleEstimator(CAMERA, MOUNT)
    found = flown(
        estimator, relative(), None, lambda: points_on(STREET, rng, sigma=0.1, fresh=0.03, wrong=1.1), 50
    )
    assert found is not None
    assert found.relative_sigma > 0.07
    assert abs(off(found, relative())) < 2 * found.relative_sigma


def test_a_third_of_wrong_points_and_a_moving_lorry_do_not_move_the_scale(rng: np.random.Generator) -> None:
    def mixed() -> PointHints:
        good, bad = points_on(STREET, rng, count=60), points_on(STREET, rng, count=30)
        depth = np.concatenate([good.depth_m, bad.depth_m * rng.choice([0.3, 1.6, 2.5], 30)])
        # And one thing that moves along: all its points lie near one another and agree on nonsense.
        lorry = np.stack([rng.uniform(150, 170, 15), rng.uniform(90, 100, 15)], axis=1)
        return PointHints(
            np.concatenate([good.pixels, bad.pixels, lorry]),
            np.concatenate([depth, np.full(15, 60.0)]),
            np.full(105, 0.05),
        )

    assert abs(off(flown(ScaleEstimator(CAMERA, MOUNT), relative(), None, mixed), relative())) < 0.05


def test_too_few_points_say_nothing(rng: np.random.Generator) -> None:
    """Flight along the optical axis leaves few, and those near the edge of the picture."""
    few = flown(ScaleEstimator(CAMERA, MOUNT), relative(), None, lambda: points_on(STREET, rng, count=6))
    assert few is None


def test_in_hover_without_ground_the_scale_is_held_and_doubt_grows(rng: np.random.Generator) -> None:
    estimator = ScaleEstimator(CAMERA, MOUNT, hold_s=5.0)
    moving = flown(estimator, relative(), None, lambda: points_on(STREET, rng))
    held = [estimator.update(relative(), None, None, (20 + k) * STEP_NS) for k in range(60)]
    assert moving is not None
    assert held[0] is not None
    assert held[40] is not None
    assert held[40].scale == pytest.approx(moving.scale)
    assert moving.relative_sigma < held[0].relative_sigma < held[40].relative_sigma
    assert held[40].age_s == pytest.approx(4.1)
    assert held[40].sources == ()
    assert held[-1] is None


def test_ground_goes_on_where_points_stop(rng: np.random.Generator) -> None:
    estimator = ScaleEstimator(CAMERA, MOUNT)
    flown(estimator, relative(), GROUND, lambda: points_on(STREET, rng))
    hovering = flown(estimator, relative(), GROUND, lambda: None, 30, start=20)
    assert hovering is not None
    assert hovering.sources == ("ground",)
    assert hovering.age_s == 0.0
    assert abs(off(hovering, relative())) < 0.05


def test_over_a_slope_the_points_are_right(rng: np.random.Generator) -> None:
    hillside = depth_of([slope(HEIGHT_M, 4.0), wall(30)], CAMERA, MOUNT, LEVEL)
    by_ground = flown(ScaleEstimator(CAMERA, MOUNT), relative(hillside), GROUND, lambda: None)
    by_both = flown(
        ScaleEstimator(CAMERA, MOUNT),
        relative(hillside),
        GROUND,
        lambda: points_on(hillside, rng, sigma=0.03),
    )
    assert abs(off(by_ground, relative(hillside), hillside)) > 0.1
    assert abs(off(by_both, relative(hillside), hillside)) < 0.06


def test_a_roof_below_does_not_shrink_the_world(rng: np.random.Generator) -> None:
    estimator = ScaleEstimator(CAMERA, MOUNT)
    flown(estimator, relative(), GROUND, lambda: points_on(STREET, rng))
    roof = GroundHint(MOUNT, LEVEL, 0.8)
    found = flown(estimator, relative(), roof, lambda: points_on(STREET, rng), 30, start=20)
    assert found is not None
    assert abs(off(found, relative())) < 0.05
    assert found.sources == ("points",)


def test_a_roof_below_without_points_makes_the_scale_doubtful() -> None:
    estimator = ScaleEstimator(CAMERA, MOUNT)
    flown(estimator, relative(), GROUND, lambda: None)
    roof = GroundHint(MOUNT, LEVEL, 0.8)
    sigmas = [
        found.relative_sigma
        for number in range(20, 32)
        if (found := estimator.update(relative(), roof, None, number * STEP_NS)) is not None
    ]
    assert max(sigmas) > 0.25


TREETOPS = [box((3 + 2.2 * row, -60, 3 - 0.9 * row), (5 + 2.2 * row, 60, 40)) for row in range(8)]
ROOF = [box((4, -40, 2.5), (11, 40, 14)), ground(14)]
BANK = [slope(6, 25, 5)]


@pytest.mark.parametrize(
    ("network", "seen"),
    [(relative, TREETOPS), (affine, TREETOPS), (relative, ROOF), (affine, BANK)],
    ids=["treetops, relative", "treetops, affine", "roof, relative", "bank, affine"],
)
def test_what_is_not_the_measured_ground_is_not_surely_taken_for_it(
    network: Callable[[NDArray[np.float32]], DepthMap], seen: list[Solid], rng: np.random.Generator
) -> None:
    truth_m = depth_of(seen, CAMERA, MOUNT, LEVEL)
    estimator = ScaleEstimator(CAMERA, MOUNT, "affine" if network is affine else "relative")
    for number in range(4):
        depth = network(truth_m * smooth_noise(rng, truth_m.shape, 0.1))
        found = estimator.update(depth, GroundHint(MOUNT, LEVEL, 6.0), None, number * STEP_NS)
        is_sure = found is not None and found.relative_sigma <= 0.25
        assert not is_sure, f"it claims {found}, and is off by {off(found, depth, truth_m):.2f}"


def test_points_overrule_a_ground_that_was_wrong_from_the_start(rng: np.random.Generator) -> None:
    estimator = ScaleEstimator(CAMERA, MOUNT)
    flown(estimator, relative(), GroundHint(MOUNT, LEVEL, 1.2), lambda: None)
    found = flown(
        estimator, relative(), GroundHint(MOUNT, LEVEL, 1.2), lambda: points_on(STREET, rng), 15, start=20
    )
    assert abs(off(found, relative())) < 0.05


@pytest.mark.parametrize("factor", [0.75, 1.35])
def test_a_wrong_focal_length_is_reported(factor: float, rng: np.random.Generator) -> None:
    """In flight ahead metres from motion do not depend on the focal length, those from the ground do."""
    believed = CameraModel(
        CAMERA.width, CAMERA.height, CAMERA.fx * factor, CAMERA.fy * factor, CAMERA.cx, CAMERA.cy
    )
    estimator = ScaleEstimator(believed, CameraMount())
    seen = depth_of([ground(HEIGHT_M), wall(30)], CAMERA, CameraMount(), LEVEL)
    hint = GroundHint(CameraMount(), LEVEL, HEIGHT_M)
    early = flown(estimator, relative(seen), hint, lambda: points_on(seen, rng), 10, 0, 2 * STEP_NS)
    late = flown(estimator, relative(seen), hint, lambda: points_on(seen, rng), 25, 10, 2 * STEP_NS)
    assert early is not None
    assert early.suspicion is None
    assert late is not None
    assert late.suspicion is not None
    assert "focal length" in late.suspicion
    assert abs(off(late, relative(seen), seen)) < 0.12


def test_a_doubtful_metric_network_is_not_made_four_times_as_large(rng: np.random.Generator) -> None:
    quarter = DepthMap((STREET / 4).astype(np.float32))
    estimator = ScaleEstimator(CAMERA, MOUNT, "metric")
    assert flown(estimator, quarter, GROUND, lambda: points_on(STREET, rng)) is None
    found = flown(estimator, relative(), GROUND, lambda: points_on(STREET, rng), start=20)
    assert abs(off(found, relative())) < 0.03


def test_a_network_whose_unit_runs_away_is_followed_with_more_doubt(rng: np.random.Generator) -> None:
    steady, restless = ScaleEstimator(CAMERA, MOUNT), ScaleEstimator(CAMERA, MOUNT)
    for number in range(40):
        unit = math.exp(0.02 * number)
        points = points_on(STREET, rng)
        still = steady.update(relative(), None, points, number * STEP_NS)
        found = restless.update(DepthMap(STREET / np.float32(unit)), None, points, number * STEP_NS)
    assert still is not None
    assert found is not None
    assert abs(off(found, DepthMap(STREET / np.float32(unit)))) < 0.05
    held = [each.update(relative(), None, None, 50 * STEP_NS) for each in (steady, restless)]
    assert held[0] is not None
    assert held[1] is not None
    assert held[1].relative_sigma > held[0].relative_sigma


def test_the_doubt_of_the_scale_is_in_every_pixel(rng: np.random.Generator) -> None:
    found = flown(ScaleEstimator(CAMERA, MOUNT), relative(), None, lambda: points_on(STREET, rng))
    assert found is not None
    own = np.full_like(STREET, 0.2)
    own[:80] = np.nan
    told = apply(found, DepthMap(relative().depth_m, own)).relative_sigma
    assert told is not None
    assert np.isnan(told[0, 0])
    assert told[-1, 0] == pytest.approx(math.hypot(0.2, found.relative_sigma), rel=1e-3)


def test_a_step_back_in_time_begins_anew(rng: np.random.Generator) -> None:
    estimator = ScaleEstimator(CAMERA, MOUNT)
    flown(estimator, relative(), None, lambda: points_on(STREET, rng), start=20)
    assert estimator.update(relative(), None, None, 10 * STEP_NS) is None


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="'relative', 'affine' or 'metric'"):
        ScaleEstimator(CAMERA, MOUNT, "disparity")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"hold_s is -1\.0"):
        ScaleEstimator(CAMERA, MOUNT, hold_s=-1.0)
    with pytest.raises(ImageSizeError, match="160, 320"):
        ScaleEstimator(CAMERA, MOUNT).update(DepthMap(np.ones((4, 4), np.float32)), None, None, 0)
