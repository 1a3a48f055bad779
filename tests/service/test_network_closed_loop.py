"""The shipped network flies in stepped time: rendered street, real depth, real bytes, both autopilots."""

from __future__ import annotations

import pytest

from service.fake_autopilot.autopilot import Flavor
from uavdepth.model.depth_model import WEIGHTS_FOLDER

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
from service.flight_evaluation.closed_loop import Flown, Outcome, fly_route
from service.flight_evaluation.routes import Route
from service.flight_evaluation.sight import DepthKind, Eyes
from service.settings import Settings
from uavdepth.scenes import Scene, load_scene

SEED_KEPT_FROM_TRAINING = 1003
LATENCY_S = 0.1
START_NORTH_M = 18.0
SETTINGS = Settings.model_validate(
    {
        "camera": {"source": "sim:city", "width": 320, "height": 200, "horizontal_fov_deg": 90.0},
        "mount": {"pitch_deg": -10.0},
        "model": {"threads": 1, "provider": "cpu"},
    }
)


@pytest.fixture(scope="module")
def street() -> Scene:
    return load_scene("city", SEED_KEPT_FROM_TRAINING)


@pytest.fixture(scope="module")
def to_the_facade(street: Scene) -> Route:
    """Along the street to the house at its end."""
    height_m = 3.0
    facade_m = float(street.ray_distance_m((START_NORTH_M, 0.0, -height_m), (1.0, 0.0, 0.0))[0])
    return Route(START_NORTH_M, 0.0, 0.0, height_m, facade_m)


def fly(street: Scene, route: Route, flavor: Flavor, *, seeing: bool = True) -> Flown:
    eyes = Eyes(SETTINGS, DepthKind.NETWORK) if seeing else None
    return fly_route(street, SETTINGS, flavor, eyes, route, LATENCY_S)


@pytest.mark.skipif(not (WEIGHTS_FOLDER / "default.onnx").is_file(), reason="no network ships yet")
class TestAStreetThatNoTrainingSaw:
    @pytest.mark.parametrize("flavor", ["ardupilot", "px4"])
    def test_the_vehicle_stops_before_the_facade(
        self, street: Scene, to_the_facade: Route, flavor: Flavor
    ) -> None:
        flown = fly(street, to_the_facade, flavor)
        assert flown.outcome is Outcome.STOPPED
        assert flown.way_m > 5.0, "it must have flown"
        assert flown.way_m < to_the_facade.length_m - 2.0

    def test_the_same_flight_without_seeing_hits_it(self, street: Scene, to_the_facade: Route) -> None:
        flown = fly(street, to_the_facade, "ardupilot", seeing=False)
        assert flown.outcome is Outcome.TOUCHED
        assert flown.way_m > to_the_facade.length_m - 2.0
