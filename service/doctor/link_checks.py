"""Is there an autopilot, and does it speak a MAVLink that obstacles can travel in?"""

from __future__ import annotations

from service.autopilot.byte_budget import LEAST_RATE_HZ, OBSTACLE_BYTES, obstacle_rate_hz
from service.autopilot.endpoint import SerialEndpoint, TcpEndpoint, UdpListenEndpoint, parse_endpoint
from service.autopilot.signing import Verdict
from service.doctor.finding import Finding, Level
from service.doctor.observation import Observation, Plan

BITS_PER_BYTE = 10
"""8N1: a start and a stop bit."""

SAFE_BAUD = 115_200


def check_heartbeat(seen: Observation, plan: Plan) -> list[Finding]:
    """Whether an autopilot is heard, and if not, where to look."""
    if seen.autopilot is not None and seen.line_error is not None:
        text = (
            f"{seen.autopilot}, system {seen.system_id}, was heard, then the line was lost: {seen.line_error}"
        )
        return [Finding(Level.FAILURE, "heartbeat", text, _how_to_open(seen.endpoint))]
    if seen.autopilot is not None:
        version = "" if seen.version is None else " " + ".".join(map(str, seen.version))
        text = f"{seen.autopilot}{version}, system {seen.system_id}, is heard on {seen.endpoint}"
        if seen.profile is not None:
            text += f"; obstacles go out in the layout {seen.profile}"
        return [Finding(Level.OK, "heartbeat", text)]
    if seen.line_error is not None:
        text = f"{seen.endpoint} cannot be used: {seen.line_error}"
        return [Finding(Level.FAILURE, "heartbeat", text, _how_to_open(seen.endpoint))]
    if seen.other_system_ids:
        others = ", ".join(str(number) for number in seen.other_system_ids)
        text = f"no HEARTBEAT of system {plan.system_id} came, but those of {others} did"
        fix = "set [autopilot] system_id to the vehicle's, or to 0 to take the first one"
        return [Finding(Level.FAILURE, "heartbeat", text, fix)]
    if seen.refused_packets:
        return [_refused(seen)]
    if seen.bytes_received == 0:
        text = f"nothing at all came on {seen.endpoint} in {seen.seconds:.0f} s"
        return [Finding(Level.FAILURE, "heartbeat", text, _how_to_be_heard(seen.endpoint))]
    if seen.bad_bytes * 2 > seen.bytes_received:
        text = f"{seen.bytes_received} bytes came, and {seen.bad_bytes} of them are no MAVLink"
        fix = "give the baud rate that the autopilot's port has, and check that the port speaks MAVLink 2"
        return [Finding(Level.FAILURE, "heartbeat", text, fix)]
    text = f"MAVLink came on {seen.endpoint}, but no autopilot's HEARTBEAT"
    fix = "connect to the autopilot itself, or let the router pass its HEARTBEAT on"
    return [Finding(Level.FAILURE, "heartbeat", text, fix)]


def check_protocol(seen: Observation, plan: Plan) -> list[Finding]:
    """MAVLink 2, in which alone OBSTACLE_DISTANCE exists (R15)."""
    if seen.autopilot is None:
        return []
    if not seen.mavlink1:
        return [Finding(Level.OK, "MAVLink version", "the autopilot speaks MAVLink 2")]
    return [
        Finding(
            Level.FAILURE,
            "MAVLink version",
            "the autopilot speaks MAVLink 1, in which OBSTACLE_DISTANCE does not exist",
            "set SERIALn_PROTOCOL of this port to 2 (ArduPilot) or MAV_PROTO_VER to 2 (PX4)",
        )
    ]


def check_signing(seen: Observation, plan: Plan) -> list[Finding]:
    """Signed frames mean that ours must be signed too."""
    if not seen.signed:
        return []
    if plan.signs or seen.proximity_during:
        return [Finding(Level.OK, "signing", "the autopilot signs its messages, and takes ours")]
    return [
        Finding(
            Level.FAILURE,
            "signing",
            "the autopilot signs its messages: an unsigned OBSTACLE_DISTANCE is ignored without a word "
            "(but on ArduPilot's first port, SERIAL0)",
            "give the vehicle's key in [autopilot] signing_key_file, or switch signing off on the vehicle",
        )
    ]


