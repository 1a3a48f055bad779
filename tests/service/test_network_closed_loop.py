"""The shipped network flies: rendered street, real depth, real message bytes, both autopilots; stepped time.

One frame follows the other at 12 Hz of simulated time, each 0.1 s old when it arrives, so the outcome
does not depend on how fast the machine is.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.autopilot import Flavor, make_controller
from service.fake_autopilot.controller import Controller, Sticks
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.frame import Frame
from service.pipeline import Perception
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.depth_model import WEIGHTS_FOLDER
from uavdepth.obstacle_message import encode_obstacle_distance

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
from uavdepth.scenes import Scene, load_scene

SEED_KEPT_FROM_TRAINING = 1003
FRAME_S, LATENCY_S, STEP_S = 1 / 12, 0.1, 0.01
HEIGHT_M, SPEED_MPS, MARGIN_M = 3.0, 3.0, 4.0
STICKS = {"ardupilot": Sticks(forward=SPEED_MPS / 5.0), "px4": Sticks(forward=SPEED_MPS / 10.0)}
MODES = {"ardupilot": "LOITER", "px4": "POSCTL"}
PARAMETERS = {
    "ardupilot": {"AVOID_MARGIN": MARGIN_M, "PRX_FILT": 5.0, "ARMING_SKIPCHK": -1.0},
    "px4": {"CP_DIST": MARGIN_M},
}
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


@dataclass
class Flown:
    """What came of a flight."""

    controller: Controller
    norths_m: list[float]
    """North of the origin, ten times a second from the first stick on."""
    messages: int


def fly(flavor: Flavor, street: Scene, seconds: float, *, seeing: bool = True) -> Flown:
    """Take off, then hold the stick forward for `seconds`."""
    controller = make_controller(flavor, street, parameters=PARAMETERS[flavor])
    controller.set_mode("GUIDED" if flavor == "ardupilot" else "POSCTL")
    assert controller.arm() == mavlink.MAV_RESULT_ACCEPTED
    assert controller.takeoff(HEIGHT_M) == mavlink.MAV_RESULT_ACCEPTED
    perception = Perception.load(SETTINGS)
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=196)
    receiver = mavlink.MAVLink(None)
    on_the_way: deque[tuple[float, bytes]] = deque()
    norths_m: list[float] = []
    messages, next_frame_s, index = 0, 6.0, 0
    while controller.now_s < 8.0 + seconds:
        if controller.now_s >= 8.0:
            if controller.mode != MODES[flavor]:
                controller.set_mode(MODES[flavor])
            controller.set_sticks(STICKS[flavor])
        if seeing and controller.now_s >= next_frame_s:
            next_frame_s += FRAME_S
            packet = look(perception, street, controller, sender, index)
            index += 1
            if packet is not None:
                on_the_way.append((controller.now_s + LATENCY_S, packet))
        while on_the_way and on_the_way[0][0] <= controller.now_s:
            for message in receiver.parse_buffer(on_the_way.popleft()[1]):
                controller.obstacles(ObstacleWords.from_message(message))
                messages += 1
        controller.step(STEP_S)
        if controller.now_s >= 8.0 + 0.1 * len(norths_m):
            norths_m.append(controller.vehicle.north_m)
    return Flown(controller, norths_m, messages)


def look(
    perception: Perception, street: Scene, controller: Controller, sender: mavlink.MAVLink, index: int
) -> bytes | None:
    """Picture, depth, scan and message of the vehicle as it is now; None where it is not trusted."""
    vehicle = controller.vehicle
    attitude: Attitude = vehicle.attitude
    camera, mount = SETTINGS.camera.model, SETTINGS.mount.mount
    image: NDArray[np.uint8] = street.render(camera, mount, vehicle.position_ned_m, attitude).image_bgr
    stamp_ns = round(controller.now_s * 1e9)
    telemetry = Telemetry(
        stamp_ns, attitude, -vehicle.down_m, vehicle.position_ned_m, vehicle.velocity_ned_mps, armed=True
    )
    result = perception.step(Frame(image, stamp_ns, index), telemetry)
    return encode_obstacle_distance(result.scan).pack(sender) if result.trusted else None


@pytest.mark.skipif(not (WEIGHTS_FOLDER / "default.onnx").is_file(), reason="no network ships yet")
class TestAStreetThatNoTrainingSaw:
    @pytest.mark.parametrize("flavor", ["ardupilot", "px4"])
    def test_the_vehicle_stops_before_the_facade(self, flavor: Flavor, street: Scene) -> None:
        flown = fly(flavor, street, 24.0)
        facade_m = float(street.ray_distance_m((0.0, 0.0, -HEIGHT_M), (1.0, 0.0, 0.0))[0])
        assert not flown.controller.collided
        assert max(flown.norths_m) > 12.0, "it must have flown"
        assert max(flown.norths_m) < facade_m - 1.0
        # The stick is still forward: ArduPilot backs off at up to 0.75 m/s and comes again.
        last_5_s = flown.norths_m[-50:]
        assert max(last_5_s) - min(last_5_s) < 3.5
        assert flown.messages > 150

    def test_the_same_flight_without_seeing_hits_it(self, street: Scene) -> None:
        flown = fly("ardupilot", street, 25.0, seeing=False)
        assert flown.controller.collided
        assert flown.messages == 0
