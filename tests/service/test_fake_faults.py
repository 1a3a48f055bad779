"""Faults are read strictly, and begin and end when they say."""

from __future__ import annotations

import pytest

from service.fake_autopilot.faults import Fault, FaultError, FaultKind, FaultPlan, parse_fault


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("reboot@20", Fault(FaultKind.REBOOT, 20.0)),
        ("pause@30:5", Fault(FaultKind.PAUSE, 30.0, 5.0)),
        ("burst@40.5:3", Fault(FaultKind.BURST, 40.5, 3.0)),
        ("clock@50:-1.5", Fault(FaultKind.CLOCK, 50.0, -1.5)),
        ("streams@0", Fault(FaultKind.STREAMS, 0.0)),
    ],
)
def test_a_fault_can_be_written_down(text: str, fault: Fault) -> None:
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "none of reboot@"),
        ("reboot", "none of reboot@"),
        ("crash@20", "'crash@20' is none of"),
        ("reboot@", "is not a number"),
        ("reboot@soon", "'soon' is not a number"),
        ("reboot@-1", "-1.0 must be 0 or more"),
        ("reboot@nan", "must be 0 or more"),
        ("reboot@20:5", "takes no value"),
        ("pause@30", "duration 0.0 s must be above 0, as in pause@30:5"),
        ("pause@30:-5", "must be above 0"),
        ("pause@30:inf", "not a finite number"),
        ("burst@30:5:1", "too many parts"),
        ("clock@30", "as in clock@30:-1.5"),
    ],
)
def test_what_cannot_be_read_is_named(text: str, complaint: str) -> None:
    with pytest.raises(FaultError, match=complaint):
        parse_fault(text)


def test_each_fault_begins_once_and_in_the_order_of_time() -> None:
    plan = FaultPlan([parse_fault("reboot@3"), parse_fault("clock@1:2"), parse_fault("streams@2")])
    assert plan.starting(0.5) == []
    assert [fault.kind for fault in plan.starting(2.5)] == [FaultKind.CLOCK, FaultKind.STREAMS]
    plan.add(Fault(FaultKind.PAUSE, 2.6, 1.0))
    assert [fault.kind for fault in plan.starting(9.0)] == [FaultKind.PAUSE, FaultKind.REBOOT]
    assert plan.starting(99.0) == []


def test_a_pause_lasts_from_its_second_for_its_duration() -> None:
    plan = FaultPlan([parse_fault("pause@30:5")])
    active = [plan.is_active(FaultKind.PAUSE, at_s) for at_s in (29.99, 30.0, 34.99, 35.0)]
    assert active == [False, True, True, False]
    assert not plan.is_active(FaultKind.BURST, 32.0)
