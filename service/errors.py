"""Errors of the service: their text names the thing, the value and the limit, and is fit to show a user."""

from __future__ import annotations

from uavdepth.errors import UavDepthError


class ConfigError(UavDepthError):
    """A configuration that cannot be used; the text holds the exact key."""


class CameraError(UavDepthError):
    """A camera that cannot be opened or has stopped delivering."""


class LinkError(UavDepthError):
    """An autopilot endpoint that cannot be opened or understood."""


class PublisherError(UavDepthError):
    """A Zenoh endpoint that cannot be opened."""


class RecordError(UavDepthError):
    """A record or telemetry log that cannot be read, written or replayed."""
