"""From `[camera] source` to the camera that delivers it."""

from __future__ import annotations

from pathlib import Path

from service.cameras.camera import Camera
from service.cameras.rendered import PoseSource
from service.clock import Clock
from service.errors import ConfigError
from service.settings.camera import CameraSettings
from uavdepth.camera import CameraMount
from uavdepth.errors import SceneError

_FORMS = 'a camera number, a video file, a folder of pictures, "rtsp://..." or "sim:SCENE[:SEED]" is needed'


def open_camera(
    source: str, settings: CameraSettings, clock: Clock, link: PoseSource, mount: CameraMount
) -> Camera:
    """The camera that `source` names, opened.

    Raises:
        ConfigError: a source that is not understood or does not exist.
        CameraError: a device or server that does not answer.
        SceneError: a scene that this platform cannot render.
    """
    camera = make_camera(source, settings, clock, link, mount)
    camera.open()
    return camera


def make_camera(
    source: str, settings: CameraSettings, clock: Clock, link: PoseSource, mount: CameraMount
) -> Camera:
    """The camera that `source` names, not opened yet.

    Args:
        source: as in `[camera] source`.
        settings: size, calibration, time-outs.
        clock: gives the capture stamps.
        link: where the vehicle is, for rendered scenes.
        mount: where the camera sits, for rendered scenes.

    Raises:
        ConfigError: a source that is not understood or does not exist.
    """
    settings = settings.model_copy(update={"source": source})
    scheme, colon, rest = source.partition(":")
    if scheme == "sim" and colon:
        return _rendered(settings, clock, rest, mount, link)
    if scheme in ("rtsp", "rtsps") and rest.startswith("//"):
        from service.cameras.rtsp import RtspCamera

        return RtspCamera(settings, clock)
    if source.isascii() and source.isdigit():
        from service.cameras.usb import UsbCamera

        return UsbCamera(settings, clock, int(source))
    if source.startswith("/dev/"):
        from service.cameras.usb import UsbCamera

        return UsbCamera(settings, clock, source)
    return _from_disk(settings, clock)


def _rendered(
    settings: CameraSettings, clock: Clock, spec: str, mount: CameraMount, link: PoseSource
) -> Camera:
    from service.cameras.rendered import RenderedCamera
    from uavdepth.scenes import parse_scene

    try:
        parse_scene(spec)
    except SceneError as error:
        raise ConfigError(f"[camera] source: {error}") from error
    return RenderedCamera(settings, clock, spec, mount, link)


def _from_disk(settings: CameraSettings, clock: Clock) -> Camera:
    path = Path(settings.source).expanduser()
    if path.is_dir():
        from service.cameras.image_folder import ImageFolderCamera

        return ImageFolderCamera(settings, clock, path)
    if path.is_file():
        from service.cameras.video_file import VideoFileCamera

        return VideoFileCamera(settings, clock, path)
    raise ConfigError(f"[camera] source: {settings.source}: no such file or folder; {_FORMS}")
