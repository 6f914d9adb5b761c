"""How many texels a surfel billboard has.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
3.3, eq. 9: as many as it covers pixels at z_min, each of epsilon pixels. That is 2 w over the error
in metres, whatever epsilon is, margins included (margin.py).
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import IntArray
from vegtool.surfels.hierarchy import SurfelHierarchy
from vegtool.surfels.margin import billboards_of


def texture_sizes(one: SurfelHierarchy) -> IntArray:
    """(b, 2) int32 texels along o1 and o2, one at least."""
    size = 2 * billboards_of(one).half_size
    return np.ceil(size / one.error[:, None]).astype(np.int32)
