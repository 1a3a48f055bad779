"""The background reader: a lost camera comes back, a wrong one is told and left alone."""

from __future__ import annotations

import pytest
from program_fakes import ScriptedCamera, make_settings, picture, wait_until

from service.cameras.camera import CameraEndedError, PictureSizeError
from service.cameras.reader import CameraReader, CameraState
from service.clock import MonotonicClock
from service.errors import CameraError, ConfigError
from service.frame import Frame
from service.latest_slot import LatestSlot
from uavdepth.errors import SceneError

SETTINGS = make_settings()


def reader_of(camera: ScriptedCamera) -> tuple[CameraReader, LatestSlot[Frame]]:
    slot: LatestSlot[Frame] = LatestSlot()
    reader = CameraReader(camera, slot)
    reader.start()
    return reader, slot


def test_pictures_arrive_and_the_newest_is_kept() -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [picture(1), picture(2), picture(3)])
    reader, slot = reader_of(camera)
    wait_until(lambda: reader.status.frames == 3)
    frame = slot.take()
    assert frame is not None
    assert frame.index == 2
    assert frame.image_bgr[0, 0, 0] == 3
    assert slot.dropped_count == 2
    reader.stop()


def test_a_camera_that_is_unplugged_is_opened_again() -> None:
    acts = [picture(), CameraError("unplugged"), picture(), picture()]
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), acts, opens=[None, CameraError("not back yet")])
    reader, _ = reader_of(camera)
    wait_until(lambda: reader.status.frames == 3)
    assert camera.open_count >= 3
    assert reader.status.reopened >= 2
    assert camera.close_count >= 2
    reader.stop()


def test_a_driver_that_raises_anything_is_survived() -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [ZeroDivisionError("driver"), picture()])
    reader, _ = reader_of(camera)
    wait_until(lambda: reader.status.frames == 1)
    reader.stop()


def test_a_camera_that_delivers_nothing_is_lost_and_says_so() -> None:
    reader, _ = reader_of(ScriptedCamera(SETTINGS, MonotonicClock(), []))
    wait_until(lambda: reader.status.reopened >= 2)
    assert reader.status.state is CameraState.LOST
    assert reader.status.detail == "the script is over"
    reader.stop()


def test_a_camera_that_waits_for_a_pose_stays_open() -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [])
    camera.reopen_on_timeout = False
    reader, _ = reader_of(camera)
    wait_until(lambda: reader.status.state is CameraState.WAITING)
    reader.stop()
    assert camera.open_count == 1


def test_a_file_that_is_over_ends_the_reader() -> None:
    reader, slot = reader_of(
        ScriptedCamera(SETTINGS, MonotonicClock(), [picture(), CameraEndedError("over")])
    )
    wait_until(lambda: reader.status.state is CameraState.ENDED)
    assert slot.take() is not None
    assert reader.failure is None
    reader.stop()


@pytest.mark.parametrize("error", [ConfigError("no such file"), SceneError("needs uavdepth[sim]")])
def test_what_can_never_work_is_not_tried_again(error: Exception) -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [], opens=[error])
    reader, _ = reader_of(camera)
    wait_until(lambda: reader.status.state is CameraState.FAILED)
    assert reader.failure is error
    assert camera.open_count == 1
    reader.stop()


def test_a_first_picture_of_the_wrong_size_is_a_wrong_configuration() -> None:
    reader, _ = reader_of(
        ScriptedCamera(SETTINGS, MonotonicClock(), [PictureSizeError("[camera] width: no")])
    )
    wait_until(lambda: reader.failure is not None)
    assert isinstance(reader.failure, ConfigError)
    reader.stop()


def test_a_later_picture_of_the_wrong_size_is_a_lost_camera() -> None:
    acts = [picture(), PictureSizeError("[camera] width: no"), picture()]
    reader, _ = reader_of(ScriptedCamera(SETTINGS, MonotonicClock(), acts))
    wait_until(lambda: reader.status.frames == 2)
    assert reader.failure is None
    reader.stop()


def test_stop_closes_the_camera() -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [picture()], forever=True)
    reader, _ = reader_of(camera)
    wait_until(lambda: reader.status.frames > 0)
    reader.stop()
    assert camera.close_count == 1