def check_budget(seen: Observation, plan: Plan) -> list[Finding]:
    """Whether the line carries the messages at the wanted rate and in time (R22)."""
    if not plan.bytes_per_s:
        return []
    place = parse_endpoint(seen.endpoint)
    baud = place.baud if isinstance(place, SerialEndpoint) else None
    carried_hz = obstacle_rate_hz(plan.rate_hz, plan.bytes_per_s)
    text = f"{plan.bytes_per_s} bytes/s carry {carried_hz:.1f} obstacle messages/s of {plan.rate_hz:g} wanted"
    fix = "raise [autopilot] bytes_per_s"
    if baud is not None:
        text += f"; each takes {1000.0 * OBSTACLE_BYTES * BITS_PER_BYTE / baud:.0f} ms at {baud} baud"
        fix = f"set SERIALn_BAUD and the endpoint to {SAFE_BAUD} or more, 921600 if the cable allows"
    if carried_hz < LEAST_RATE_HZ:
        return [Finding(Level.FAILURE, "byte budget", f"{text}: too few to stop in time", fix)]
    if carried_hz < plan.rate_hz or (baud is not None and baud < SAFE_BAUD):
        return [Finding(Level.WARNING, "byte budget", f"{text}, which adds to the latency", fix)]
    return [Finding(Level.OK, "byte budget", text)]


def check_clock(seen: Observation, plan: Plan) -> list[Finding]:
    """Jumps of the autopilot's time since boot while it was watched."""
    if seen.reboots:
        text = f"the autopilot restarted {seen.reboots} time(s) while it was watched"
        return [
            Finding(Level.WARNING, "clock", text, "look after its power supply, then run the doctor again")
        ]
    if seen.clock_steps:
        text = f"the autopilot's time since boot jumped {seen.clock_steps} time(s)"
        fix = "attitude cannot be matched to pictures across a jump: look for two autopilots on one link"
        return [Finding(Level.WARNING, "clock", text, fix)]
    if seen.autopilot is None:
        return []
    return [Finding(Level.OK, "clock", "the autopilot's time runs steadily")]


def check_others(seen: Observation, plan: Plan) -> list[Finding]:
    """Other autopilots on the same line."""
    if seen.autopilot is None or not seen.other_system_ids:
        return []
    others = ", ".join(str(number) for number in seen.other_system_ids)
    text = f"other autopilots are heard too: system {others}; obstacles go to system {seen.system_id} only"
    return [Finding(Level.WARNING, "other vehicles", text, "set [autopilot] system_id to this vehicle's")]


def _refused(seen: Observation) -> Finding:
    """Packets came, and none was believed: their signatures do not fit the key."""
    reasons = {
        Verdict.UNSIGNED.value: (
            "the autopilot's packets are not signed, and only signed ones are believed",
            "set the key up on the autopilot (SETUP_SIGNING), or leave [autopilot] signing_key_file empty",
        ),
        Verdict.WRONG.value: (
            "the autopilot's packets are signed with another key than ours",
            "give [autopilot] signing_key_file the key that the autopilot has",
        ),
    }
    most = max(seen.refused_packets, key=lambda reason: seen.refused_packets[reason])
    text, fix = reasons.get(
        most,
        ("the autopilot's packets carry old time stamps", "look for a replay, or set its signing up anew"),
    )
    return Finding(Level.FAILURE, "heartbeat", text, fix)


def _how_to_open(endpoint: str) -> str:
    place = parse_endpoint(endpoint)
    if isinstance(place, SerialEndpoint):
        return f"check the device {place.device}, its cable, and your right to open it (group dialout)"
    if isinstance(place, TcpEndpoint):
        return f"check that the autopilot or router listens on {place}"
    return "check the address, and that no other program has the port"


def _how_to_be_heard(endpoint: str) -> str:
    place = parse_endpoint(endpoint)
    if isinstance(place, SerialEndpoint):
        return (
            "check that TX and RX are crossed, that the port's SERIALn_PROTOCOL is 2 (PX4: MAV_n_CONFIG), "
            f"and that its baud rate is {place.baud}"
        )
    if isinstance(place, UdpListenEndpoint):
        return f"let the autopilot or router send to this computer's port {place.port}"
    return "check that the other end is an autopilot or a MAVLink router, and that it is running"


def check_latency(seen: Observation, plan: Plan) -> list[Finding]:
    """The latency that the other checks count with, and where it comes from (R9)."""
    if seen.autopilot is None:
        return []
    if plan.latency_s is not None:
        text = f"{plan.latency_s:.3g} s from capture to the line, {plan.latency_source}"
        return [Finding(Level.OK, "latency", text)]
    text = f"not known: {plan.latency_source}; what follows counts with none"
    fix = "start `uavdepth run` and name its Zenoh endpoint with --connect, or give --latency"
    return [Finding(Level.NOTE, "latency", text, fix)]
