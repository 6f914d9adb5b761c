"""Alpha such that the alpha test shows, of each picture, as much as is covered.

Baked alpha is coverage: a texel half covered by twigs has 0.5, one crossed by a thin one 0.1.
Tested against a cutoff, everything thinner than half a texel is gone, trunks of far levels first,
and the mips that a client averages lose more. After Castano, "Computing alpha mipmaps" (2010),
alpha is raised or lowered until the area that passes equals the mean coverage; here for each
billboard's picture by itself, since one factor for an atlas feeds dense pictures at the cost of
thin ones, and over the two mips between which a level lives: it is meant for one texel per pixel at
its near end and two at its far end. Ranks are kept, so what grows is what was nearly there: the
shape of leaves and branches, not slabs. docs/methods/baking.md says what it does to real plants.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray, IntArray

PASS = 128
"""Least alpha of 255 that a cutoff of 0.5 lets pass."""


def coverage_kept(alpha: ByteArray, rects: IntArray) -> ByteArray:
    """Alpha of an atlas, (h, w) uint8, remapped within each rectangle (p, 4) x0, y0, width, height.

    Per rectangle: the area that passes, averaged over mips 0 and 1, is as near as thresholds allow
    to the sum of alpha / 255. 0 stays 0 and 255 stays 255. Rectangles must lie at least two texels
    apart, as packing puts them; h and w are even. Outside, alpha stays.
    """
    owner = owners(alpha.shape, rects)
    picture, blocks = covered_blocks(alpha, owner)
    table = tables(thresholds(blocks, picture, len(rects)))
    result = alpha.copy()
    inside = owner >= 0
    result[inside] = table[owner[inside], alpha[inside]]
    return result


def thresholds(blocks: ByteArray, picture: IntArray, count: int) -> IntArray:
    """(count,) alpha from which on texels are to pass, of the blocks of `covered_blocks`.

    By bisection, since less passes the higher the threshold is. PASS where it does as well, so
    that what is cut out sharply stays as it is.
    """
    covered = np.bincount(picture, blocks.sum(axis=1) / 255.0, minlength=count)
    low, high = np.ones(count, np.int32), np.full(count, 255, np.int32)
    while (low < high).any():  # towards the least one that lets no more pass than is covered
        middle = (low + high) // 2
        less = passing(blocks, picture, middle) <= covered
        low, high = np.where(less, low, middle + 1), np.where(less, middle, high)
    choices = np.stack([np.full_like(low, PASS), low, np.maximum(low - 1, 1)])
    miss = np.stack([np.abs(passing(blocks, picture, t) - covered) for t in choices])
    return np.asarray(choices[miss.argmin(axis=0), np.arange(count)])


def owners(shape: tuple[int, ...], rects: IntArray) -> IntArray:
    """(h, w) int32: the rectangle that each texel lies in, -1 for none."""
    owner = np.full(shape, -1, dtype=np.int32)
    for index, (x, y, w, h) in enumerate(rects.tolist()):
        owner[y : y + h, x : x + w] = index
    return owner


def covered_blocks(alpha: ByteArray, owner: IntArray) -> tuple[IntArray, ByteArray]:
    """(n,), (n, 4): picture and alphas of the blocks of 2 x 2 texels, one of mip 1, not all 0."""
    height, width = alpha.shape

    def blocks(image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        cut = image.reshape(height // 2, 2, width // 2, 2)
        return cut.transpose(0, 2, 1, 3).reshape(-1, 4)

    shown = blocks(np.where(owner >= 0, alpha, 0).astype(np.uint8))
    kept = shown.any(axis=1)
    return blocks(owner)[kept].max(axis=1), shown[kept]


def passing(blocks: ByteArray, picture: IntArray, threshold: IntArray) -> FloatArray:
    """(p,) texels of mip 0 that pass, on average over both mips, with those thresholds (p,)."""
    mapped = tables(threshold)[picture[:, None], blocks]
    fine = (mapped >= PASS).sum(axis=1)
    coarse = 4 * (mapped.sum(axis=1, dtype=np.int32) > 4 * (PASS - 1) + 1)  # rounded to PASS
    area = 0.5 * (fine + coarse)
    return np.bincount(picture, area, minlength=len(threshold)).astype(np.float64)


def tables(threshold: IntArray) -> ByteArray:
    """(p, 256) uint8: straight from 0 to PASS at the threshold, and on to 255."""
    old = np.arange(256, dtype=np.float64)
    at: FloatArray = threshold[:, None].astype(np.float64)
    below = np.minimum(np.floor(old * PASS / at), PASS - 1)
    above = 255 - (255 - old) * ((255 - PASS) / np.maximum(255 - at, 1))
    return np.asarray(np.where(old < at, below, np.round(above)), dtype=np.uint8)
