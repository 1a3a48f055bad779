"""Recommended parameters as a file that a ground station loads; the vehicle itself is never written to."""

from __future__ import annotations

from collections.abc import Iterable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.doctor.finding import Finding
from service.doctor.judge import number
from service.doctor.observation import PX4, Observation

_PX4_WHOLE = frozenset({"CP_GO_NO_DATA", "MAV_SYS_ID", "MPC_POS_MODE"})
_HEADER = (
    "Recommended by uavdepth doctor. Read each line before you load it; nothing was written to the vehicle."
)


def parameter_file(findings: Iterable[Finding], seen: Observation) -> str:
    """The file's text.

    Parameters to change are lines that a ground station loads; those that are right already, and those
    that are a choice of yours, are comments. ArduPilot: `NAME,VALUE` (.param). PX4: QGroundControl's
    tab-separated `vehicle component name value type` (.params).
    """
    lines = [f"# {_HEADER}"]
    if seen.autopilot == PX4:
        lines.append("# Vehicle-Id Component-Id Name Value Type")
    told: set[str] = set()
    for finding in findings:
        name = finding.parameter
        if name is None or name in told:
            continue
        told.add(name)
        if finding.recommended is None:
            lines += [f"# {name}: {_one_line(finding.text)}. {_one_line(finding.fix)}"]
        elif finding.recommended == finding.value:
            lines += [f"# {name} is {number(finding.recommended)} already"]
        else:
            lines += [f"# {name} {_one_line(finding.text)}", _line(name, finding.recommended, seen)]
    for name in seen.unanswered:
        lines.append(f"# {name} was not answered")
    return "\n".join(lines) + "\n"


def _line(name: str, value: float, seen: Observation) -> str:
    if seen.autopilot != PX4:
        return f"{name},{number(value)}"
    kind = mavlink.MAV_PARAM_TYPE_INT32 if name in _PX4_WHOLE else mavlink.MAV_PARAM_TYPE_REAL32
    return f"{seen.system_id}\t{mavlink.MAV_COMP_ID_AUTOPILOT1}\t{name}\t{number(value)}\t{kind}"


def _one_line(text: str) -> str:
    return " ".join(text.split())
