"""The trail that is walked along: a wave through the middle of a landscape, along x.

Neither trees nor bushes grow on it, which crowns reach into from both sides; grass and herbs do.
Without one a walker in a wood of samples, whose branches begin at the foot, sees nothing but the
crown that the eye is in.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import ByteArray, FloatArray

SWAY_M, WAVE_M = 6.0, 60.0
"""To either side, and along x until it sways again."""
HALF_M = 4.0
"""From its middle to its edge, across x."""
PIXEL_M = 0.5
"""Of the map that says where trees and bushes grow."""


def middle(x: FloatArray) -> FloatArray:
    """Metres: z of the trail at x."""
    return np.asarray(SWAY_M * np.sin(2 * np.pi * x / WAVE_M))


def density(side_m: float) -> ByteArray:
    """(n, n) uint8 over a square landscape, rows along z: 0 on the trail, 255 beside it."""
    count = round(side_m / PIXEL_M)
    at = np.linspace(-side_m / 2, side_m / 2, count)
    on = np.abs(at[:, None] - middle(at)) < HALF_M
    return np.where(on, 0, 255).astype(np.uint8)
