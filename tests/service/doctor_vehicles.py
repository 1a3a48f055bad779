"""Vehicles as the doctor sees them, and what it finds wrong."""

from __future__ import annotations

from dataclasses import replace

from service.doctor.checks import examine
from service.doctor.finding import Finding, Level
from service.doctor.observation import Observation, Plan, Probe

PLAN = Plan(wanted_hz={"ATTITUDE": 50.0, "LOCAL_POSITION_NED": 30.0, "DISTANCE_SENSOR": 20.0}, latency_s=0.1)
GOOD_RATES = {"ATTITUDE": 49.4, "LOCAL_POSITION_NED": 28.7, "DISTANCE_SENSOR": 19.3}
COPTER = Observation(
    endpoint="serial:/dev/ttyAMA0:921600",
    bytes_received=30_000,
    autopilot="ardupilot",
    version=(4, 8, 0),
    system_id=1,
    mode="LOITER",
    armed=False,
    rates_hz=GOOD_RATES,
    rangefinder_hz=19.3,
    rangefinder_m=0.1,
    parameters={
        "PRX1_TYPE": 2,
        "PRX1_ORIENT": 0,
        "PRX1_YAW_CORR": 0,
        "PRX1_MIN": 0,
        "PRX1_MAX": 0,
        "PRX_IGN_GND": 0,
        "PRX_FILT": 5.0,
        "PRX_LOG_RAW": 1,
        "AVOID_ENABLE": 7,
        "AVOID_MARGIN": 2.0,
        "AVOID_BEHAVE": 1,
        "AVOID_DIST_MAX": 5.0,
        "OA_TYPE": 0,
        "GUID_OPTIONS": 0,
        "RNGFND1_TYPE": 100,
        "RNGFND1_ORIENT": 25,
        "LOIT_SPEED_MS": 5.0,
    },
    probe=Probe.SENT,
    proximity_before=False,
    proximity_during=True,
)


PX4 = replace(
    COPTER,
    autopilot="px4",
    version=(1, 18, 0),
    mode="POSCTL",
    parameters={
        "CP_DIST": 5.0,
        "CP_DELAY": 0.4,
        "CP_GO_NO_DATA": 0,
        "MPC_POS_MODE": 4,
        "MAV_SYS_ID": 1,
        "MPC_VEL_MANUAL": 5.0,
    },
    probe=Probe.NO_ANSWER_EXPECTED,
    proximity_before=True,
    proximity_during=None,
    fused_map=True,
)


def with_parameters(seen: Observation, **changes: float) -> Observation:
    return replace(seen, parameters={**seen.parameters, **changes})


def about(topic: str, seen: Observation, plan: Plan = PLAN) -> Finding:
    (found,) = [finding for finding in examine(seen, plan) if finding.topic == topic]
    return found


def bad(seen: Observation, plan: Plan = PLAN) -> list[str]:
    return [f.topic for f in examine(seen, plan) if f.level in (Level.WARNING, Level.FAILURE)]
