"""Simulated autopilots that treat obstacle messages as the real ones were measured to."""

from service.fake_autopilot.fake_autopilot import FakeAutopilot, Truth
from service.fake_autopilot.faults import Fault, FaultError, FaultKind, parse_fault
from service.fake_autopilot.pilot import Pilot, PilotError

__all__ = ["FakeAutopilot", "Fault", "FaultError", "FaultKind", "Pilot", "PilotError", "Truth", "parse_fault"]
