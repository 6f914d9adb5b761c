"""Which level each plant of a tile is drawn as: what its distance asks for, or has room for.

A level may be used from its switch distance on (measure/distances.py), times the plant's scale.
Where a tile would have more triangles than it may, all its plants are drawn as if they were so many
times farther away, the least that is enough: then each has as many triangles for its size in the
picture as any other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.lod import Display
from vegtool.tiles.library import Species
from vegtool.tiles.stand import Stand

STEP = 2**0.125
"""Ratio of the distances that are tried."""
COARSEST = 2.0
"""Where plants would have to be drawn as if they were so many times farther away than they are,
their quarters' billboards are clustered anew."""
TRIES = 96
"""Of them: to 3,756 times the distance."""


def switches(species: Sequence[Species], display: Display) -> FloatArray:
    """(s, l) metres at which levels may be used on a display, of plants of scale 1; infinite where
    there is none."""
    most = max(len(one.levels) for one in species)
    found = np.full((len(species), most), np.inf)
    for index, one in enumerate(species):
        found[index, : len(one.levels)] = (
            one.switch_m * display.pixels_per_metre(1.0) / one.focal_px
        )
    return found


def triangles(species: Sequence[Species]) -> FloatArray:
    """(s, l) of each level; 0 where there is none."""
    most = max(len(one.levels) for one in species)
    found = np.zeros((len(species), most))
    for index, one in enumerate(species):
        found[index, : len(one.levels)] = one.triangles
    return found


def level_at(stand: Stand, switch_m: FloatArray, distance_m: float, least: int = 0) -> IntArray:
    """(n,) int32 the level of each plant at a distance; `least` or a coarser one, if there is one.

    switch_m: (s, l) as of `switches`.
    """
    away = np.full(len(stand), np.inf)
    np.divide(distance_m, stand.scale, out=away, where=stand.scale > 0)
    count = np.isfinite(switch_m).sum(axis=1)[stand.species]
    level = (away[:, None] >= switch_m[stand.species]).sum(axis=1) - 1
    return np.asarray(np.minimum(np.maximum(level, least), count - 1), dtype=np.int32)


def fitting(
    stand: Stand, switch_m: FloatArray, of_level: FloatArray, distance_m: float, most: int,
    least: int = 0,
) -> tuple[IntArray, float]:  # fmt: skip
    """(n,) int32 the levels at the least distance from `distance_m` on at which all plants together
    have no more than `most` triangles, or at the last one tried; and how many times that is.

    of_level: (s, l) as of `triangles`.
    """
    for index in range(TRIES):
        level = level_at(stand, switch_m, distance_m * STEP**index, least)
        if of_level[stand.species, level].sum() <= most:
            break
    return level, STEP**index
