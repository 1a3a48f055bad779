"""Does the autopilot take obstacles, does its mode act on them, and how fast may it fly?"""

from __future__ import annotations

from service.doctor.finding import Finding, Level
from service.doctor.flight_modes import Effect, Evidence, find_mode, modes_that_stop
from service.doctor.observation import ARDUPILOT, PX4, Observation, Plan, Probe
from service.doctor.parameter_names import ESSENTIAL
from service.doctor.safe_speed import reaction_s, safe_speed_mps


def check_parameters_answered(seen: Observation, plan: Plan) -> list[Finding]:
    """Names the parameters that could not be read."""
    if seen.autopilot is None or not seen.unanswered:
        return []
    names = ", ".join(seen.unanswered)
    if not seen.parameters:
        fix = "check that the line works in both directions, and that the autopilot does not ask for signing"
        return [Finding(Level.FAILURE, "parameters", f"none could be read: {names}", fix)]
    level = Level.WARNING if ESSENTIAL & set(seen.unanswered) else Level.NOTE
    fix = "look them up in the ground station: another version may call them otherwise, or lack them"
    return [Finding(level, "parameters", f"no answer about {names}", fix)]


def check_obstacles_arrive(seen: Observation, plan: Plan) -> list[Finding]:
    """What the autopilot makes of OBSTACLE_DISTANCE, as far as it tells."""
    if seen.autopilot == PX4:
        return _px4_tells(seen)
    if seen.autopilot != ARDUPILOT:
        return []
    if seen.echo_faces:
        text = f"the autopilot shows obstacles in {len(seen.echo_faces)} of its 8 directions"
        return [Finding(Level.OK, "echo", text)]
    if seen.proximity_during:
        text = "the autopilot took empty obstacle messages: its proximity became healthy"
        return [Finding(Level.OK, "echo", text)]
    if seen.proximity_before:
        return [Finding(Level.NOTE, "echo", "proximity is healthy already: somebody else sends obstacles")]
    if seen.probe is Probe.SENT and seen.proximity_during is False:
        text = "the autopilot ignored our obstacle messages: its proximity stayed unhealthy"
        fix = "see PRX1_TYPE (a change needs a restart), MAVLink version and signing"
        return [Finding(Level.FAILURE, "echo", text, fix)]
    return [_not_tried(seen)]


def _not_tried(seen: Observation) -> Finding:
    reasons = {
        Probe.ARMED: "the vehicle is armed, and empty messages are sent to a disarmed one only",
        Probe.UNWANTED: "the trial with empty messages was not wanted",
        Probe.OTHER_SENDER: "somebody else sends obstacles",
        Probe.SENT: "the autopilot does not tell its sensors' health (SYS_STATUS)",
        Probe.NO_TIME: "the time was too short",
    }
    reason = reasons.get(seen.probe, "no answer is expected")
    text = f"whether the autopilot takes obstacle messages was not seen: {reason}"
    return Finding(Level.NOTE, "echo", text, "run the doctor disarmed on the ground, without --no-probe")


def _px4_tells(seen: Observation) -> list[Finding]:
    if seen.fused_map:
        text = "PX4 sends its obstacle map: Collision Prevention runs"
        return [Finding(Level.OK, "echo", text)]
    text = "PX4 sends no obstacle map: it does so only in Position mode with Collision Prevention on"
    return [
        Finding(Level.NOTE, "echo", text, "switch to Position mode on the ground and run the doctor again")
    ]


def check_mode(seen: Observation, plan: Plan) -> list[Finding]:
    """Whether the present flight mode acts on obstacles (R16)."""
    if seen.autopilot not in (ARDUPILOT, PX4) or seen.mode is None:
        return []
    bad = Level.WARNING if seen.armed else Level.NOTE
    fix = f"fly in {modes_that_stop(seen.autopilot)}; see docs/flight-modes.md"
    mode = find_mode(seen.autopilot, seen.mode)
    if mode is None:
        text = f"{seen.mode}: nothing is known of obstacles in this mode, so count on nothing"
        return [Finding(bad, "flight mode", text, fix)]
    mark = "" if mode.evidence is Evidence.MEASURED else " (by its source, not flown)"
    text = f"{seen.mode}: {mode.detail}{mark}"
    if mode.effect is Effect.NOTHING:
        return [Finding(bad, "flight mode", f"{text}; obstacles do nothing here", fix)]
    if mode.effect in (Effect.PARTLY, Effect.LEANS):
        return [Finding(Level.NOTE, "flight mode", text, fix)]
    return [Finding(Level.OK, "flight mode", text)]


def check_arming(seen: Observation, plan: Plan) -> list[Finding]:
    """What the autopilot itself says about arming."""
    findings = []
    for text in seen.refusals:
        about_us = "PRX" in text
        fix = "start `uavdepth run`: ArduPilot arms only while obstacle messages come" if about_us else ""
        findings.append(Finding(Level.NOTE, "arming", f"the autopilot says: {text}", fix))
    return findings


def check_speed(seen: Observation, plan: Plan) -> list[Finding]:
    """Largest speed from which the vehicle can stop, against the speed that the stick allows."""
    if seen.autopilot not in (ARDUPILOT, PX4):
        return []
    is_px4 = seen.autopilot == PX4
    margin_name, limit_name = ("CP_DIST", "MPC_VEL_MANUAL") if is_px4 else ("AVOID_MARGIN", "LOIT_SPEED_MS")
    margin_m = seen.parameters.get(margin_name)
    if margin_m is None or margin_m <= 0.0:
        return []
    filter_hz = None if is_px4 else seen.parameters.get("PRX_FILT")
    reaction_time_s = reaction_s(plan.latency_s, filter_hz)
    speed = safe_speed_mps(plan.range_m, margin_m, reaction_time_s)
    text = (
        f"with {plan.range_m:g} m of range and {margin_name} {margin_m:.3g} m a vehicle that brakes with "
        f"1 m/s2 and reacts within {reaction_time_s:.2f} s can stop from {speed:.1f} m/s"
    )
    if plan.latency_s is None:
        text += " (latency not counted)"
    if is_px4:
        text += "; an estimate, PX4 was measured to 6.5 m/s only"
    limit = seen.parameters.get(limit_name)
    if limit is None or limit <= speed:
        return [Finding(Level.OK, "safe speed", text)]
    recommended = float(int(speed * 10.0)) / 10.0
    return [
        Finding(
            Level.WARNING,
            "safe speed",
            f"{text}; {limit_name} allows {limit:.3g}",
            f"set {limit_name} to {recommended:g}, fly slower, or trust a longer range",
            limit_name,
            limit,
            recommended,
        )
    ]
