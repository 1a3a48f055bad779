"""The camera of an augmented picture: what a crop, a resize and a mirror make of the one that took it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from training.data.augmentation import Crop
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount

_MIRRORED_DISTORTION = (3, 8, 9, 13)
"""Numbers of OpenCV's distortion that change sign in a mirror: p2, s1, s2 and tau_y act along x only by
even powers of x."""


@dataclass(frozen=True)
class View:
    """Camera, mount and attitude with which a picture would have been taken as it is.

    A mirrored picture shows a mirrored world: its vehicle rolls and turns the other way.
    """

    camera: CameraModel
    mount: CameraMount
    attitude: Attitude


def view_of_crop(view: View, crop: Crop, width: int, height: int) -> View:
    """The view of a crop of a picture, resized to `width` x `height`."""
    camera = view.camera
    window = replace(
        camera, width=crop.width, height=crop.height, cx=camera.cx - crop.left, cy=camera.cy - crop.top
    ).scaled(width, height)
    cropped = View(window, view.mount, view.attitude)
    return mirrored_view(cropped) if crop.mirrored else cropped


def mirrored_view(view: View) -> View:
    """The view of the picture with left and right swapped."""
    camera, mount, attitude = view.camera, view.mount, view.attitude
    distortion = tuple(
        -value if index in _MIRRORED_DISTORTION else value for index, value in enumerate(camera.distortion)
    )
    return View(
        replace(camera, cx=camera.width - 1 - camera.cx, distortion=distortion),
        replace(mount, roll_deg=-mount.roll_deg, yaw_deg=-mount.yaw_deg, right_m=-mount.right_m),
        Attitude(-attitude.roll_rad, attitude.pitch_rad, -attitude.yaw_rad),
    )
