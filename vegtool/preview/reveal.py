"""The order in which a crossfade reveals texels: blue noise, at every size of texel.

Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes using
hybrid level-of-detail approaches (2005), section 4: billboards appear as the threshold of their
alpha test falls from 1.0 to 0.5. There alpha itself is the order, so that what appears first is
what is covered most, in lumps. Here the order is a blue noise made by void-and-cluster (Ulichney
1993), laid over the texels of any atlas: what a step reveals is spread evenly, and of all that is
covered each step reveals the same share.

The noise has a mip chain of its own, each level as evenly spread as the first; averages would hide
or show all at once. A GPU interpolates between texels, which draws values to the middle:
`threshold_of` says below which of them a wanted share lies.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from vegtool.arrays import ByteArray, FloatArray
from vegtool.seeding import generator

SIZE = 64
"""Texels along a side of the noise."""
SIGMA = 1.5
"""Texels: standard deviation of the energy of void-and-cluster, as its author found best."""
STARTED = 0.1
"""Share of the texels that the first pattern has."""
BETWEEN = 8
"""Places along a texel at which interpolated values are counted."""
SMALLEST = 8
"""Texels along a side of its smallest mip level: below, there are too few values."""


@cache
def noise() -> tuple[ByteArray, ...]:
    """By mip level, (s, s) uint8 with s from SIZE down to SMALLEST: all values equally often."""
    sizes = [size for level in range(SIZE.bit_length()) if (size := SIZE >> level) >= SMALLEST]
    levels = []
    for size in sizes:
        rank = void_and_cluster(size)
        level = ((rank + 0.5) * 256 / rank.size).astype(np.uint8)
        level.flags.writeable = False
        levels.append(level)
    return tuple(levels)


def threshold_of(share: FloatArray) -> FloatArray:
    """The value of the interpolated noise, 0 to 1, below which a share of it lies; 0 for none, 2
    for all."""
    at, values = _quantiles()
    inside = np.interp(share, at, values)
    return np.where(share <= 0, 0.0, np.where(share >= 1, 2.0, inside))


@cache
def _quantiles() -> tuple[FloatArray, FloatArray]:
    """Shares and the values of the interpolated noise below which they lie."""
    values = np.sort(interpolated(noise()[0] / 255.0, BETWEEN).ravel())
    at = np.linspace(0, 1, 257)
    return at, np.quantile(values, at)


def interpolated(texels: FloatArray, places: int) -> FloatArray:
    """(s places, s places) what a GPU's bilinear filter makes of a repeated texture (s, s)."""
    share = (np.arange(places) + 0.5) / places
    for axis in (0, 1):
        after = np.roll(texels, -1, axis)
        parts = [texels + (after - texels) * s for s in share]
        stacked = np.stack(parts, axis=axis + 1)
        shape = list(texels.shape)
        shape[axis] *= places
        texels = stacked.reshape(shape)
    return texels


def void_and_cluster(size: int) -> np.ndarray:
    """(size, size) int64: the texels of a repeated square in an order whose every first part is
    spread evenly."""
    count = size * size
    if count == 1:
        return np.zeros((1, 1), np.int64)
    away = np.minimum(np.arange(size), size - np.arange(size))
    spread = np.exp(-(away[:, None] ** 2 + away**2) / (2 * SIGMA**2))
    energy = _Energy(spread)
    first = max(1, round(STARTED * count))
    rng = generator(0, "void-and-cluster", size)
    chosen = np.zeros(count, bool)
    for index in rng.permutation(count)[:first]:
        chosen[index] = True
        energy.add(index, 1.0)
    for _ in range(4 * count):  # the tightest cluster moves into the largest void
        cluster = energy.highest(chosen)
        chosen[cluster] = False
        energy.add(cluster, -1.0)
        void = energy.lowest(~chosen)
        chosen[void] = True
        energy.add(void, 1.0)
        if void == cluster:
            break
    rank = np.empty(count, np.int64)
    start, kept = energy.copy(), chosen.copy()
    for place in range(first - 1, -1, -1):
        cluster = start.highest(kept)
        rank[cluster] = place
        kept[cluster] = False
        start.add(cluster, -1.0)
    for place in range(first, count):
        void = energy.lowest(~chosen)
        rank[void] = place
        chosen[void] = True
        energy.add(void, 1.0)
    return rank.reshape(size, size)


class _Energy:
    """How crowded every texel of a repeated square is."""

    def __init__(self, spread: FloatArray) -> None:
        self.spread = spread
        self.field = np.zeros(spread.shape)

    def copy(self) -> _Energy:
        other = _Energy(self.spread)
        other.field = self.field.copy()
        return other

    def add(self, index: int, sign: float) -> None:
        row, column = divmod(int(index), len(self.spread))
        self.field += sign * np.roll(self.spread, (row, column), (0, 1))

    def highest(self, among: np.ndarray) -> int:
        return int(np.argmax(np.where(among, self.field.ravel(), -np.inf)))

    def lowest(self, among: np.ndarray) -> int:
        return int(np.argmin(np.where(among, self.field.ravel(), np.inf)))
