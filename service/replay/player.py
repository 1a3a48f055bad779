"""The player: footage through the pipeline, picture by picture, on the record's clock."""

from __future__ import annotations

import heapq
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
from service.side_cameras import side_settings
from service.side_merge import SideMerge
from uavdepth.camera import CameraModel

_AHEAD = 8
"""Pictures that are held back to be put in order."""


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
    """Measure every picture again; what further cameras saw is added to the main one's scans.

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
    cameras = _cameras(settings, from_depth=from_depth)
    merge = SideMerge(settings)
    played = 0
    for picture in _as_measured(footage.pictures()):
        camera = cameras.get(picture.camera)
        frame = None if camera is None else _frame(picture, camera, from_depth=from_depth, name=footage.name)
        if camera is None or frame is None:
            continue
        camera.depth.depth = picture.depth
        link.hear_until(max(picture.note.done_ns, picture.note.captured_ns))
        result = camera.perception.step_late(frame, link.telemetry_at)
        if picture.camera:
            merge.put(picture.camera, result)
            continue
        yield Replayed(picture.note, merge.added_to(result))
        played += 1
    if played == 0:
        what = "depth" if from_depth else "camera pictures"
        raise RecordError(f"{footage.name}: holds no {what} to replay")


@dataclass(frozen=True)
class _Camera:
    model: CameraModel
    perception: Perception
    depth: RecordedDepth


def _cameras(settings: Settings, *, from_depth: bool) -> dict[str, _Camera]:
    """The chain of each camera, by name; that of the main one has none."""
    depth = RecordedDepth()
    main = perception_of_depth(settings, depth) if from_depth else Perception.load(settings)
    cameras = {"": _Camera(settings.camera.model, main, depth)}
    for extra in settings.extra_camera:
        own, depth = side_settings(settings, extra), RecordedDepth()
        beside = perception_of_depth(own, depth) if from_depth else main.beside(own)
        cameras[extra.name] = _Camera(extra.camera.model, beside, depth)
    return cameras


def _as_measured(pictures: Iterator[RecordedPicture]) -> Iterator[RecordedPicture]:
    """The pictures in the order in which their measurements ended: each camera has a thread of its own."""
    waiting: list[tuple[int, int, RecordedPicture]] = []
    for number, picture in enumerate(pictures):
        heapq.heappush(waiting, (picture.note.done_ns, number, picture))
        if len(waiting) > _AHEAD:
            yield heapq.heappop(waiting)[2]
    while waiting:
        yield heapq.heappop(waiting)[2]


def _frame(picture: RecordedPicture, by: _Camera, *, from_depth: bool, name: str) -> Frame | None:
    """The picture as the pipeline takes it; None where it was not recorded."""
    note, camera = picture.note, by.model
    if from_depth:
        if picture.depth is None:
            return None
        blank = np.zeros((camera.height, camera.width, 3), np.uint8)
        return Frame(blank, note.captured_ns, note.index)
    image = picture.image_bgr
    if image is None:
        return None
    height, width = image.shape[:2]
    section = f"[[extra_camera]] {picture.camera}" if picture.camera else "[camera]"
    if (width, height) != (camera.width, camera.height):
        raise RecordError(
            f"{name}: picture {note.index} is {width}x{height}, {section} says {camera.width}x{camera.height}"
        )
    return Frame(image, note.captured_ns, note.index)
