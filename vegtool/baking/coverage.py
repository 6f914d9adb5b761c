"""Alpha such that the alpha test shows, of each picture, as much as is covered.

Baked alpha is coverage: a texel half covered by twigs has 0.5, one crossed by a thin one 0.1.
Tested against a cutoff, everything thinner than half a texel is gone, trunks of far levels first,
and the mips that a client averages lose more. After Castano, "Computing alpha mipmaps" (2010),
alpha is raised or lowered until the area that passes equals the mean coverage; here for each
billboard's picture by itself, since one factor for an atlas feeds dense pictures at the cost of
thin ones, and over the two mips between which a level lives: it is meant for one texel per pixel at
its near end and two at its far end. Ranks are kept, so what grows is what was nearly there: the
shape of leaves and branches, not slabs. docs/methods/baking.md says what it does to real plants.

The gutter repeats the alpha of the picture's edge. A client that multisamples tests alpha at the
middle of the pixel, which for a quad thinner than that, a twig's, mostly lies beside it: were there
nothing, the twig would be lost, and all pictures half a texel of their edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray, IntArray

PASS = 128
"""Least alpha of 255 that a cutoff of 0.5 lets pass."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of 2 x 2 texels, one of mip 1 each, that show something of a picture: n of them.

    picture: (n,) which. alpha: (n, 4). inside: (n, 4) bool, texels of the picture; the others are
    its gutter's.
    """

    picture: IntArray
    alpha: ByteArray
    inside: npt.NDArray[np.bool_]


def coverage_kept(alpha: ByteArray, rects: IntArray, gutter: int = 0) -> ByteArray:
    """Alpha of an atlas, (h, w) uint8, remapped within each rectangle (p, 4) x0, y0, width, height.

    Per rectangle: the area that passes, averaged over mips 0 and 1, is as near as thresholds allow
    to the sum of alpha / 255. 0 stays 0 and 255 stays 255. `gutter` texels around each repeat its
    edge; rectangles lie at least two texels apart, as packing puts them, and h and w are even.
    Farther outside, alpha stays.
    """
    repeated = edges_repeated(alpha, rects, gutter)
    owner = owners(alpha.shape, rects)
    blocks = covered_blocks(repeated, owner)
    table = tables(thresholds(blocks, len(rects)))
    inside = owner >= 0
    repeated[inside] = table[owner[inside], alpha[inside]]
    return edges_repeated(repeated, rects, gutter)


def edges_repeated(alpha: ByteArray, rects: IntArray, gutter: int) -> ByteArray:
    """A copy in which `gutter` texels around each rectangle have the alpha of its nearest texel."""
    result = alpha.copy()
    if gutter:
        for x, y, w, h in rects.tolist():
            around = np.s_[y - gutter : y + h + gutter, x - gutter : x + w + gutter]
            result[around] = np.pad(alpha[y : y + h, x : x + w], gutter, mode="edge")
    return result


def thresholds(blocks: Blocks, count: int) -> IntArray:
    """(count,) alpha from which on texels are to pass.

    By bisection, since less passes the higher the threshold is. PASS where it does as well, so
    that what is cut out sharply stays as it is.
    """
    covered = np.bincount(
        blocks.picture, (blocks.alpha * blocks.inside).sum(axis=1) / 255.0, minlength=count
    )
    low, high = np.ones(count, np.int32), np.full(count, 255, np.int32)
    while (low < high).any():  # towards the least one that lets no more pass than is covered
        middle = (low + high) // 2
        less = passing(blocks, middle) <= covered
        low, high = np.where(less, low, middle + 1), np.where(less, middle, high)
    choices = np.stack([np.full_like(low, PASS), low, np.maximum(low - 1, 1)])
    miss = np.stack([np.abs(passing(blocks, t) - covered) for t in choices])
    return np.asarray(choices[miss.argmin(axis=0), np.arange(count)])


def owners(shape: tuple[int, ...], rects: IntArray) -> IntArray:
    """(h, w) int32: the rectangle that each texel lies in, -1 for none."""
    owner = np.full(shape, -1, dtype=np.int32)
    for index, (x, y, w, h) in enumerate(rects.tolist()):
        owner[y : y + h, x : x + w] = index
    return owner


def covered_blocks(alpha: ByteArray, owner: IntArray) -> Blocks:
    """The blocks that reach into a picture and are not all 0; alpha: gutters included."""
    height, width = alpha.shape

    def blocks(image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        cut = image.reshape(height // 2, 2, width // 2, 2)
        return cut.transpose(0, 2, 1, 3).reshape(-1, 4)

    picture, shown = blocks(owner), blocks(alpha)
    inside = picture >= 0
    kept = inside.any(axis=1) & shown.any(axis=1)
    return Blocks(picture[kept].max(axis=1), shown[kept], inside[kept])


def passing(blocks: Blocks, threshold: IntArray) -> FloatArray:
    """(p,) texels of mip 0 that pass, on average over both mips, with those thresholds (p,)."""
    mapped = tables(threshold)[blocks.picture[:, None], blocks.alpha]
    fine = ((mapped >= PASS) & blocks.inside).sum(axis=1)
    passes = mapped.sum(axis=1, dtype=np.int32) > 4 * (PASS - 1) + 1  # rounded to PASS
    area = 0.5 * (fine + blocks.inside.sum(axis=1) * passes)
    return np.bincount(blocks.picture, area, minlength=len(threshold)).astype(np.float64)


def tables(threshold: IntArray) -> ByteArray:
    """(p, 256) uint8: straight from 0 to PASS at the threshold, and on to 255."""
    old = np.arange(256, dtype=np.float64)
    at: FloatArray = threshold[:, None].astype(np.float64)
    below = np.minimum(np.floor(old * PASS / at), PASS - 1)
    above = 255 - (255 - old) * ((255 - PASS) / np.maximum(255 - at, 1))
    return np.asarray(np.where(old < at, below, np.round(above)), dtype=np.uint8)
