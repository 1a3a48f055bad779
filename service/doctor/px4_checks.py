"""PX4's parameters for Collision Prevention; figures measured on 1.18 and 1.15.4 in SITL."""

from __future__ import annotations

from service.doctor.finding import Finding, Level
from service.doctor.judge import judge, number
from service.doctor.observation import PX4, Observation, Plan

LEAST_CP_DIST_M = 3.0
DELAY_EXTRA_S = (0.2, 0.3, 0.4)
"""CP_DELAY above the measured latency: least, recommended, most."""

HOLD_SYSTEM_ID = 1
NEW, OLD = (1, 18), (1, 15)
"""Versions that were measured."""


def check_px4(seen: Observation, plan: Plan) -> list[Finding]:
    """Everything that a PX4's parameters decide."""
    if seen.autopilot != PX4:
        return []
    return [
        *_distance(seen, plan),
        *_delay(seen, plan),
        *_without_data(seen),
        *_position_mode(seen),
        *_system_id(seen),
    ]


def recommended_delay_s(latency_s: float) -> float:
    """CP_DELAY for a measured latency, in seconds."""
    return round(latency_s + DELAY_EXTRA_S[1], 2)


def _distance(seen: Observation, plan: Plan) -> list[Finding]:
    value = seen.parameters.get("CP_DIST", 0.0)
    fine = LEAST_CP_DIST_M <= value < plan.range_m
    if value <= 0.0:
        level, text = Level.FAILURE, "Collision Prevention is off, so nothing stops"
    elif value >= plan.range_m:
        level, text = Level.FAILURE, f"the distance kept is not inside the range of {plan.range_m:g} m"
    else:
        level = Level.WARNING
        text = "little is kept: 0.8 m of it were lost at 6 m/s, and more with latency"
    return judge(
        seen,
        "CP_DIST",
        fine,
        level,
        text,
        LEAST_CP_DIST_M,
        "set CP_DIST to 3 or more",
        f"{number(value)} m are kept",
    )


def _delay(seen: Observation, plan: Plan) -> list[Finding]:
    if "CP_DELAY" not in seen.parameters:
        return []
    value = seen.parameters["CP_DELAY"]
    if plan.latency_s is None:
        text = f"is {number(value)} s; right is the measured latency and 0.2 to 0.4 s"
        fix = "run the doctor beside `uavdepth run`, or give the latency of `uavdepth watch` with --latency"
        return [Finding(Level.NOTE, "CP_DELAY", text, fix, "CP_DELAY", value)]
    low, best, high = (plan.latency_s + extra for extra in DELAY_EXTRA_S)
    level = Level.WARNING if value < low else Level.NOTE
    return judge(
        seen,
        "CP_DELAY",
        low - 1e-3 <= value <= high + 1e-3,
        level,
        f"with a latency of {plan.latency_s:g} s it should be {low:.2f} to {high:.2f} s",
        round(best, 2),
    )


def _without_data(seen: Observation) -> list[Finding]:
    if "CP_GO_NO_DATA" not in seen.parameters:
        return []
    value = seen.parameters["CP_GO_NO_DATA"]
    if value:
        text = "is 1: the vehicle also flies where nothing was ever seen, as outside the camera's view"
        fix = "choose: 0 never flies where nothing is known, but then a stick to the side does nothing"
    else:
        text = (
            "is 0: the vehicle never flies where nothing is known, so not sideways out of the camera's view"
        )
        fix = "choose: 1 flies there"
    return [Finding(Level.NOTE, "CP_GO_NO_DATA", text, fix, "CP_GO_NO_DATA", value)]


def _position_mode(seen: Observation) -> list[Finding]:
    if "MPC_POS_MODE" not in seen.parameters:
        return []
    value = seen.parameters["MPC_POS_MODE"]
    if seen.version is None:
        text = (
            f"is {number(value)}, and the autopilot does not tell its version: 4 is right on 1.18, 0 on 1.15 "
            "(with 4, 1.15.4 flew through the wall at 8.4 m/s without a word)"
        )
        fix = "look the version up in the ground station, and set MPC_POS_MODE to 4 or 0"
        return [Finding(Level.WARNING, "MPC_POS_MODE", text, fix, "MPC_POS_MODE", value)]
    minor = seen.version[:2]
    told = f"PX4 {minor[0]}.{minor[1]}"
    if minor <= OLD:
        text = "Collision Prevention does nothing with it on 1.15: it flew through the wall without a word"
        return judge(seen, "MPC_POS_MODE", value == 0, Level.FAILURE, text, 0, "", f"0: right on {told}")
    if minor < NEW:
        text = f"is {number(value)}; what is right on {told} was not measured: 4 is on 1.18, 0 on 1.15"
        fix = "try it in the simulator of your version first"
        return [Finding(Level.WARNING, "MPC_POS_MODE", text, fix, "MPC_POS_MODE", value)]
    text = f"Collision Prevention on {told} was measured with 4 only"
    return judge(seen, "MPC_POS_MODE", value == 4, Level.WARNING, text, 4, "", f"4: right on {told}")


def _system_id(seen: Observation) -> list[Finding]:
    return judge(
        seen,
        "MAV_SYS_ID",
        seen.parameters.get("MAV_SYS_ID") == HOLD_SYSTEM_ID,
        Level.WARNING,
        "when obstacle data stop, PX4 asks system 1 for Hold: with another id the vehicle stays in Position",
        HOLD_SYSTEM_ID,
    )
