"""Errors of the workshop. Each names the value and the limit in its text."""

from __future__ import annotations

from uavdepth.errors import UavDepthError


class PretrainedWeightsError(UavDepthError):
    """ImageNet weights that are missing or do not fit the encoder."""


class TrainingDataError(UavDepthError, ValueError):
    """A folder of training frames that is missing, empty or broken."""


class TrainingSettingsError(UavDepthError, ValueError):
    """Training settings that contradict each other."""


class CheckpointError(UavDepthError):
    """A checkpoint that is missing, broken or of another network."""


class ExportError(UavDepthError):
    """An exported file whose output is not the network's."""


class EvaluationError(UavDepthError, ValueError):
    """An evaluation that cannot be made or read."""


class PhotometricShapeError(UavDepthError, ValueError):
    """Pictures, disparities, intrinsics or transforms of shapes that do not belong together."""


class PhotometricSettingsError(UavDepthError, ValueError):
    """A weight or a range of depth of the photometric loss that has no meaning."""
