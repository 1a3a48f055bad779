"""The conversation with an autopilot, without sockets, threads or a clock of its own."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.byte_budget import bytes_per_s_of
from service.autopilot.connection import Connection
from service.autopilot.framing import is_mavlink1
from service.autopilot.link_status import LinkStatus
from service.autopilot.link_watch import LinkWatch
from service.autopilot.motion_history import MotionLimits
from service.autopilot.notices import Notice, Notices, Problem
from service.autopilot.obstacle_gate import Refusal
from service.autopilot.obstacle_output import ObstacleOutput
from service.autopilot.outbox import Outbox
from service.autopilot.packet_trust import PacketTrust
from service.autopilot.presence import Presence
from service.autopilot.profile_choice import ProfileChoice
from service.autopilot.rate_meter import RateMeter
from service.autopilot.requests import Requests
from service.autopilot.service_state import ServiceState
from service.autopilot.signing import Signing
from service.autopilot.signing_key import SigningKey
from service.autopilot.sources import Sources
from service.autopilot.status_text import StatusTexts
from service.autopilot.telemetry_tracker import TelemetryTracker
from service.autopilot.timesync import RoundTrip
from service.autopilot.transport_delay import TransportDelay
from service.autopilot.vehicle import Hearing, VehicleLearner
from service.settings.autopilot import AutopilotSettings
from service.telemetry import Telemetry
from uavdepth.scan.obstacle_scan import ObstacleScan

_SHORT_LIVED_NS = 1_000_000_000
"""A HEARTBEAT, TIMESYNC or request that could not leave for a second is made anew."""

_TEXT_LIVES_NS = 10_000_000_000
"""A text for the pilot has this long to find room on the line."""


class LinkSession:
    """Bytes and their arrival times in; telemetry, and bytes to send, out.

    Live and replayed links run through the same session: every moment is an argument, in nanoseconds on the
    service's clock. Not thread-safe: the caller holds a lock.

    Args:
        settings: the `[autopilot]` section.
        key: what packets are signed with; None for a link without signing.
    """

    def __init__(self, settings: AutopilotSettings, key: SigningKey | None = None) -> None:
        self._settings = settings
        self._timeout_ns = round(settings.heartbeat_timeout_s * 1e9)
        self._learner = VehicleLearner(settings.system_id, self._timeout_ns)
        self._sources = Sources()
        self._tracker = TelemetryTracker(MotionLimits.of(settings))
        self._presence = Presence()
        self._texts = StatusTexts()
        self._choice = ProfileChoice(settings.profile)
        self._requests = Requests(settings, self._choice)
        self._bytes_per_s = bytes_per_s_of(settings.bytes_per_s, settings.endpoint)
        self._outbox = Outbox(self._bytes_per_s)
        self._outbox.set_system_id(settings.system_id or 1)
        self._transport = TransportDelay(settings.endpoint)
        self._obstacles = ObstacleOutput(
            settings, self._bytes_per_s, self._tracker, self._transport, self._choice, self._outbox
        )
        self._notices = Notices()
        self._watch = LinkWatch(self._notices, settings.endpoint)
        self._connection = Connection(settings.endpoint, self._timeout_ns, self._notices, self._watch)
        self._trust = PacketTrust(self._notices)
        if key is not None:
            self.sign_with(key)
        self._in_meter, self._out_meter = RateMeter(), RateMeter()

    def sign_with(self, key: SigningKey) -> None:
        """Sign what leaves from now on, and believe only what is signed with this key."""
        self._trust.signing = Signing(key)
        self._outbox.sign_with(self._trust.signing)

    # -- the line

    def line_opened(self, now_ns: int) -> None:
        """The socket or port is open: say hello at the next `tick`."""
        self._connection.opened(now_ns)
        self._sources.clear()
        self._outbox.clear()
        self._presence.restart()
        self._requests.restart()
        if self._obstacles.complaint is not None:
            self._notices.problem(Problem.SLOW_LINE, self._obstacles.complaint)

    def line_failed(self, reason: str) -> None:
        """The socket or port could not be opened, or was lost; it is being tried again."""
        self._connection.failed(reason)

    @property
    def destination(self) -> Hashable:
        """Where to send on a line with many ends (a UDP port): the vehicle's source, or None."""
        return self._learner.vehicle.source if self._learner.vehicle else None

    # -- bytes in

    def receive(self, data: bytes, arrival_ns: int, source: Hashable = None) -> None:
        """Take bytes of any quality.

        Args:
            data: what came.
            arrival_ns: when, on the service's clock.
            source: who sent it, on a line with many ends.
        """
        self._in_meter.add(arrival_ns, len(data))
        for message in self._sources.read(data, source):
            self._on_message(message, arrival_ns, source)

    def _on_message(self, message: mavlink.MAVLink_message, arrival_ns: int, source: Hashable) -> None:
        name = message.get_type()
        if not self._trust.believes(message, self._connection.is_up(arrival_ns)):
            return
        if name == "HEARTBEAT":
            self._on_heartbeat(message, arrival_ns, source)
        if not self._learner.is_from_vehicle(message, source):
            return
        if self._connection.heard(arrival_ns):
            self._requests.restart()
        self._trust.on_vehicle(message)
        self._watch.protocol(is_mavlink1(message))
        reboots, steps = self._tracker.reboots, self._tracker.clock.steps
        self._tracker.on_message(message, arrival_ns)
        if name == "TIMESYNC":
            self._on_timesync(message, arrival_ns)
        elif name == "AUTOPILOT_VERSION" and self._choice.on_version(message):
            self._tell_profile()
        self._requests.on_message(message, arrival_ns)
        if self._tracker.reboots != reboots:
            self._requests.restart()
            self._notices.news("the autopilot has rebooted: asking for its messages again")
        elif self._tracker.clock.steps != steps:
            self._requests.restart_time()
            self._notices.news("a clock has stepped: the autopilot's time is taken anew")

    def _on_heartbeat(
        self, heartbeat: mavlink.MAVLink_heartbeat_message, arrival_ns: int, source: Hashable
    ) -> None:
        before = self._learner.vehicle
        hearing = self._learner.on_heartbeat(heartbeat, source, arrival_ns)
        vehicle = self._learner.vehicle
        if hearing is Hearing.KNOWN and vehicle is not None:
            self._requests.on_mode(vehicle)
        if hearing is Hearing.FOREIGN and vehicle is not None:
            self._watch.stranger(heartbeat.get_srcSystem(), vehicle.system_id)
        if hearing is Hearing.LEARNT and vehicle is not None:
            self._requests.hold = None
            if before is not None:
                self._tracker.forget()
            self._connection.new_vehicle()
            self._outbox.set_system_id(vehicle.system_id)
            self._choice.on_vehicle(vehicle.autopilot)
            self._notices.news(f"autopilot heard: {vehicle.autopilot}, system {vehicle.system_id}")
            self._tell_profile()

    def _tell_profile(self) -> None:
        points = " as OBSTACLE_DISTANCE_3D" if self._obstacles.sends_points() else ""
        self._notices.news(f"obstacles go out in the {self._choice}{points}")

    def _on_timesync(self, message: mavlink.MAVLink_timesync_message, arrival_ns: int) -> None:
        told = self._requests.on_timesync(message, arrival_ns)
        if isinstance(told, RoundTrip):
            self._tracker.on_round_trip(told)
            self._transport.on_round_trip(told.sent_ns, told.received_ns)
        elif told is not None:
            self._outbox.put(told, arrival_ns + _SHORT_LIVED_NS)

    # -- bytes out

    def tick(self, now_ns: int) -> None:
        """Queue whatever is due; call it at least ten times a second."""
        if not self._connection.is_open:
            return
        heartbeat = self._presence.heartbeat(now_ns)
        if heartbeat is not None:
            self._outbox.put(heartbeat, now_ns + _SHORT_LIVED_NS)
        vehicle = self._learner.vehicle
        self._connection.check(now_ns, was_known=vehicle is not None)
        if vehicle is None or not self._connection.is_up(now_ns):
            return
        for request in self._requests.due(vehicle.system_id, now_ns):
            self._outbox.put(request, now_ns + _SHORT_LIVED_NS)
        for text in self._texts.due(now_ns):
            self._outbox.put(text, now_ns + _TEXT_LIVES_NS)
        self._watch.streams(self._requests.refused())

    def take_output(self, now_ns: int) -> list[bytes]:
        """Frames to write now, in order."""
        sent_before = self._outbox.sent_obstacles
        frames = [frame for _, frame in self._outbox.take(now_ns)]
        if frames:
            self._out_meter.add(now_ns, sum(map(len, frames)))
            self._obstacles.left(self._outbox.sent_obstacles - sent_before, now_ns)
        return frames

    def send_obstacles(
        self, scan: ObstacleScan, captured_ns: int, now_ns: int, congested: bool = False
    ) -> bool:
        """Queue the scan of the frame captured at `captured_ns`, if it may be sent.

        It is taken as of its capture; when it leaves it is turned and shortened by the motion since then.
        `congested` tells that the line has not taken the earlier bytes yet.
        """
        blocked = Refusal.CONGESTED if congested else None
        if not self._connection.is_up(now_ns):
            blocked = Refusal.NOT_CONNECTED
        return self._obstacles.offer(scan, captured_ns, now_ns, blocked)

    def set_state(self, state: ServiceState) -> None:
        """Tell this state in HEARTBEAT from now on."""
        self._presence.set_state(state)

    def say(self, severity: int, text: str, now_ns: int) -> None:
        """Queue a STATUSTEXT; repeated texts are held back."""
        self._texts.say(severity, text, now_ns)

    def ask_to_hold(self) -> str:
        """Ask the vehicle to stop and stay; returns the mode that is asked for, empty if there is none."""
        vehicle = self._learner.vehicle
        return "" if vehicle is None else self._requests.ask_to_hold(vehicle)

    def ask(self, message: mavlink.MAVLink_message, expires_ns: int) -> None:
        """Queue a message of the caller's own; it leaves with the link's signature and within its budget."""
        self._outbox.put(message, expires_ns)

    # -- what is known

    def telemetry_at(self, captured_ns: int, now_ns: int) -> Telemetry:
        """What held at `captured_ns`; see `Telemetry`."""
        return self._with_mode(self._tracker.telemetry_at(captured_ns), now_ns)

    def newest_pose(self, now_ns: int) -> Telemetry:
        """What held at the newest attitude, if that is at most 0.5 s old."""
        return self._with_mode(self._tracker.newest(now_ns), now_ns)

    def predicted_pose(self, at_ns: int) -> Telemetry:
        """What will hold at a moment up to 0.25 s after the newest messages, carried on by their rates."""
        return self._tracker.predicted(at_ns)

    def _with_mode(self, telemetry: Telemetry, now_ns: int) -> Telemetry:
        vehicle = self._learner.vehicle
        if vehicle is None or now_ns - vehicle.heard_ns > self._timeout_ns:
            return telemetry
        return replace(telemetry, armed=vehicle.armed, mode=vehicle.mode)

    def take_notices(self) -> list[Notice]:
        """Lines for the log that have not been taken yet."""
        return self._notices.take()

    def status(self, now_ns: int) -> LinkStatus:
        """How the link is doing."""
        vehicle, clock = self._learner.vehicle, self._tracker.clock
        return LinkStatus(
            endpoint=self._settings.endpoint,
            connected=self._connection.is_up(now_ns),
            line_open=self._connection.is_open,
            system_id=vehicle.system_id if vehicle else None,
            autopilot=vehicle.autopilot if vehicle else None,
            mode=vehicle.mode if vehicle else None,
            armed=vehicle.armed if vehicle else None,
            heartbeat_age_s=(now_ns - vehicle.heard_ns) / 1e9 if vehicle else None,
            mavlink1_seen=self._watch.mavlink1,
            rates_hz=self._requests.rates_hz(now_ns),
            reboots=self._tracker.reboots,
            clock_steps=clock.steps,
            line_losses=self._connection.losses,
            clock_synced=clock.is_synced(now_ns),
            clock_offset_s=clock.offset_ns / 1e9 if clock.offset_ns is not None else None,
            clock_width_s=clock.width_ns / 1e9 if clock.width_ns is not None else None,
            sent_obstacles=self._outbox.sent_obstacles,
            profile=self._choice.profile.name if vehicle else None,
            obstacle_rate_hz=self._obstacles.rate_hz(now_ns),
            obstacle_rate_limit_hz=self._obstacles.limit_hz,
            obstacle_delay_ms=self._obstacles.delay_ms,
            transport_ms=self._transport.estimate_ns / 1e6,
            not_made_good=self._obstacles.not_made_good,
            byte_budget_per_s=self._bytes_per_s,
            dropped_messages=self._outbox.dropped,
            refused_obstacles=self._obstacles.refused,
            bytes_in_per_s=self._in_meter.per_second(now_ns),
            bytes_out_per_s=self._out_meter.per_second(now_ns),
            bad_bytes=self._sources.bad_bytes,
            signed=self._trust.signing is not None,
            refused_packets=dict(self._trust.refused),
            other_system_ids=tuple(sorted(self._learner.others)),
            hold=self._requests.hold.outcome if self._requests.hold else None,
            problem=self._notices.standing,
        )
