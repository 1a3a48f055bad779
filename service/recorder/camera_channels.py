"""The topics of one camera in a record."""

from __future__ import annotations

import json
from dataclasses import dataclass

from foxglove import Channel, Context, Schema
from foxglove.channels import CameraCalibrationChannel, CompressedImageChannel, RawImageChannel
from foxglove.messages import CompressedImage, RawImage

from service.recorder import layout, messages
from service.recorder.perception_note import PerceptionNote
from service.settings import Settings
from uavdepth.camera import CameraModel, CameraMount

_NOTE_SCHEMA = json.dumps({"title": "uavdepth.Perception", **PerceptionNote.model_json_schema()}).encode()


@dataclass(frozen=True)
class RecordedCamera:
    """A camera whose pictures are recorded.

    Args:
        name: "" for the main one.
        camera, mount: what it is and how it sits on the vehicle.
    """

    name: str
    camera: CameraModel
    mount: CameraMount


def recorded_cameras(settings: Settings) -> tuple[RecordedCamera, ...]:
    """The main camera and the further ones."""
    sides = (
        RecordedCamera(extra.name, extra.camera.model, extra.mount.mount) for extra in settings.extra_camera
    )
    return RecordedCamera("", settings.camera.model, settings.mount.mount), *sides


class CameraChannels:
    """Writes what there is of one camera.

    Args:
        camera: which.
        context: of the file.
    """

    def __init__(self, camera: RecordedCamera, context: Context) -> None:
        self._name, self._camera = camera.name, camera.camera
        schema = Schema(name="uavdepth.Perception", encoding="jsonschema", data=_NOTE_SCHEMA)
        self._notes = Channel(
            self._topic(layout.NOTE), message_encoding="json", schema=schema, context=context
        )
        self._calibration = CameraCalibrationChannel(self._topic(layout.CALIBRATION), context=context)
        self._image = CompressedImageChannel(self._topic(layout.IMAGE), context=context)
        self._depth = RawImageChannel(self._topic(layout.DEPTH), context=context)
        self._sigma = RawImageChannel(self._topic(layout.SIGMA), context=context)

    def note(self, note: PerceptionNote, wall_ns: int) -> None:
        """Write what became of a picture, and the calibration."""
        self._notes.log(note.encode(), log_time=wall_ns)
        calibration = messages.calibration(self._camera, wall_ns, self._name)
        self._calibration.log(calibration, log_time=wall_ns)

    def image(self, image: CompressedImage, wall_ns: int) -> None:
        """Write a picture."""
        self._image.log(image, log_time=wall_ns)

    def depth(self, depth: RawImage, wall_ns: int) -> None:
        """Write depth."""
        self._depth.log(depth, log_time=wall_ns)

    def sigma(self, sigma: RawImage, wall_ns: int) -> None:
        """Write the uncertainty of depth."""
        self._sigma.log(sigma, log_time=wall_ns)

    def _topic(self, what: str) -> str:
        return layout.camera_topic(what, self._name)
