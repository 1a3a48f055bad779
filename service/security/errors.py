"""What is wrong with certificates, keys and passwords."""

from __future__ import annotations

from service.errors import ConfigError


class SecurityError(ConfigError):
    """A certificate, key, password or access list that cannot be used; the text names file and fix."""
