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


_A = ("A_hover_and_forward", ("A_hover_and_forward",))
_C = ("C_s_turns", ("C_s_turns",))
_D = ("D_reboot_and_link_pause", ("D_reboot_and_link_pause", "D_reboot_and_link_pause_1"))

FLIGHT_PLANS: tuple[FlightPlan, ...] = ()
