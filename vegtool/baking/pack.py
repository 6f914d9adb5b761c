"""Rectangles packed into one atlas.

Bottom-left along a skyline (Jylänki, A Thousand Ways to Pack the Bin, 2010, section 2.3), tallest
first. The skyline is kept as one height per column, so that the lowest place for a rectangle is a
running maximum: no list of nodes, and O(columns) a rectangle.

Both sides of the atlas are multiples of 4 (block compression asks for that), not powers of two:
every client of today samples such textures, and rounding up to powers of two would throw away a
third of the texels on average. `Packing.fill` is the share of the atlas that rectangles and
their gutters take; the gutters are what keeps neighbours apart in mips, so they count as used.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np
from scipy.ndimage import maximum_filter1d

from vegtool.arrays import IntArray

BLOCK = 4
"""Texels: both sides of an atlas are multiples of this."""
TRIES = 2_000
"""Rectangles placed in all while looking for the best width: few rectangles, many widths."""
MAX_WIDTHS = 16
ASPECT = 2.0
"""An atlas is at most this many times wider than high or the reverse, if the rectangles allow."""


@dataclass(frozen=True, eq=False)
class Packing:
    """Where the rectangles lie: rect (n, 4) int32 texels x0, y0, width, height, without gutter."""

    rect: IntArray
    width: int
    height: int
    gutter: int

    @property
    def fill(self) -> float:
        """Share of the atlas covered by rectangles, each with its gutter on all four sides."""
        grown = self.rect[:, 2:].astype(np.int64) + 2 * self.gutter
        return float(np.prod(grown, axis=1).sum() / (self.width * self.height))


def pack(sizes: IntArray, gutter: int, max_side: int) -> Packing:
    """Pack rectangles of `sizes` (n, 2) texels, each with `gutter` texels around it.

    Never wider than `max_side` unless a single rectangle is; the height is what it takes: the
    caller checks `Packing.height` against its limit. The same sizes give the same packing.
    """
    grown = np.asarray(sizes, dtype=np.int32) + 2 * gutter
    order = np.lexsort((np.arange(len(grown)), -grown[:, 0], -grown[:, 1]))
    best: tuple[tuple[int, int], IntArray, int, int] | None = None
    for width in _widths(grown, max_side):
        place, height = _skyline(grown[order], width)
        rank = (width * height, abs(width - height))
        if best is None or rank < best[0]:
            best = (rank, place, width, height)
    assert best is not None
    _, place, width, height = best
    rect = np.empty((len(grown), 4), dtype=np.int32)
    rect[order, :2] = place + gutter
    rect[:, 2:] = sizes
    return Packing(rect, width, height, gutter)


def _widths(grown: IntArray, max_side: int) -> list[int]:
    """Widths to try: around the square that the rectangles would fill to nine tenths."""
    area = float(grown.astype(np.float64).prod(axis=1).sum()) / 0.9
    tries = int(np.clip(TRIES // max(1, len(grown)), 1, MAX_WIDTHS))
    factors = np.linspace(1 / sqrt(ASPECT), sqrt(ASPECT), tries) if tries > 1 else np.ones(1)
    least, most = _blocks(int(grown[:, 0].max())), max_side - max_side % BLOCK
    wanted = (_blocks(ceil(sqrt(area) * f)) for f in factors)
    return sorted({max(least, min(most, w)) for w in wanted})


def _blocks(texels: int) -> int:
    return -(-texels // BLOCK) * BLOCK


def _skyline(grown: IntArray, width: int) -> tuple[IntArray, int]:
    """Upper left corners (n, 2) of rectangles placed in the given order, and the height used."""
    top = np.zeros(width, dtype=np.int32)
    place = np.empty((len(grown), 2), dtype=np.int32)
    for i, (w, h) in enumerate(grown.tolist()):
        # origin -(w // 2) turns the centred window into the one that starts at the column
        level = maximum_filter1d(top, w, mode="nearest", origin=-(w // 2))[: width - w + 1]
        x = int(level.argmin())
        y = int(level[x])
        top[x : x + w] = y + h
        place[i] = x, y
    return place, _blocks(int(top.max()))
