"""What the service says of itself."""

from __future__ import annotations

from dataclasses import replace

import pytest

from service.autopilot.service_state import ServiceState
from service.cameras.reader import CameraState
from service.health import (
    FIRST_FRAME_NS,
    SEVERITY_CRITICAL,
    SEVERITY_INFO,
    SEVERITY_WARNING,
    STALL_NS,
    Announcer,
    Vitals,
    state_of,
    trouble_of,
)
from service.trouble import Trouble

NOW = 100_000_000_000
WELL = Vitals(
    now_ns=NOW,
    started_ns=0,
    camera=CameraState.DELIVERING,
    link_connected=True,
    armed=True,
    frame_ns=NOW - 30_000_000,
    result_ns=NOW - 20_000_000,
    result_trouble=None,
    sent_ns=NOW - 20_000_000,
)
SILENT = replace(WELL, sent_ns=NOW - STALL_NS - 1)
NEVER_SENT = replace(WELL, sent_ns=None)


def judged(vitals: Vitals) -> tuple[Trouble | None, ServiceState]:
    trouble = trouble_of(vitals)
    return trouble, state_of(trouble, vitals)


@pytest.mark.parametrize(
    ("vitals", "trouble", "state"),
    [
        (WELL, None, ServiceState.ACTIVE),
        (replace(WELL, result_trouble=Trouble.NO_GROUND), None, ServiceState.ACTIVE),
        (replace(SILENT, camera=CameraState.LOST), Trouble.CAMERA_LOST, ServiceState.CRITICAL),
        (replace(SILENT, camera=CameraState.ENDED), Trouble.CAMERA_LOST, ServiceState.CRITICAL),
        (replace(SILENT, frame_ns=NOW - STALL_NS - 1), Trouble.CAMERA_LOST, ServiceState.CRITICAL),
        (replace(SILENT, result_ns=NOW - STALL_NS - 1), Trouble.STALLED, ServiceState.CRITICAL),
        (replace(SILENT, link_connected=False), Trouble.LINK_LOST, ServiceState.CRITICAL),
        (replace(SILENT, result_trouble=Trouble.MODEL_FAILED), Trouble.MODEL_FAILED, ServiceState.CRITICAL),
        (replace(SILENT, result_trouble=Trouble.STALE_FRAME), Trouble.STALE_FRAME, ServiceState.CRITICAL),
        (replace(SILENT, result_trouble=Trouble.NO_HEIGHT), Trouble.NO_HEIGHT, ServiceState.CRITICAL),
        (
            replace(SILENT, result_trouble=Trouble.NO_HEIGHT, armed=False),
            Trouble.NO_HEIGHT,
            ServiceState.STANDBY,
        ),
        (replace(NEVER_SENT, result_trouble=Trouble.NO_HEIGHT), Trouble.NO_HEIGHT, ServiceState.STANDBY),
        (
            replace(SILENT, result_trouble=Trouble.NO_HEIGHT, armed_ns=NOW - 1_000_000),
            Trouble.NO_HEIGHT,
            ServiceState.STANDBY,  # armed again since: it has not left the ground yet
        ),
        (
            replace(NEVER_SENT, result_trouble=Trouble.ON_GROUND, armed=False),
            Trouble.ON_GROUND,
            ServiceState.STANDBY,
        ),
        (SILENT, Trouble.NOT_SENT, ServiceState.CRITICAL),
        (
            replace(NEVER_SENT, result_trouble=Trouble.ON_GROUND, armed=False, mavlink1=True),
            Trouble.NOT_SENT,
            ServiceState.CRITICAL,
        ),
        (replace(NEVER_SENT, result_ns=None), Trouble.STARTING, ServiceState.BOOT),
        (replace(NEVER_SENT, link_connected=False), Trouble.STARTING, ServiceState.BOOT),
        (replace(NEVER_SENT, frame_ns=None, result_ns=None, now_ns=1), Trouble.STARTING, ServiceState.BOOT),
        (
            replace(NEVER_SENT, frame_ns=None, result_ns=None, now_ns=FIRST_FRAME_NS + 1),
            Trouble.CAMERA_LOST,
            ServiceState.CRITICAL,
        ),
    ],
)
def test_the_first_cause_is_named_and_decides_the_state(
    vitals: Vitals, trouble: Trouble | None, state: ServiceState
) -> None:
    assert judged(vitals) == (trouble, state)


def test_silence_is_told_before_the_autopilots_own_half_second_is_over() -> None:
    assert trouble_of(replace(WELL, sent_ns=NOW - 399_000_000)) is None
    assert trouble_of(replace(WELL, sent_ns=NOW - 401_000_000)) is not None


def test_trouble_and_its_end_are_each_said_once() -> None:
    announcer = Announcer(settle_ns=0)
    said = [
        announcer.hear(trouble, state, at)
        for at, (trouble, state) in enumerate(
            [
                (Trouble.STARTING, ServiceState.BOOT),
                (None, ServiceState.ACTIVE),
                (None, ServiceState.ACTIVE),
                (Trouble.CAMERA_LOST, ServiceState.CRITICAL),
                (Trouble.CAMERA_LOST, ServiceState.CRITICAL),
                (Trouble.NO_HEIGHT, ServiceState.STANDBY),
                (None, ServiceState.ACTIVE),
            ]
        )
    ]
    words = [(entry.severity, entry.text) for entry in said if entry is not None]
    assert words == [
        (SEVERITY_INFO, "uavdepth: obstacles ON"),
        (SEVERITY_CRITICAL, "uavdepth OFF: no pictures from the camera"),
        (SEVERITY_WARNING, "uavdepth OFF: no height above ground"),
        (SEVERITY_INFO, "uavdepth: obstacles ON"),
    ]


def test_the_loss_of_what_protected_the_vehicle_is_told_at_once_and_its_end_when_it_lasts() -> None:
    announcer = Announcer(settle_ns=100)
    assert announcer.hear(None, ServiceState.ACTIVE, 0) is None
    assert announcer.hear(None, ServiceState.ACTIVE, 100) is not None
    loss = announcer.hear(Trouble.STALLED, ServiceState.CRITICAL, 150)
    assert loss is not None
    assert loss.severity == SEVERITY_CRITICAL
    assert announcer.hear(None, ServiceState.ACTIVE, 200) is None
    assert announcer.hear(Trouble.STALLED, ServiceState.CRITICAL, 250) is None
    assert announcer.hear(None, ServiceState.ACTIVE, 300) is None
    assert announcer.hear(None, ServiceState.ACTIVE, 400) is not None


def test_flickering_is_not_announced() -> None:
    announcer = Announcer(settle_ns=100)
    assert announcer.hear(None, ServiceState.ACTIVE, 0) is None
    assert announcer.hear(None, ServiceState.ACTIVE, 100) is not None
    for at in range(200, 1200, 50):
        trouble = Trouble.NO_GROUND if at % 100 else None
        assert announcer.hear(trouble, ServiceState.ACTIVE, at) is None
