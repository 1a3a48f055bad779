"""Numbers that the torch code and the kernels of this package share."""

from __future__ import annotations

C1 = 0.01**2
C2 = 0.03**2
"""Constants of structural similarity for images in 0..1 (Wang et al. 2004)."""

MIN_DEPTH_RATIO = 1e-3
"""A point is in front of the source camera if its depth there exceeds this part of that in the target."""
