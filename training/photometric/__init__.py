"""Supervision by re-projection: neighbouring frames, warped by depth and motion, rebuild the one between."""

from __future__ import annotations

from training.photometric.geometry import reproject, transform_from_pose
from training.photometric.loss import PhotometricSettings, PhotometricTerms, photometric_loss

__all__ = [
    "PhotometricSettings",
    "PhotometricTerms",
    "photometric_loss",
    "reproject",
    "transform_from_pose",
]
