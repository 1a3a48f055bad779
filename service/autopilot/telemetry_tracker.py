"""Telemetry messages in, the vehicle's motion at any recent moment out."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.boot_time import BootTime
from service.autopilot.clock_sync import ClockSync
from service.autopilot.motion_history import MotionHistory, MotionLimits
from service.autopilot.timesync import RoundTrip
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude

_DOWNWARD = mavlink.MAV_SENSOR_ROTATION_PITCH_270
"""Orientation 25. ArduPilot echoes our own obstacles as orientations 0 to 7: they are no height."""

_QUALITY_INVALID = 1
"""DISTANCE_SENSOR.signal_quality: 0 is unset, 1 invalid, 100 perfect."""

_OTHER_SENSOR_NS = 500_000_000
"""With several downward sensors one is kept to until it has been silent for this long."""

_PREDICTED_NS = 250_000_000
"""Motion is carried on so far for a message that is about to leave: a message of 50 Hz that was 100 ms late,
and a way of 100 ms."""

_NEWEST_POSE_NS = 500_000_000
"""An attitude older than this is no newest pose any more."""


class TelemetryTracker:
    """Binds what the autopilot says to the service's clock.

    Everything is kept by the autopilot's own stamps, so a message that was held up on its way is put where
    it belongs; captures are looked up through `ClockSync`.
    """

    def __init__(self, limits: MotionLimits) -> None:
        self.clock = ClockSync()
        self._boot = BootTime()
        self._motion = MotionHistory(limits)
        self._sensor: tuple[int, int] | None = None
        self._forgotten = 0

    @property
    def reboots(self) -> int:
        """Reboots seen."""
        return self._boot.reboots

    @property
    def _epoch(self) -> int:
        return self.reboots + self.clock.steps + self._forgotten

    def forget(self) -> None:
        """Another autopilot speaks now, or the same one from elsewhere, after who knows how many reboots."""
        self._forgotten += 1
        reboots, steps = self._boot.reboots, self.clock.steps
        self._boot, self.clock = BootTime(), ClockSync()
        self._boot.reboots, self.clock.steps = reboots, steps
        self._motion.clear()
        self._sensor = None

    def on_message(self, message: mavlink.MAVLink_message, arrival_ns: int) -> None:
        """Take a message of any kind."""
        name = message.get_type()
        if name == "ATTITUDE":
            self.on_attitude(message, arrival_ns)
        elif name == "LOCAL_POSITION_NED":
            self.on_position(message, arrival_ns)
        elif name == "DISTANCE_SENSOR":
            self.on_range(message)

    def on_attitude(self, message: mavlink.MAVLink_attitude_message, arrival_ns: int) -> None:
        """Take an ATTITUDE; its rates are the body's, as both autopilots send them."""
        boot_ns = self._stamp(message.time_boot_ms, arrival_ns)
        attitude = Attitude(message.roll, message.pitch, message.yaw)
        self._motion.add_attitude(
            boot_ns, attitude, (message.rollspeed, message.pitchspeed, message.yawspeed)
        )

    def on_position(self, message: mavlink.MAVLink_local_position_ned_message, arrival_ns: int) -> None:
        """Take a LOCAL_POSITION_NED."""
        boot_ns = self._stamp(message.time_boot_ms, arrival_ns)
        self._motion.add_position(
            boot_ns, (message.x, message.y, message.z), (message.vx, message.vy, message.vz)
        )

    def on_range(self, message: mavlink.MAVLink_distance_sensor_message) -> None:
        """Take a DISTANCE_SENSOR of any orientation."""
        if message.orientation != _DOWNWARD:
            return
        boot_ns = self._boot.locate(message.time_boot_ms)
        if boot_ns is None or not self._is_our_sensor(message.id, boot_ns):
            return
        measured = (
            message.min_distance < message.current_distance < message.max_distance
            and message.signal_quality != _QUALITY_INVALID
        )
        self._motion.add_range(boot_ns, message.current_distance / 100 if measured else None)

    def on_round_trip(self, trip: RoundTrip) -> None:
        """Take an answered TIMESYNC request."""
        if self.clock.on_round_trip(trip.sent_ns, trip.boot_ns, trip.received_ns):
            self._motion.clear()

    def telemetry_at(self, at_ns: int) -> Telemetry:
        """Motion at `at_ns` on the service's clock; what no message is near enough to is None."""
        return self._telemetry(at_ns, None)

    def predicted(self, at_ns: int) -> Telemetry:
        """Motion at a moment up to 0.25 s after the newest messages, carried on by their rates."""
        return self._telemetry(at_ns, _PREDICTED_NS)

    def _telemetry(self, at_ns: int, carried_ns: int | None) -> Telemetry:
        offset_ns = self.clock.offset_ns
        if offset_ns is None:
            return Telemetry(at_ns, epoch=self._epoch)
        boot_ns = at_ns - offset_ns
        position = self._motion.position_at(boot_ns, carried_ns)
        return Telemetry(
            at_ns=at_ns,
            attitude=self._motion.attitude_at(boot_ns, carried_ns),
            heading_shift_rad=self._motion.heading_shift_at(boot_ns, carried_ns),
            height_m=self._motion.height_at(boot_ns),
            position_ned_m=position[0] if position else None,
            velocity_ned_mps=position[1] if position else None,
            epoch=self._epoch,
        )

    def newest(self, now_ns: int) -> Telemetry:
        """Motion at the newest attitude; empty if that is more than 0.5 s old."""
        offset_ns, boot_ns = self.clock.offset_ns, self._motion.newest_attitude_ns
        if offset_ns is None or boot_ns is None or now_ns - (boot_ns + offset_ns) > _NEWEST_POSE_NS:
            return Telemetry(now_ns)
        return self.telemetry_at(boot_ns + offset_ns)

    def autopilot_us(self, at_ns: int, now_ns: int) -> int:
        """`at_ns` in microseconds since the autopilot's boot, or 0 if the clocks are not synchronised."""
        offset_ns = self.clock.offset_ns
        if offset_ns is None or not self.clock.is_synced(now_ns):
            return 0
        return max(0, (at_ns - offset_ns) // 1000)

    def _stamp(self, raw_ms: int, arrival_ns: int) -> int:
        reboots = self._boot.reboots
        boot_ns = self._boot.unwrap(raw_ms, arrival_ns)
        if self._boot.reboots != reboots:
            self.clock.restart()
            self._motion.clear()
            self._sensor = None
        if self.clock.on_arrival(boot_ns, arrival_ns):
            self._motion.clear()
        return boot_ns

    def _is_our_sensor(self, sensor_id: int, boot_ns: int) -> bool:
        if self._sensor is not None:
            kept_id, heard_ns = self._sensor
            if sensor_id != kept_id and boot_ns - heard_ns <= _OTHER_SENSOR_NS:
                return False
        self._sensor = (sensor_id, boot_ns)
        return True
