"""The flights that the tests replay: which part of which log, and where in which rendered world."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FlightPlan:
    """One regression flight.

    Args:
        name: of the record.
        title: what happens in it.
        log: name of the `.tlog`, without ending.
        boots: names of the `.BIN` of each boot in it, without ending.
        start_s, seconds: which part, seconds since the log's first packet.
        scene: rendered world and seed.
        north_m, east_m, height_m: where the vehicle's first position is set down, above bare ground.
        turn_deg: the path and everything said of it are turned by this about that place.
        fps: pictures a second.
    """

    name: str
    title: str
    log: str
    boots: tuple[str, ...]
    start_s: float
    seconds: float
    scene: str
    north_m: float
    east_m: float
    height_m: float
    turn_deg: float
    fps: float = 8.0


_A = "A_hover_and_forward"
_C = "C_s_turns"
_D = "D_reboot_and_link_pause"
_BOOTS_OF_D = (_D, f"{_D}_1")

FLIGHT_PLANS = (
    FlightPlan(
        name="approach-stop",
        title="flies at a facade at 3.3 m/s and stops before it",
        log=_A,
        boots=(_A,),
        start_s=66.0,
        seconds=12.0,
        scene="city:2013",
        north_m=76.81,
        east_m=60.467,
        height_m=4.4,
        turn_deg=36.364,
    ),
    FlightPlan(
        name="free-corridor",
        title="down a free street at 5 m/s",
        log=_C,
        boots=(_C,),
        start_s=156.0,
        seconds=11.0,
        scene="city:2013",
        north_m=-85.182,
        east_m=-16.624,
        height_m=2.628,
        turn_deg=-81.245,
    ),
    FlightPlan(
        name="s-turns",
        title="S-turns at 4 m/s with tilt up to 20 degrees between houses",
        log=_C,
        boots=(_C,),
        start_s=12.0,
        seconds=12.0,
        scene="suburb:2023",
        north_m=42.45,
        east_m=37.546,
        height_m=3.663,
        turn_deg=-111.667,
    ),
    FlightPlan(
        name="hover-yaw",
        title="hovers in front of a wall and yaws both ways at 45 degrees/s",
        log=_C,
        boots=(_C,),
        start_s=80.0,
        seconds=12.0,
        scene="wall:2018",
        north_m=50.49,
        east_m=-34.659,
        height_m=3.865,
        turn_deg=-86.19,
    ),
    FlightPlan(
        name="forest",
        title="rolls and pitches hard, up to 18 degrees, among trees",
        log=_C,
        boots=(_C,),
        start_s=131.0,
        seconds=11.0,
        scene="forest:2020",
        north_m=30.857,
        east_m=3.25,
        height_m=5.818,
        turn_deg=-157.63,
    ),
    FlightPlan(
        name="reboot",
        title="on the ground; the autopilot reboots and its streams are lost until they are asked for again",
        log=_D,
        boots=_BOOTS_OF_D,
        start_s=43.0,
        seconds=12.0,
        scene="suburb:2023",
        north_m=1.244,
        east_m=1.124,
        height_m=0.1,
        turn_deg=-94.97,
        fps=5.0,
    ),
    FlightPlan(
        name="link-loss",
        title="circles; nothing arrives for 5 s, later packets stall for 3 s and arrive in a burst",
        log=_D,
        boots=_BOOTS_OF_D,
        start_s=101.0,
        seconds=20.0,
        scene="park:2023",
        north_m=29.386,
        east_m=3.167,
        height_m=4.221,
        turn_deg=22.694,
        fps=6.0,
    ),
)
"""Places were searched for: clear of everything, with something to see."""
