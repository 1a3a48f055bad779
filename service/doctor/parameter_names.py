"""Which parameters are read from which autopilot."""

from __future__ import annotations

from service.doctor.observation import ARDUPILOT, PX4

_ARDUPILOT = (
    "PRX1_TYPE",
    "AVOID_ENABLE",
    "AVOID_MARGIN",
    "AVOID_BEHAVE",
    "AVOID_DIST_MAX",
    "PRX1_ORIENT",
    "PRX1_YAW_CORR",
    "PRX1_MIN",
    "PRX1_MAX",
    "PRX_IGN_GND",
    "PRX_FILT",
    "PRX_LOG_RAW",
    "OA_TYPE",
    "GUID_OPTIONS",
    "RNGFND1_TYPE",
    "RNGFND1_ORIENT",
    "LOIT_SPEED_MS",
)
_PX4 = ("CP_DIST", "CP_DELAY", "CP_GO_NO_DATA", "MPC_POS_MODE", "MAV_SYS_ID", "MPC_VEL_MANUAL")

PARAMETERS = {ARDUPILOT: _ARDUPILOT, PX4: _PX4}

ESSENTIAL = frozenset({"PRX1_TYPE", "AVOID_ENABLE", "CP_DIST", "MPC_POS_MODE"})
"""Without these nothing can be said about whether the vehicle stops."""
