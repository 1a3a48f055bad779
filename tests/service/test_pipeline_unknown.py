"""What is not known is never told as clear: from the network's answer to the words on the wire."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from program_fakes import make_settings, picture, wall_over_ground

from service.frame import Frame
from service.pipeline import Perception, PerceptionResult
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.depth.depth_map import DepthMap
from uavdepth.messages.autopilot_profile import PROFILES
from uavdepth.messages.obstacle_distance import UNKNOWN_WORD, obstacle_words
from uavdepth.model.hints import Hints
from uavdepth.scale.estimator import ScaleEstimator
from uavdepth.scan.body_rays import body_rays
from uavdepth.scan.motion import moved_scan
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, SECTOR_WIDTH_DEG, SectorState, sector_bearings_deg
from uavdepth.scan.scanner import ObstacleScanner

SETTINGS = make_settings("motion.points=false")
CAMERA, MOUNT = SETTINGS.camera.model, CameraMount()
RAYS = body_rays(CAMERA, MOUNT)
CLEAR_WORD = 2001
"""20 m and a centimetre."""

DOUBTS = (0.51, 0.7, 3.0, math.inf)
"""Beyond the limit of 0.5."""

NOT_KNOWN = ("nan", "zero", "negative", "minus infinity", "doubted", "doubt not known", "masked")


@dataclass
class Answers:
    """A network that answers what the test wants."""

    depth: DepthMap

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        return self.depth


@dataclass(frozen=True)
class Case:
    """One picture of a random world by a vehicle that knows what it knows."""

    seed: int
    wall_m: float
    attitude: Attitude | None
    height_m: float | None
    has_hints: bool
    has_sigma: bool
    unit: float
    salt: float
    first: int
    elements: int
    how: str


angles = st.floats(math.radians(-25), math.radians(25))
attitudes = st.builds(Attitude, angles, angles, st.floats(-3.1, 3.1))
cases = st.builds(
    Case,
    seed=st.integers(0, 2**32 - 1),
    wall_m=st.one_of(st.just(math.inf), st.floats(1.0, 90.0)),
    attitude=attitudes,
    height_m=st.floats(0.5, 12.0),
    has_hints=st.booleans(),
    has_sigma=st.booleans(),
    unit=st.floats(0.1, 5.0),
    salt=st.sampled_from([0.0, 0.02, 0.3]),
    first=st.integers(20, 45),
    elements=st.integers(1, 24),
    how=st.sampled_from(NOT_KNOWN),
)
troubled = st.builds(
    replace,
    cases,
    attitude=st.one_of(st.none(), attitudes, st.builds(Attitude, st.just(math.nan), angles, angles)),
    height_m=st.one_of(
        st.none(), st.sampled_from([math.nan, math.inf, -1.0, 0.0, 0.1]), st.floats(0.5, 12.0)
    ),
)


def in_wedge(case: Case) -> NDArray[np.bool_]:
    """(H, W) the pixels that look into the case's elements, as a vehicle that is not level sees them."""
    attitude = case.attitude if case.attitude is not None else Attitude(0.0, 0.0, 0.0)
    level = np.tensordot(attitude.level_from_body, RAYS, axes=1)
    bearing = np.degrees(np.arctan2(level[1], level[0]))
    low, high = (sector_bearings_deg()[i] for i in (case.first, case.first + case.elements - 1))
    return np.asarray((bearing >= low - SECTOR_WIDTH_DEG / 2) & (bearing <= high + SECTOR_WIDTH_DEG / 2))


