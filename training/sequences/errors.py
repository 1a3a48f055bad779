"""Errors of single frames, apart from those of whole data sets: a broken frame is skipped, not fatal."""

from __future__ import annotations

from training.errors import TrainingDataError


class BrokenFrameError(TrainingDataError):
    """One frame whose picture or depth is missing, unreadable or of another size than the calibration."""
