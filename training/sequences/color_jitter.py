"""Random changes of colour, the same for all frames of a triplet."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_LUMA = np.array([0.299, 0.587, 0.114])
_YIQ = np.array([[0.299, 0.587, 0.114], [0.596, -0.274, -0.322], [0.211, -0.523, 0.312]])
"""Luma and two axes of chroma (NTSC): hue is the angle between the two."""


@dataclass(frozen=True)
class ColorJitter:
    """One change of colour; the default changes nothing.

    Args:
        brightness: factor of every channel.
        contrast: factor of the difference to the mean grey.
        saturation: factor of the difference to the pixel's own grey.
        hue: turn of the chroma, in whole turns.
    """

    brightness: float = 1.0
    contrast: float = 1.0
    saturation: float = 1.0
    hue: float = 0.0

    @classmethod
    def sample(cls, rng: np.random.Generator) -> ColorJitter:
        """Brightness, contrast and saturation within 0.2 of 1, hue within 0.1 of 0, each every other time."""
        change = rng.uniform(-1.0, 1.0, 4) * (rng.random(4) < 0.5)
        brightness, contrast, saturation = (float(value) for value in 1.0 + 0.2 * change[:3])
        return cls(brightness, contrast, saturation, 0.1 * float(change[3]))

    def apply(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The changed copy of (..., W, 3) RGB frames of one scene, which share their mean grey.

        All four changes are affine in RGB, hue being turned in YIQ, and so cost one matrix a pixel.
        """
        if self == ColorJitter():
            return rgb.copy()
        rows = rgb.reshape(-1, rgb.shape[-2], 3)
        colour = self._matrix()
        mean_grey = self.brightness * float(_LUMA @ np.asarray(cv2.mean(rows)[:3]))
        offset = np.full((3, 1), (1.0 - self.contrast) * mean_grey)
        changed = cv2.transform(rows, np.hstack([self.contrast * self.brightness * colour, offset]))
        return np.asarray(changed, np.uint8).reshape(rgb.shape)

    def _matrix(self) -> NDArray[np.float64]:
        """(3, 3) saturation and hue: luma stays, chroma is scaled and turned."""
        angle = 2.0 * np.pi * self.hue
        turn = self.saturation * np.array(
            [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]], np.float64
        )
        chroma = np.eye(3)
        chroma[1:, 1:] = turn
        return np.asarray(np.linalg.inv(_YIQ) @ chroma @ _YIQ)
