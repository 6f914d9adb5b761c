"""Fewer, larger leaves.

Cook, Halstead, Planck, Ryu: Stochastic simplification of aggregate detail (2007): of many small
elements a random part is kept, and enlarged so that the area stays. Leaves overlap, and enlarged
ones less than those they stand for, so the area is kept to a power below one (GROWTH).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.meshes.pieces import Surface, pieces
from vegtool.seeding import generator

GROWTH = 0.4
"""Lengths grow with this power of the ratio of areas; 0.5 keeps the area. Measured best of 0.3 to
0.5 on ash, pine and bush, where coverage stays within a tenth (docs/methods/baselines.md)."""
LEAF_FACES = 2
"""Triangles that a leaf is left with where there are not enough for all as they are."""


def thinned(surface: Surface, target: int) -> Surface:
    """A random choice of the surface's pieces, enlarged about their middles.

    As many as `target` triangles allow, two to a piece: whole cards of two are left with no more
    than the target, larger leaves are for the collapse to reduce. The choice for a smaller target
    is part of that for a larger one.
    """
    count, piece = pieces(surface.faces)
    least = min(LEAF_FACES, len(surface.faces) / max(count, 1))
    kept = max(1, int(target / least))
    if kept >= count:
        return surface
    chosen = np.zeros(count, bool)
    chosen[generator(0, "thinning").permutation(count)[:kept]] = True
    shown = chosen[piece]
    part = surface.of(shown)
    areas = surface.areas
    before, after = areas.sum(), areas[shown].sum()
    if not after > 0:
        return part
    return _enlarged(part, piece[shown], float((before / after) ** GROWTH))


def _enlarged(surface: Surface, piece: IntArray, scale: float) -> Surface:
    """Every piece scaled about the mean of its vertices."""
    used, first = np.unique(surface.faces, return_index=True)
    owner = piece[first // 3]
    local: FloatArray = surface.positions[used]
    number = np.maximum(np.bincount(owner), 1)
    middle = np.stack([np.bincount(owner, axis) / number for axis in local.T], axis=1)[owner]
    positions = surface.positions.copy()
    positions[used] = middle + scale * (local - middle)
    return replace(surface, positions=positions)
