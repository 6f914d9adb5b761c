"""How many texels a surfel billboard has.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
3.3, eq. 9: as many as it covers pixels at z_min, each of epsilon pixels. That is 2 w over the error
in metres, whatever epsilon is.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import IntArray
from vegtool.surfels.hierarchy import SurfelHierarchy

MOST = 1024
"""Texels along a side: of what is flat, eq. 9 has no bound."""


def texture_sizes(one: SurfelHierarchy) -> IntArray:
    """(b, 2) int32 texels along o1 and o2, one at least."""
    half = one.boxes.half[:, :2]
    error = np.maximum(one.error, np.finfo(float).tiny)[:, None]
    return np.ceil(np.clip(2 * half / error, 1, MOST)).astype(np.int32)
