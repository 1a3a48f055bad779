"""How the link is doing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from service.autopilot.hold_request import HoldOutcome


@dataclass(frozen=True)
class LinkStatus:
    """The state of the link at one moment.

    Args:
        endpoint: where the autopilot is looked for.
        connected: the line is open and the autopilot was heard lately.
        line_open: socket or port is open, whoever is at the other end.
        system_id: the vehicle's, or None before it was learnt.
        autopilot: "ardupilot", "px4", ... or None.
        profile: layout of OBSTACLE_DISTANCE that is sent: "ardupilot", "px4", "px4-legacy", or None.
        mode, armed: by the newest HEARTBEAT, or None.
        heartbeat_age_s: seconds since it, or None.
        mavlink1_seen: the autopilot speaks MAVLink 1 now, in which there is no OBSTACLE_DISTANCE.
        rates_hz: messages a second by name, over two seconds.
        reboots, clock_steps, line_losses: since the start.
        clock_synced: round trips bind the autopilot's clock to ours.
        clock_offset_s: our clock minus the autopilot's, seconds, or None.
        clock_width_s: width of the bracket that the offset lies in, seconds, or None.
        sent_obstacles: scans handed to the line.
        obstacle_rate_hz: the same a second, over two seconds.
        obstacle_rate_limit_hz: the most that is sent a second: what was wanted, or what the line carries.
        obstacle_delay_ms: half and 19 of 20 scans left within so many milliseconds of their capture; None
            before the first.
        transport_ms: how long a message is under way to the autopilot, learnt; milliseconds.
        not_made_good: scans whose turn or way since capture was not known; without attitude nothing in
            them was clear.
        byte_budget_per_s: bytes a second that the line may carry; 0 for no limit.
        dropped_messages: messages that found no room on the line before they were too old.
        refused_obstacles: scans that were not sent, by reason.
        bytes_in_per_s, bytes_out_per_s: over two seconds.
        bad_bytes: bytes that belonged to no MAVLink frame.
        signed: our packets are signed, and only signed ones are believed.
        refused_packets: packets that were not believed, by what was wrong with their signature.
        other_system_ids: other autopilots that were heard and not listened to.
        hold: what has become of the last request to stop and stay; None if there was none.
        problem: what is wrong, fit to show a user; None if nothing is.
    """

    endpoint: str
    connected: bool = False
    line_open: bool = False
    system_id: int | None = None
    autopilot: str | None = None
    profile: str | None = None
    mode: str | None = None
    armed: bool | None = None
    heartbeat_age_s: float | None = None
    mavlink1_seen: bool = False
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    reboots: int = 0
    clock_steps: int = 0
    line_losses: int = 0
    clock_synced: bool = False
    clock_offset_s: float | None = None
    clock_width_s: float | None = None
    sent_obstacles: int = 0
    obstacle_rate_hz: float = 0.0
    obstacle_rate_limit_hz: float = 0.0
    obstacle_delay_ms: tuple[float, float] | None = None
    transport_ms: float = 0.0
    not_made_good: int = 0
    byte_budget_per_s: int = 0
    dropped_messages: int = 0
    refused_obstacles: Mapping[str, int] = field(default_factory=dict)
    bytes_in_per_s: float = 0.0
    bytes_out_per_s: float = 0.0
    bad_bytes: int = 0
    signed: bool = False
    refused_packets: Mapping[str, int] = field(default_factory=dict)
    other_system_ids: tuple[int, ...] = ()
    hold: HoldOutcome | None = None
    problem: str | None = None
