"""What an autopilot said before it started anew is told apart from what it says now."""

from __future__ import annotations

from link_support import Conversation, Voice
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.motion_history import MotionLimits
from service.autopilot.telemetry_tracker import TelemetryTracker

SECOND = 1_000_000_000


def test_an_autopilot_that_is_heard_anew_from_another_port_begins_a_new_epoch() -> None:
    """A simulator that starts again speaks from another port: its reboot is not seen, its positions jump."""
    talk, voice = Conversation(SECOND), Voice()

    def fly(port: int, boot_ms: int) -> int:
        for number in range(60):
            if number % 50 == 0:
                talk.hear(voice.heartbeat(), source=port)
            talk.hear(voice.attitude(boot_ms + 20 * number), source=port)
            talk.wait_s(0.02)
        telemetry = talk.session.telemetry_at(talk.now_ns - 30_000_000, talk.now_ns)
        assert telemetry.attitude is not None
        return telemetry.epoch

    first = fly(5001, 60_000)
    talk.wait_s(5.0)
    assert fly(5002, 1_000) != first


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
