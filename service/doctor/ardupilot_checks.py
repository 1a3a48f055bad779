"""ArduPilot's parameters for proximity and avoidance; figures measured on ArduCopter 4.8-dev in SITL."""

from __future__ import annotations

from service.doctor.finding import Finding, Level
from service.doctor.judge import judge, number
from service.doctor.observation import ARDUPILOT, Observation, Plan
from service.latency_advice import advise

PROXIMITY_MAVLINK = 2
USE_PROXIMITY_BIT = 2
DOWNWARD = 25
LEAST_FILTER_HZ = 5.0
LEAST_MARGIN_M = 2.0
WPNAV_BIT = 64
_ROUNDING = 1e-3
"""Parameters travel in single precision: 2.6 comes back as 2.5999999."""


def check_ardupilot(seen: Observation, plan: Plan) -> list[Finding]:
    """Everything that an ArduPilot's parameters decide."""
    if seen.autopilot != ARDUPILOT:
        return []
    return [
        *_proximity(seen),
        *_limits(seen, plan),
        *_filter(seen),
        *_avoidance(seen, plan),
        *_path_planning(seen, plan),
        *_rangefinder(seen),
    ]


def _get(seen: Observation, name: str) -> float:
    """The value, or 0 where none came; `judge` says nothing of those."""
    return seen.parameters.get(name, 0.0)


def _proximity(seen: Observation) -> list[Finding]:
    return [
        *judge(
            seen,
            "PRX1_TYPE",
            _get(seen, "PRX1_TYPE") == PROXIMITY_MAVLINK,
            Level.FAILURE,
            "the autopilot does not look at OBSTACLE_DISTANCE, so nothing shows and nothing stops",
            PROXIMITY_MAVLINK,
            "set PRX1_TYPE to 2 (MAVLink) and restart the autopilot",
            "2: proximity comes from MAVLink",
        ),
        *judge(
            seen,
            "PRX1_ORIENT",
            _get(seen, "PRX1_ORIENT") == 0,
            Level.FAILURE,
            "directions are turned round: obstacles on the right show on the left",
            0,
        ),
        *judge(
            seen,
            "PRX1_YAW_CORR",
            _get(seen, "PRX1_YAW_CORR") == 0,
            Level.FAILURE,
            "it is added to every direction: obstacles stand in the wrong place",
            0,
        ),
        *judge(
            seen,
            "PRX_IGN_GND",
            _get(seen, "PRX_IGN_GND") == 0,
            Level.WARNING,
            "readings near the ground are dropped; the service has removed the ground already",
            0,
        ),
        *judge(
            seen,
            "PRX_LOG_RAW",
            _get(seen, "PRX_LOG_RAW") == 1,
            Level.NOTE,
            "a flight log will not show what arrived",
            1,
        ),
    ]


def _limits(seen: Observation, plan: Plan) -> list[Finding]:
    nearest, farthest = _get(seen, "PRX1_MIN"), _get(seen, "PRX1_MAX")
    return [
        *judge(
            seen,
            "PRX1_MIN",
            nearest <= 0.0,
            Level.WARNING,
            f"obstacles nearer than {number(nearest)} m vanish; ours begin at {plan.nearest_m:g} m",
            0,
        ),
        *judge(
            seen,
            "PRX1_MAX",
            farthest == 0.0,
            Level.WARNING,
            f"obstacles beyond {number(farthest)} m vanish; ours reach to {plan.range_m:g} m",
            0,
        ),
    ]


def _filter(seen: Observation) -> list[Finding]:
    value = _get(seen, "PRX_FILT")
    return judge(
        seen,
        "PRX_FILT",
        value <= 0.0 or value >= LEAST_FILTER_HZ,
        Level.WARNING,
        "this low-pass, in hertz, eats the margin: at 3.3 m/s with a margin of 2 m and the default of 0.25 "
        "the copter came to 1.16 m instead of 2.15 m",
        0,
        "set PRX_FILT to 0 (off), or to 5 or more",
    )


