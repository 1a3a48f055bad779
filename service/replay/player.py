"""The player: footage through the pipeline, picture by picture, on the record's clock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from service.errors import RecordError
from service.frame import Frame
from service.perception_result import PerceptionResult
from service.pipeline import Perception
from service.recorder.perception_note import PerceptionNote
from service.replay.footage import Footage, RecordedPicture
from service.replay.recorded_depth import RecordedDepth, perception_of_depth
from service.replay.replayed_link import ReplayedLink
from service.settings import Settings
from uavdepth.camera import CameraModel


@dataclass(frozen=True)
class Replayed:
    """One picture measured again.

    Args:
        note: what was recorded of it.
        result: what it is now.
    """

    note: PerceptionNote
    result: PerceptionResult


def play(settings: Settings, footage: Footage, *, from_depth: bool = False) -> Iterator[Replayed]:
    """Measure every picture again.

    A picture is measured with what was known of the vehicle when it had been measured in flight, so that
    two replays are the same to the bit on one machine.

    Args:
        settings: the configuration.
        footage: pictures and telemetry.
        from_depth: take recorded depth instead of asking the network.

    Raises:
        ConfigError: a network that cannot be used.
        RecordError: there is nothing to play, or pictures are not of the calibrated size.
    """
    link = ReplayedLink(settings.autopilot, footage.packets)
    depth = RecordedDepth()
    perception = perception_of_depth(settings, depth) if from_depth else Perception.load(settings)
    camera = settings.camera.model
    played = 0
    for picture in footage.pictures():
        frame = _frame(picture, camera, from_depth=from_depth, name=footage.name)
        if frame is None:
            continue
        depth.depth_m = picture.depth_m
        link.hear_until(max(picture.note.done_ns, picture.note.captured_ns))
        yield Replayed(picture.note, perception.step_late(frame, link.telemetry_at))
        played += 1
    if played == 0:
        what = "depth" if from_depth else "camera pictures"
        raise RecordError(f"{footage.name}: holds no {what} to replay")


def _frame(picture: RecordedPicture, camera: CameraModel, *, from_depth: bool, name: str) -> Frame | None:
    """The picture as the pipeline takes it; None where it was not recorded."""
    note = picture.note
    if from_depth:
        if picture.depth_m is None:
            return None
        blank = np.zeros((camera.height, camera.width, 3), np.uint8)
        return Frame(blank, note.captured_ns, note.index)
    image = picture.image_bgr
    if image is None:
        return None
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise RecordError(
            f"{name}: picture {note.index} is {width}x{height}, [camera] says {camera.width}x{camera.height}"
        )
    return Frame(image, note.captured_ns, note.index)
