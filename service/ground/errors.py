"""Errors of the ground station."""

from __future__ import annotations

from uavdepth.errors import UavDepthError


class GroundError(UavDepthError):
    """A ground station that cannot be started; the text names the value and what is needed."""


class PictureError(UavDepthError):
    """A picture from the network that is not handed to a browser."""