def _avoidance(seen: Observation, plan: Plan) -> list[Finding]:
    enabled = int(_get(seen, "AVOID_ENABLE"))
    findings = judge(
        seen,
        "AVOID_ENABLE",
        bool(enabled & USE_PROXIMITY_BIT),
        Level.FAILURE,
        "avoidance does not use proximity, so nothing stops",
        enabled | 3 if enabled > 0 else 3,
        "set AVOID_ENABLE to 3 or 7",
        f"{enabled}: avoidance uses proximity",
    )
    findings += _margin(seen, plan)
    findings += judge(
        seen,
        "AVOID_BEHAVE",
        _get(seen, "AVOID_BEHAVE") == 1,
        Level.NOTE,
        "the copter slides along obstacles instead of stopping",
        1,
    )
    reach_m = _get(seen, "AVOID_DIST_MAX")
    findings += judge(
        seen,
        "AVOID_DIST_MAX",
        reach_m > 0.0,
        Level.NOTE,
        "ALT_HOLD does not lean away from anything",
        5,
        fine_text=f"ALT_HOLD leans away from what is nearer than {number(reach_m)} m",
    )
    return findings


def _margin(seen: Observation, plan: Plan) -> list[Finding]:
    margin_m, latency_s = _get(seen, "AVOID_MARGIN"), plan.latency_s or 0.0
    wanted_m = max(LEAST_MARGIN_M, advise(1000.0 * latency_s, plan.range_m).margin_m)
    if margin_m >= plan.range_m:
        level, text = Level.FAILURE, f"the margin is not inside the range of {plan.range_m:g} m"
    elif margin_m < LEAST_MARGIN_M:
        level, text = Level.WARNING, "metres of margin are few: the copter may overshoot"
    else:
        level = Level.NOTE
        text = (
            f"what comes into view within the latency of {latency_s:.3g} s takes up to "
            f"{wanted_m - LEAST_MARGIN_M:.1f} m of it, at the greatest speed from which the copter can stop"
        )
    return judge(
        seen,
        "AVOID_MARGIN",
        wanted_m - _ROUNDING <= margin_m < plan.range_m,
        level,
        text,
        wanted_m,
    )


def _path_planning(seen: Observation, plan: Plan) -> list[Finding]:
    if "OA_TYPE" not in seen.parameters:
        return []
    kind = seen.parameters["OA_TYPE"]
    if kind == 0:
        text = "is 0: AUTO, RTL and GUIDED position targets fly through obstacles"
        fix = (
            "stay in LOITER or GUIDED velocity, or see BendyRuler: OA_TYPE 1, OA_DB_SIZE 500, OA_DB_EXPIRE 2"
        )
        return [Finding(Level.NOTE, "OA_TYPE", text, fix, "OA_TYPE", kind)]
    options = seen.parameters.get("GUID_OPTIONS")
    text = f"is {number(kind)}: AUTO and RTL plan round obstacles"
    if kind == 1 and options is not None and not int(options) & WPNAV_BIT:
        text += "; GUIDED position targets do not (one flew straight through a reported pillar)"
        fix = f"set GUID_OPTIONS to {int(options) | WPNAV_BIT} (bit 6)"
        return [
            Finding(Level.WARNING, "OA_TYPE", text, fix, "GUID_OPTIONS", options, int(options) | WPNAV_BIT)
        ]
    if not plan.sends_3d:
        text += (
            "; but it tilts OBSTACLE_DISTANCE by the attitude: 30 degrees nose-down stores an obstacle 10 m "
            "ahead 5 m too low"
        )
        fix = "set [autopilot] obstacle_points to true"
        return [Finding(Level.WARNING, "OA_TYPE", text, fix, "OA_TYPE", kind, kind)]
    return [Finding(Level.OK, "OA_TYPE", text, "", "OA_TYPE", kind, kind)]


def _rangefinder(seen: Observation) -> list[Finding]:
    if seen.parameters.get("RNGFND1_TYPE") == 0:
        text = "is 0: no rangefinder is set up, and depth loses its surest scale"
        fix = "set RNGFND1_TYPE to your sensor's type and RNGFND1_ORIENT to 25"
        return [Finding(Level.WARNING, "RNGFND1_TYPE", text, fix, "RNGFND1_TYPE", 0.0)]
    return judge(
        seen,
        "RNGFND1_ORIENT",
        _get(seen, "RNGFND1_ORIENT") == DOWNWARD,
        Level.WARNING,
        "the first rangefinder does not look down; height is taken from a downward one only",
        DOWNWARD,
        "set RNGFND1_ORIENT to 25, unless another RNGFNDn looks down",
        "25: the rangefinder looks down",
    )
