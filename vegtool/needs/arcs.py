"""Which part of a circle many arcs cover together: kept in equal parts, so that it stays small."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.needs.planar import BoolArray

PARTS = 4096
"""Of a circle: an arc is up to two of them larger than it was, 0.2 degrees."""
STEP = 2 * np.pi / PARTS


def covered(start: FloatArray, extent: FloatArray) -> BoolArray:
    """(PARTS,) whether some of each is on an arc; start, extent: (n,) radians, any turn."""
    whole = extent >= 2 * np.pi
    if whole.any():
        return np.ones(PARTS, np.bool_)
    first = np.floor(start % (2 * np.pi) / STEP).astype(np.int64)
    last = np.floor((start % (2 * np.pi) + extent) / STEP).astype(np.int64)
    change = np.zeros(2 * PARTS + 2, np.int64)
    np.add.at(change, first, 1)
    np.add.at(change, last + 1, -1)
    on = np.cumsum(change)[:-1] > 0
    found = on[:PARTS].copy()
    found |= on[PARTS : 2 * PARTS]
    found[0] |= on[2 * PARTS]  # where both begin and end on the last part
    return found


def smallest(parts: BoolArray) -> tuple[float, float]:
    """Start, 0 to 2 pi, and extent in radians of the smallest arc that holds all parts that are
    covered; of none, 0 and 0."""
    on = np.flatnonzero(parts)
    if not len(on):
        return 0.0, 0.0
    following = np.roll(on, -1)
    following[-1] += PARTS
    free = following - on - 1
    widest = int(free.argmax())
    if not free[widest]:
        return 0.0, 2 * np.pi
    return float(following[widest] % PARTS * STEP), float((PARTS - free[widest]) * STEP)
