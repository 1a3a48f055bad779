"""What a picture says against the level surface that was taken for the ground."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_FARTHEST_OFF = 1.0
"""Log ratio beyond which pixels speak no louder: that they lie on another surface is then certain."""

_NEAREST_SHARE = 0.25
"""Of the pixels that look down, those whose ground is nearest: it is next to the ground below the vehicle,
whose height is known."""

_RAISED_GROUND = 0.08
"""How likely what stands there in front of the supposed ground is the ground itself, and the supposed one a
valley's floor; most often it is an obstacle."""

_SIGMA_OF_SLOPE = 0.5
"""Error of the factor for each unit that the slope of log depth over log plane is off 1, measured on planes
that fall and rise."""


def doubt_of_surface(
    log_plane: NDArray[np.float32], off: NDArray[np.float32], gate: float, endless: int
) -> float:
    """Relative sigma for the chance that another surface in view is the ground.

    Nothing lies beneath the ground. What is seen beneath the surface is the ground as likely as its share of
    the pixels of both, and the factor then wrong by its distance: the second moment of a mixture. So is what
    stands in front where the ground is nearest, with the odds of an obstacle.

    Args:
        log_plane: (N,) log of the level plane's depth at all pixels that look down.
        off: (N,) log of plane over network depth, less that of the surface: below 0 beneath it.
        gate: distance up to which a pixel is on the surface.
        endless: number of further such pixels that see no end.
    """
    beneath = off[off < -gate]
    on_surface = np.count_nonzero(np.abs(off) <= gate)
    lower = float(np.square(np.maximum(beneath, -_FARTHEST_OFF)).sum()) + endless * _FARTHEST_OFF**2
    lower /= on_surface + beneath.size + endless
    nearest = max(1, round(_NEAREST_SHARE * off.size))
    foot = off[np.argpartition(log_plane, nearest - 1)[:nearest]]
    raised = np.square(np.minimum(foot[foot > gate], _FARTHEST_OFF)).sum() / nearest
    return math.sqrt(lower + _RAISED_GROUND * float(raised))


def doubt_of_slope(slope: float, reach: float, spread: float, tiles: int) -> float:
    """Relative sigma for ground that rises or falls, or of which too little is seen to tell.

    Args:
        slope: of log depth over log of the plane's depth.
        reach: standard deviation of the latter.
        spread: how far the picture's tiles are apart, as one standard deviation.
        tiles: how many there are.
    """
    return _SIGMA_OF_SLOPE * math.hypot(slope - 1.0, spread / (reach * math.sqrt(tiles)))
