"""What obstacle messages do in each flight mode: the table of docs/flight-modes.md."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from service.doctor.observation import ARDUPILOT, PX4


class Effect(StrEnum):
    """What obstacle messages do."""

    STOPS = "stops"
    """The speed towards obstacles is limited, down to a stop."""

    LEANS = "leans away"
    """The vehicle leans away from near obstacles; its speed is not limited."""

    PARTLY = "partly"
    """With some commands of the mode."""

    NOTHING = "nothing"
    """The vehicle flies into the obstacle."""


class Evidence(StrEnum):
    """How that is known."""

    MEASURED = "measured"
    """Flown in the autopilot's simulator."""

    DOCUMENTED = "documented"
    """Read in its source or documentation, not flown."""


@dataclass(frozen=True)
class FlightMode:
    """One row.

    Args:
        autopilot: "ardupilot" or "px4".
        name: as pilots know it.
        reported: names that HEARTBEAT's mode is decoded to.
        effect: what obstacle messages do.
        detail: under which conditions, in one sentence.
        evidence: how that is known.
        version: of the autopilot for which it is known.
    """

    autopilot: str
    name: str
    reported: tuple[str, ...]
    effect: Effect
    detail: str
    evidence: Evidence
    version: str


_COPTER, _PX4 = "4.8-dev", "1.18, 1.15.4"

FLIGHT_MODES = (
    FlightMode(
        ARDUPILOT,
        "LOITER",
        ("LOITER",),
        Effect.STOPS,
        "stops at AVOID_MARGIN, or slides along with AVOID_BEHAVE 0",
        Evidence.MEASURED,
        _COPTER,
    ),
    FlightMode(
        ARDUPILOT,
        "GUIDED",
        ("GUIDED",),
        Effect.PARTLY,
        "velocity targets are limited, position targets are not (they need OA_TYPE 1 and GUID_OPTIONS 64)",
        Evidence.MEASURED,
        _COPTER,
    ),
    FlightMode(
        ARDUPILOT,
        "ALT_HOLD, FLOWHOLD",
        ("ALT_HOLD", "FLOWHOLD"),
        Effect.LEANS,
        "leans away from what is nearer than AVOID_DIST_MAX (5 m)",
        Evidence.DOCUMENTED,
        _COPTER,
    ),
    FlightMode(
        ARDUPILOT,
        "AUTO",
        ("AUTO",),
        Effect.NOTHING,
        "not limited; needs OA_TYPE",
        Evidence.DOCUMENTED,
        _COPTER,
    ),
    FlightMode(
        ARDUPILOT,
        "RTL",
        ("RTL",),
        Effect.NOTHING,
        "not limited; needs OA_TYPE",
        Evidence.DOCUMENTED,
        _COPTER,
    ),
    FlightMode(
        PX4,
        "Position",
        ("POSCTL",),
        Effect.STOPS,
        "Collision Prevention with CP_DIST above 0 and MPC_POS_MODE 4 on 1.18, 0 on 1.15.4",
        Evidence.MEASURED,
        _PX4,
    ),
    FlightMode(PX4, "Altitude", ("ALTCTL",), Effect.NOTHING, "not looked at", Evidence.DOCUMENTED, "1.18"),
    FlightMode(PX4, "Mission", ("MISSION",), Effect.NOTHING, "not looked at", Evidence.DOCUMENTED, "1.18"),
    FlightMode(PX4, "Return", ("RTL",), Effect.NOTHING, "not looked at", Evidence.DOCUMENTED, "1.18"),
    FlightMode(PX4, "Offboard", ("OFFBOARD",), Effect.NOTHING, "not looked at", Evidence.DOCUMENTED, "1.18"),
    FlightMode(
        PX4,
        "Land",
        ("LAND",),
        Effect.PARTLY,
        "only while the sticks nudge the automatic landing",
        Evidence.DOCUMENTED,
        "1.18",
    ),
)


def find_mode(autopilot: str, reported: str) -> FlightMode | None:
    """The row of a mode as HEARTBEAT told it, or None if nothing is known of it."""
    for mode in FLIGHT_MODES:
        if mode.autopilot == autopilot and reported in mode.reported:
            return mode
    return None


def modes_that_stop(autopilot: str) -> str:
    """Names of the modes in which a vehicle stops, for a sentence."""
    stopping = [
        mode.name
        for mode in FLIGHT_MODES
        if mode.autopilot == autopilot
        and mode.effect in (Effect.STOPS, Effect.PARTLY)
        and mode.name != "Land"
    ]
    return " or ".join(stopping)
