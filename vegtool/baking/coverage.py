"""Alpha such that the alpha test shows, of each picture, as much as is covered.

Baked alpha is coverage: a texel half covered by twigs has 0.5, one crossed by a thin one 0.1.
Tested against a cutoff, everything thinner than half a texel is gone, trunks of far levels first.
After Castano, "Computing alpha mipmaps" (2010), alpha is raised or lowered until the share of
texels that pass equals the mean coverage; here for each billboard's picture by itself, since one
factor for an atlas feeds dense pictures at the cost of thin ones. Ranks are kept, so what grows is
what was nearly there: the shape of leaves and branches, not slabs. docs/methods/baking.md says
what it does to real plants.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.arrays import ByteArray, FloatArray, IntArray

PASS = 128
"""Least alpha of 255 that a cutoff of 0.5 lets pass."""


def coverage_kept(alpha: ByteArray, rects: IntArray) -> ByteArray:
    """Alpha of an atlas, (h, w) uint8, remapped within each rectangle (p, 4) x0, y0, width, height.

    Per rectangle: the number of texels that pass is the nearest that thresholds allow to the sum of
    alpha / 255. 0 stays 0 and 255 stays 255. Rectangles must not overlap; outside, alpha stays.
    """
    result = alpha.copy()
    slices = [np.s_[y : y + h, x : x + w] for x, y, w, h in rects.tolist()]
    counts = np.stack([np.bincount(alpha[s].ravel(), minlength=256) for s in slices]).astype(int)
    for where, table in zip(slices, tables(thresholds(counts)), strict=True):
        result[where] = table[alpha[where]]
    return result


def thresholds(counts: npt.NDArray[np.int64]) -> IntArray:
    """(p,) alpha from which on texels are to pass, of histograms (p, 256).

    Of equally good ones the nearest to PASS, so that what passes rightly already stays as it is.
    """
    passing = counts[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]  # texels with alpha >= 1, ..., 255
    covered = counts @ (np.arange(256) / 255.0)
    miss = np.abs(passing - covered[:, None])
    distance = np.abs(np.arange(1, 256) - PASS)
    best = miss <= miss.min(axis=1, keepdims=True) + 1e-9  # texels
    return np.asarray(1 + np.where(best, distance, 256).argmin(axis=1), dtype=np.int32)


def tables(threshold: IntArray) -> ByteArray:
    """(p, 256) uint8: straight from 0 to PASS at the threshold, and on to 255."""
    old = np.arange(256, dtype=np.float64)
    at: FloatArray = threshold[:, None].astype(np.float64)
    below = np.minimum(np.floor(old * PASS / at), PASS - 1)
    above = 255 - (255 - old) * ((255 - PASS) / np.maximum(255 - at, 1))
    return np.asarray(np.where(old < at, below, np.round(above)), dtype=np.uint8)
