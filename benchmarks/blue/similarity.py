"""Structural similarity over several scales.

Wang, Simoncelli, Bovik: Multi-scale structural similarity for image quality assessment (2003): what
Brandt et al. call hierarchical, who name Wang et al. 2004 for it.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from vegtool.arrays import FloatArray, SingleArray

WEIGHTS = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333)
"""Of the scales, the finest first, as in the paper."""
SIGMA, TRUNCATE = 1.5, 5 / 1.5
"""Pixels of the window, of eleven a side."""
LUMINANCE_K, CONTRAST_K = 0.01, 0.03


def hierarchical(one: SingleArray, other: SingleArray) -> float:
    """-1 to 1, of two pictures (h, w) with values from 0 to 1; of small ones, over as many scales
    as leave eleven pixels a side, with weights that add up to one."""
    x, y = one.astype(np.float64), other.astype(np.float64)
    scales = 1
    while scales < len(WEIGHTS) and min(x.shape) >> scales >= 11:
        scales += 1
    weights = np.array(WEIGHTS[:scales]) / sum(WEIGHTS[:scales])
    found = 1.0
    for number, weight in enumerate(weights):
        alike, contrast = _similarity(x, y)
        value = alike * contrast if number == scales - 1 else contrast
        found *= max(float(value.mean()), 0.0) ** weight
        x, y = _halved(x), _halved(y)
    return found


def _similarity(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(h, w) of luminance, and of contrast and structure."""

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(gaussian_filter(values, SIGMA, truncate=TRUNCATE))

    c1, c2 = LUMINANCE_K**2, CONTRAST_K**2
    mx, my = mean(x), mean(y)
    xx, yy, xy = mean(x * x) - mx * mx, mean(y * y) - my * my, mean(x * y) - mx * my
    alike = (2 * mx * my + c1) / (mx * mx + my * my + c1)
    return alike, (2 * xy + c2) / (xx + yy + c2)


def _halved(x: FloatArray) -> FloatArray:
    """Means of two by two; an odd row or column at the end goes."""
    h, w = (n // 2 * 2 for n in x.shape)
    return np.asarray(x[:h, :w].reshape(h // 2, 2, w // 2, 2).mean(axis=(1, 3)))
