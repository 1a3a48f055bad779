"""The parameters that the fake autopilots have, with the autopilots' own names: those that its models read,
and a few that are only told to who asks."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ARDUPILOT_DEFAULTS: Mapping[str, float] = {
    "ARMING_SKIPCHK": 0,
    "AVOID_BACKUP_SPD": 0.75,
    "AVOID_BEHAVE": 1,
    "AVOID_DIST_MAX": 5.0,
    "AVOID_ENABLE": 7,
    "AVOID_MARGIN": 2.0,
    "GUID_OPTIONS": 0,
    "LOIT_SPEED_MS": 5.0,
    "MAV_SYSID": 1,
    "OA_TYPE": 0,
    "PRX1_MAX": 0,
    "PRX1_MIN": 0,
    "PRX1_ORIENT": 0,
    "PRX1_TYPE": 2,
    "PRX1_YAW_CORR": 0,
    "PRX_FILT": 0.25,
    "PRX_IGN_GND": 0,
    "PRX_LOG_RAW": 1,
    "RNGFND1_ORIENT": 25,
    "RNGFND1_TYPE": 100,
}
"""As in the recorded flights: ArduCopter's own where those left them alone.

AVOID_DIST_MAX, GUID_OPTIONS, OA_TYPE, PRX1_MAX, PRX1_MIN, PRX1_ORIENT, PRX_IGN_GND, PRX_LOG_RAW and
RNGFND1_ORIENT change nothing in the models.
"""

PX4_DEFAULTS: Mapping[str, float] = {
    "CP_DELAY": 0.4,
    "CP_DIST": -1.0,
    "CP_GO_NO_DATA": 0,
    "CP_GUIDE_ANG": 30.0,
    "MAV_SYS_ID": 1,
    "MIS_TAKEOFF_ALT": 2.5,
    "MPC_ACC_HOR": 3.0,
    "MPC_JERK_MAX": 8.0,
    "MPC_POS_MODE": 4,
    "MPC_VEL_MANUAL": 10.0,
}
"""PX4 v1.18's defaults: Collision Prevention is off."""

PX4_WHOLE = frozenset({"CP_GO_NO_DATA", "MAV_SYS_ID", "MPC_POS_MODE"})
"""Parameters that PX4 keeps as INT32 and sends byte by byte inside the float field."""


class UnknownParameterError(KeyError):
    """A parameter that the models do not have."""

    def __str__(self) -> str:
        return str(self.args[0])


class Parameters(Mapping[str, float]):
    """Named numbers, with the two ways that they travel in PARAM_VALUE.

    Raises:
        UnknownParameterError: a name that the flavor does not have is set or read.
    """

    def __init__(self, defaults: Mapping[str, float], whole: frozenset[str] = frozenset()) -> None:
        self._values = dict(sorted(defaults.items()))
        self._whole = whole

    def __getitem__(self, name: str) -> float:
        if name not in self._values:
            raise UnknownParameterError(f"no parameter {name!r}; known: {', '.join(self._values)}")
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def set(self, name: str, value: float) -> None:
        """Change a parameter."""
        if name not in self._values:
            raise UnknownParameterError(f"no parameter {name!r}; known: {', '.join(self._values)}")
        self._values[name] = float(int(value)) if name in self._whole else float(value)

    def set_from_wire(self, name: str, value: float, kind: int) -> None:
        """Change a parameter with the fields of a PARAM_SET."""
        if name in self._whole and kind != mavlink.MAV_PARAM_TYPE_REAL32:
            value = struct.unpack("<i", struct.pack("<f", value))[0]
        self.set(name, value)

    def name_at(self, index: int) -> str | None:
        """Name of the parameter at a PARAM_REQUEST_READ's index."""
        names = list(self._values)
        return names[index] if 0 <= index < len(names) else None

    def message(self, name: str) -> mavlink.MAVLink_param_value_message:
        """The PARAM_VALUE of a parameter."""
        value, kind = self[name], mavlink.MAV_PARAM_TYPE_REAL32
        if name in self._whole:
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
            kind = mavlink.MAV_PARAM_TYPE_INT32
        index = list(self._values).index(name)
        return mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(self._values), index)
