"""What an autopilot said before it started anew is told apart from what it says now."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.motion_history import MotionLimits
from service.autopilot.telemetry_tracker import TelemetryTracker

SECOND = 1_000_000_000


def test_a_reboot_begins_a_new_epoch() -> None:
    tracker = TelemetryTracker(MotionLimits())
    for number in range(50):
        stamp_ms = 60_000 + 20 * number
        tracker.on_attitude(
            mavlink.MAVLink_attitude_message(stamp_ms, 0, 0, 0, 0, 0, 0), SECOND + number * 20_000_000
        )
    before = tracker.telemetry_at(2 * SECOND - 30_000_000)
    assert before.attitude is not None
    tracker.on_attitude(mavlink.MAVLink_attitude_message(1_000, 0, 0, 0, 0, 0, 0), 10 * SECOND)
    after = tracker.telemetry_at(10 * SECOND)
    assert after.attitude is not None
    assert after.epoch != before.epoch
