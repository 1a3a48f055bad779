"""What is done when perception is lost: the pilot is told at once, and the vehicle is asked to stop, once."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hold_flight import HoldFlight
from hold_talk import MS, S, Talk
from link_support import Voice
from numpy.typing import NDArray
from program_fakes import (
    FLYING_HEIGHT_M,
    ScriptedCamera,
    make_settings,
    picture,
    wait_until,
    wall_over_ground,
)
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from running_service import running, texts

from service.autopilot.hold_request import HoldOutcome
from service.cameras.reader import CameraState
from service.clock import MonotonicClock
from service.errors import CameraError
from service.fake_autopilot.fake_autopilot import FakeAutopilot
from service.fake_autopilot.pilot import Pilot
from service.health import Announcer, Vitals, state_of, trouble_of
from service.hold_on_loss import HoldOnLoss, Moment
from service.pipeline import Perception
from service.run import Service
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints
from uavdepth.scan.scanner import ObstacleScanner

LAST_MESSAGE_NS = 10 * S


def well(
    at_ns: int = LAST_MESSAGE_NS, speed_mps: float | None = 3.0, north_m: float = 0.0, **values: Any
) -> Moment:
    """Distances are sent; a moving, armed ArduCopter in LOITER."""
    velocity = None if speed_mps is None else (speed_mps, 0.0, 0.0)
    known: dict[str, Any] = {
        "trouble": None,
        "sent_ns": at_ns,
        "protected": True,
        "heard": True,
        "armed": True,
        "autopilot": "ardupilot",
        "mode": "LOITER",
        "pose": Telemetry(at_ns, position_ned_m=(north_m, 0.0, -5.0), velocity_ned_mps=velocity),
    }
    return Moment(at_ns, **{**known, **values})


def lost(after_s: float, **values: Any) -> Moment:
    """So long after the last message."""
    at_ns = LAST_MESSAGE_NS + round(after_s * 1e9)
    return well(at_ns, **{"trouble": Trouble.CAMERA_LOST, "sent_ns": LAST_MESSAGE_NS, **values})


def asked(*moments: Moment, on_loss: HoldOnLoss | None = None) -> int:
    """How often the vehicle is asked."""
    on_loss = on_loss or HoldOnLoss()
    return sum(on_loss.hear(moment) for moment in moments)


class TestWhenItIsAsked:
    def test_a_moving_vehicle_is_asked_once_0_7_s_after_the_last_message(self) -> None:
        on_loss = HoldOnLoss()
        assert asked(well(), lost(0.45), lost(0.69), on_loss=on_loss) == 0
        assert asked(lost(0.71), on_loss=on_loss) == 1
        assert asked(*[lost(0.75 + 0.05 * k) for k in range(100)], on_loss=on_loss) == 0

    @pytest.mark.parametrize(
        "trouble", [Trouble.STALLED, Trouble.MODEL_FAILED, Trouble.NO_HEIGHT, Trouble.NOT_SENT]
    )
    def test_whatever_the_reason(self, trouble: Trouble) -> None:
        assert asked(well(), lost(1.0, trouble=trouble)) == 1

    @pytest.mark.parametrize(
        "values",
        [
            {"armed": False},
            {"armed": None, "protected": False},
            {"protected": False},
            {"speed_mps": 0.2},
            {"speed_mps": None},
            {"heard": False},
        ],
    )
    def test_nothing_is_asked_of_a_vehicle_that_was_not_protected_or_does_not_move(
        self, values: dict[str, Any]
    ) -> None:
        assert asked(well(), lost(1.0, **values)) == 0

    @pytest.mark.parametrize(
        ("autopilot", "mode", "count"),
        [
            ("ardupilot", "LOITER", 1),
            ("ardupilot", "GUIDED", 1),
            ("ardupilot", "ALT_HOLD", 1),
            ("ardupilot", "AUTO", 0),
            ("ardupilot", "STABILIZE", 0),
            ("px4", "POSCTL", 1),
            ("px4", "OFFBOARD", 0),
            ("px4", "LAND", 0),  # distances act on nudges; a landing is never stopped
            ("generic", "LOITER", 0),
        ],
    )
    def test_only_in_modes_that_distances_act_in(self, autopilot: str, mode: str, count: int) -> None:
        values: dict[str, Any] = {"autopilot": autopilot, "mode": mode}
        assert asked(well(**values), lost(1.0, **values)) == count

    def test_a_vehicle_that_was_held_at_the_wall_is_asked_when_it_begins_to_move(self) -> None:
        on_loss = HoldOnLoss()
        still = [lost(0.7 + 0.1 * k, speed_mps=0.1) for k in range(12)]
        assert asked(well(speed_mps=0.0), *still, on_loss=on_loss) == 0
        assert asked(lost(2.0, speed_mps=0.6), on_loss=on_loss) == 1

    @pytest.mark.parametrize(
        ("trouble", "count"),
        [
            (Trouble.CAMERA_LOST, 1),
            (Trouble.STALLED, 1),
            (Trouble.OLD_SCALE, 0),  # moving is how metres come back
            (Trouble.NO_HEIGHT, 0),
        ],
    )
    def test_who_hovers_while_a_part_has_failed_is_asked_once_whenever_it_moves(
        self, trouble: Trouble, count: int
    ) -> None:
        hovers = [lost(0.7 + 0.5 * k, speed_mps=0.1, trouble=trouble) for k in range(60)]
        moves = [lost(31.0 + 0.1 * k, trouble=trouble) for k in range(20)]
        assert asked(well(speed_mps=0.0), *hovers) == 0
        assert asked(well(speed_mps=0.0), *hovers, *moves) == count

    def test_who_creeps_is_asked_after_a_metre(self) -> None:
        creeps = [lost(0.05 * k, speed_mps=0.3, north_m=0.015 * k) for k in range(200)]
        way_m = [0.015 * k for k in range(200) if asked(well(speed_mps=0.3), *creeps[: k + 1])]
        assert way_m[0] == pytest.approx(0.7 * 0.3 + 1.0, abs=0.03)

    def test_gusts_and_a_reset_of_the_position_are_no_way(self) -> None:
        gusts = [lost(0.1 * k, speed_mps=0.3, north_m=0.4 * math.sin(k)) for k in range(300)]
        elsewhere = [lost(30.0 + 0.1 * k, speed_mps=0.3, north_m=7.0) for k in range(300)]
        assert asked(well(speed_mps=0.0), *gusts, *elsewhere) == 0

    def test_who_has_stopped_by_himself_is_not_asked(self) -> None:
        brakes = [lost(0.05 * k, speed_mps=3.0 - 0.22 * k, north_m=0.1 * k) for k in range(14)]
        stands = [lost(0.7 + 0.1 * k, speed_mps=0.0, north_m=1.3) for k in range(100)]
        assert asked(well(), *brakes, *stands) == 0

    def test_a_vehicle_that_was_not_heard_for_long_may_have_another_wish_by_now(self) -> None:
        hovers, unheard = lost(2.0, speed_mps=0.0), {"heard": False, "speed_mps": None}
        assert asked(well(speed_mps=0.0), hovers, lost(3.0, **unheard), lost(4.0)) == 1
        assert asked(well(speed_mps=0.0), hovers, lost(3.0, **unheard), lost(9.0, **unheard), lost(10.0)) == 0

    def test_a_pilot_who_has_changed_the_mode_is_not_asked_even_back_in_the_first_mode(self) -> None:
        assert asked(well(), lost(0.5, mode="STABILIZE"), lost(0.8), lost(1.5)) == 0

    def test_a_pilot_who_takes_over_after_the_request_is_not_asked_again(self) -> None:
        taken_over = [lost(1.0, mode="BRAKE"), lost(2.0), lost(3.0)]
        assert asked(well(), lost(0.8), *taken_over) == 1

    def test_a_flicker_of_perception_does_not_ask_the_pilot_who_has_taken_over(self) -> None:
        on_loss = HoldOnLoss()
        assert asked(well(), lost(0.8), on_loss=on_loss) == 1
        back_ns = LAST_MESSAGE_NS + 5 * S
        assert asked(well(back_ns), well(back_ns + S), on_loss=on_loss) == 0
        again = well(back_ns + 2 * S, trouble=Trouble.STALLED, sent_ns=back_ns + S)
        assert asked(again, on_loss=on_loss) == 0

    @pytest.mark.parametrize("how", ["recovered", "armed again"])
    def test_after_3_s_of_distances_or_a_new_arming_a_new_loss_is_a_new_one(self, how: str) -> None:
        on_loss = HoldOnLoss()
        assert asked(well(), lost(0.8), on_loss=on_loss) == 1
        back_ns = LAST_MESSAGE_NS + 5 * S
        if how == "armed again":
            on_loss.hear(well(back_ns, armed=False))
            on_loss.hear(well(back_ns + S))
            last_ns = back_ns + S
        else:
            for tenth in range(32):
                on_loss.hear(well(back_ns + tenth * 100 * MS))
            last_ns = back_ns + 3100 * MS
        again = well(last_ns + S, trouble=Trouble.STALLED, sent_ns=last_ns)
        assert asked(again, on_loss=on_loss) == 1


def test_half_a_second_after_the_last_distances_the_pilot_has_a_text_and_the_heartbeat_is_critical() -> None:
    """The monitor looks every 50 ms, the link's thread turns every 20 ms."""
    talk = Talk().talk
    announcer, told = (
        Announcer(),
        Vitals(
            talk.now_ns, 0, CameraState.DELIVERING, True, True, talk.now_ns, talk.now_ns, None, talk.now_ns
        ),
    )
    for late_ns in range(-2 * S, 501 * MS, 50 * MS):
        if late_ns < 0:
            told = replace(told, frame_ns=talk.now_ns, result_ns=talk.now_ns, sent_ns=talk.now_ns)
        now = replace(told, now_ns=talk.now_ns)
        trouble = trouble_of(now)
        state = state_of(trouble, now)
        talk.session.set_state(state)
        words = announcer.hear(trouble, state, talk.now_ns)
        if words is not None:
            talk.session.say(words.severity, words.text, talk.now_ns)
        talk.hear(Voice().attitude(talk.now_ns // MS))
        talk.wait_s(0.05)
    last_sent_ns = told.sent_ns or 0
    (text,) = [(at, m) for at, m in talk.sent_of("STATUSTEXT") if "OFF" in m.text]
    beats = [(at, m) for at, m in talk.sent_of("HEARTBEAT") if m.system_status == mavlink.MAV_STATE_CRITICAL]
    assert text[1].severity == mavlink.MAV_SEVERITY_CRITICAL
    assert text[0] - last_sent_ns <= 500 * MS
    assert beats[0][0] - last_sent_ns <= 500 * MS


class SeesAWall:
    """A network that is told the ground and sees a wall 8 m ahead, whatever the picture."""

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        height_m = hints.ground.height_m if hints and hints.ground else FLYING_HEIGHT_M
        return DepthMap(wall_over_ground(camera, 8.0, height_m), None)


def sees_a_wall(settings: Settings) -> Perception:
    camera, mount = settings.camera.model, settings.mount.mount
    scanner = ObstacleScanner(camera, mount, sigma_factor=0.0)
    return Perception(settings, SeesAWall(), None, scanner, takes=("ground",))


@pytest.mark.parametrize(
    ("flavor", "parameters", "flown_in", "stopped_in"),
    [
        ("ardupilot", {"ARMING_SKIPCHK": -1.0}, "LOITER", "BRAKE"),
        ("px4", {"CP_DIST": 3.0}, "POSCTL", "AUTO.LOITER"),
    ],
)
def test_a_vehicle_that_flies_when_a_camera_dies_is_stopped_in_its_own_way(
    flavor: Any, parameters: dict[str, float], flown_in: str, stopped_in: str
) -> None:
    flight = HoldFlight(flavor, flown_in, **parameters)
    flight.fly(5.0, stick=0.5)
    assert flight.speed_mps > 1.0
    flight.trouble = Trouble.CAMERA_LOST
    flight.fly(4.0, stick=0.5)
    assert flight.controller.mode == stopped_in
    assert flight.speed_mps < 0.3
    assert len(flight.asked) == 1


@pytest.mark.parametrize("stick", [0.05, 0.5])
def test_a_hovering_vehicle_is_held_once_when_it_sets_out_without_distances(stick: float) -> None:
    """Down to a creep of 0.25 m/s, which no margin stops any more."""
    flight = HoldFlight("ardupilot", "LOITER", ARMING_SKIPCHK=-1.0)
    flight.trouble = Trouble.CAMERA_LOST
    flight.fly(20.0)
    assert flight.asked == []
    hovered_at_m = flight.controller.vehicle.north_m
    flight.fly(10.0, stick, until=lambda: flight.controller.mode != "LOITER")
    assert flight.controller.mode == "BRAKE"
    assert flight.controller.vehicle.north_m - hovered_at_m < 1.3

    flight.controller.set_mode("LOITER")
    flight.fly(10.0, stick)
    assert flight.controller.mode == "LOITER"
    assert len(flight.asked) == 1


def test_the_pilot_reads_what_is_asked_for_and_that_it_was_refused() -> None:
    settings = make_settings("autopilot.on_loss=hold")
    camera = ScriptedCamera(settings, MonotonicClock(), [picture()] * 20 + [CameraError("unplugged")])
    with running(settings=settings, camera=camera, mode="LOITER") as run:

        def reads(text: str) -> bool:
            """While the vehicle drifts north."""
            north_m, east_m, down_m = run.link.position_ned_m or (0.0, 0.0, 0.0)
            run.link.position_ned_m = (north_m + 0.01, east_m, down_m)
            return text in texts(run.link)

        wait_until(lambda: reads("uavdepth: asks for BRAKE"))
        run.link.hold_outcome = HoldOutcome.REFUSED
        wait_until(lambda: reads("uavdepth: hold refused, fly by hand"))


@pytest.mark.parametrize("late_s", [0.1, 0.4, 0.7, 0.9])
def test_a_pilot_who_takes_over_from_a_hover_and_flies_off_is_not_stopped(late_s: float) -> None:
    """The autopilot tells its mode once a second only."""
    flight = HoldFlight("ardupilot", "LOITER", ARMING_SKIPCHK=-1.0)
    flight.trouble = Trouble.CAMERA_LOST
    flight.fly(2.0 + late_s)
    flight.controller.set_mode("ALT_HOLD")
    flight.fly(3.0, stick=1.0)
    assert flight.asked == []
    assert flight.speed_mps > 3.0


def test_a_camera_that_dies_in_flight_stops_the_vehicle_and_a_pilot_who_takes_over_flies() -> None:
    """Real MAVLink over TCP; only the camera and the network are stand-ins."""
    with FakeAutopilot("ardupilot", "tcp:127.0.0.1:0", parameters={"PRX_FILT": 0.0}) as autopilot:
        settings = make_settings(f"autopilot.endpoint={autopilot.address}", "autopilot.on_loss=hold")
        camera = ScriptedCamera(settings, MonotonicClock(), [picture()], forever=True)
        service = Service(settings, camera=camera, load_perception=sees_a_wall)
        service.start()
        try:
            wait_until(lambda: service.status().link.connected)
            with Pilot(autopilot.address) as pilot:
                pilot.take_off(FLYING_HEIGHT_M)
                pilot.fly_forward(1.5)
                wait_until(lambda: autopilot.truth().velocity_ned_mps[0] > 0.8)
                wait_until(lambda: service.status().mode == "LOITER")
                camera._acts = [CameraError("unplugged")]
                wait_until(lambda: autopilot.truth().mode == "BRAKE")
                wait_until(lambda: abs(autopilot.truth().velocity_ned_mps[0]) < 0.2)
                wait_until(lambda: service.status().link.hold is HoldOutcome.GRANTED)

                pilot.set_mode("LOITER")
                wait_until(lambda: service.status().link.hold is HoldOutcome.OVERRULED)
                taken_over_s = autopilot.truth().time_s
                wait_until(lambda: autopilot.truth().time_s > taken_over_s + 1.5)
                assert autopilot.truth().mode == "LOITER"
        finally:
            service.stop()