def perceive(case: Case) -> PerceptionResult:
    """What becomes of a picture in which the case's elements are not known."""
    rng = np.random.default_rng(case.seed)
    unknown = in_wedge(case)
    unit = 1.0 if case.has_hints else case.unit
    depth = wall_over_ground(CAMERA, case.wall_m, 2.0) * np.float32(unit)
    depth = np.minimum(depth, 1000.0) * np.exp(0.05 * rng.standard_normal(depth.shape))
    depth[rng.random(depth.shape) < case.salt] = rng.choice([np.nan, 0.0, 1e9, 0.01, -5.0])
    sigma = np.full(depth.shape, 0.1) if case.has_sigma or case.how.startswith("doubt") else None
    values = {"nan": np.nan, "zero": 0.0, "negative": -3.0, "minus infinity": -np.inf}
    if case.how in values:
        depth[unknown] = values[case.how]
    elif sigma is not None and case.how != "masked":
        sigma[unknown] = np.nan if case.how == "doubt not known" else rng.choice(DOUBTS)
    depth32 = depth.astype(np.float32)
    answer = DepthMap(depth32, None if sigma is None else sigma.astype(np.float32))
    mask = unknown if case.how == "masked" else None
    scanner = ObstacleScanner(CAMERA, MOUNT, mask=mask)
    scale = None if case.has_hints else ScaleEstimator(CAMERA, MOUNT)
    perception = Perception(SETTINGS, Answers(answer), scale, scanner)
    return perception.step(Frame(picture(), 1_000_000_000, 0), Telemetry(0, case.attitude, case.height_m))


@settings(max_examples=120, deadline=None)
@given(cases, st.integers(-8, 8))
def test_r7_a_direction_of_which_nothing_is_known_is_never_clear_on_the_wire(case: Case, turn: int) -> None:
    result = perceive(case)
    inside = (np.arange(case.first, case.first + case.elements) - turn) % SECTOR_COUNT
    # As it is sent: turned on by whole elements since the picture was taken.
    sent = moved_scan(result.scan, math.radians(turn * SECTOR_WIDTH_DEG), (0.0, 0.0))
    assert not np.any(sent.state[inside] == SectorState.CLEAR)
    for profile in PROFILES.values():
        words = obstacle_words(sent, profile)
        clear = np.flatnonzero(words[: profile.element_count] == CLEAR_WORD)
        starts = profile.first_bearing_deg + clear * profile.increment_deg - profile.increment_deg / 2
        for bearing in sector_bearings_deg()[inside]:
            offset = (bearing - starts) % 360.0
            assert not np.any((offset > 0.1) & (offset < profile.increment_deg - 0.1))


@settings(max_examples=80, deadline=None)
@given(troubled)
def test_what_is_not_trusted_says_nothing_and_what_is_has_a_scale_within_the_gate(case: Case) -> None:
    result = perceive(case)
    if result.trusted:
        assert result.scale is not None
        assert result.scale.relative_sigma <= SETTINGS.scale.max_relative_sigma
        assert result.scale.age_s <= SETTINGS.scale.max_age_s
        assert case.attitude is not None
        assert math.isfinite(case.attitude.roll_rad)
        assert case.height_m is not None
        assert math.isfinite(case.height_m)
    else:
        assert result.trouble is not Trouble.MODEL_FAILED, result.detail
        assert np.all(result.scan.state == SectorState.UNKNOWN)
        assert np.all(obstacle_words(result.scan) == UNKNOWN_WORD)


@settings(max_examples=60, deadline=None)
@given(troubled, st.integers(0, 2**32 - 1))
def test_r6_whatever_the_network_answers_the_words_are_legal(case: Case, seed: int) -> None:
    rng = np.random.default_rng(seed)
    pool = np.array([np.nan, np.inf, -np.inf, -1.0, 0.0, 1e-30, 0.2, 5.0, 20.0, 1e6, 3e38], np.float32)
    shape = (CAMERA.height, CAMERA.width)
    answer = DepthMap(rng.choice(pool, shape), rng.choice(pool, shape) if case.has_sigma else None)
    scale = None if case.has_hints else ScaleEstimator(CAMERA, MOUNT)
    perception = Perception(SETTINGS, Answers(answer), scale, ObstacleScanner(CAMERA, MOUNT))
    result = perception.step(Frame(picture(), 0, 0), Telemetry(0, case.attitude, case.height_m))
    assert result.trouble is not Trouble.MODEL_FAILED, result.detail
    words = obstacle_words(result.scan)
    assert np.all(((words > 20) & (words < 2000)) | (words == CLEAR_WORD) | (words == UNKNOWN_WORD))
