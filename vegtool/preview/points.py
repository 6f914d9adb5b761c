"""Surfels of a landscape from one eye: how many of each plant's, and how large their discs are.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vegtool.arrays import ByteArray, FloatArray
from vegtool.gl.instances import WHOLE
from vegtool.gl.landscape import Landscape, PointBatch
from vegtool.preview.choice import Chosen, Seen, width


def point_batches(
    landscape: Landscape, pieces: Mapping[int, Sequence[int]], found: Seen, what: Chosen,
    focal_px: float, size_px: FloatArray | None = None, paint: ByteArray | None = None,
) -> tuple[PointBatch, ...]:  # fmt: skip
    """What was chosen that is surfels.

    pieces: sets of surfels of the landscape, by the model that they are. focal_px: pixels of a
    metre at a distance of one. size_px: (n,) of each plant that is seen, the diameter of discs in
    pixels, where there are as many surfels as that takes; None for 1. paint: (m, 4) in place of the
    plants' own tints. Of plants that fade, fewer are drawn; discs stay as they are.
    """
    batches = []
    for index in np.unique(what.model[what.points]):
        here = np.flatnonzero(what.points & (what.model == index))
        stock = found.rows[what.of[here]]
        place, scale = found.place[what.of[here]].astype(np.float64), stock["scale"]
        turn = np.arctan2(stock["turn"][:, 1], stock["turn"][:, 0])
        wide = width(stock["vanish"], found.spare[what.of[here]])
        tint = stock["tint"] if paint is None else paint[here]
        share = np.minimum(what.kept[here] / WHOLE, 1.0)
        size = np.ones(len(here)) if size_px is None else size_px[what.of[here]]
        for piece in pieces[int(index)]:
            surfels = landscape.surfels(piece)
            pixel = surfels.pixels(np.zeros(3), place, turn, scale, focal_px)
            prefix, radius = surfels.surfels.discs(size * pixel / 2)
            radius *= what.length[here]
            rows = surfels.instances(np.zeros(3), place, turn, scale, radius, wide, tint)
            batches.append(PointBatch(piece, rows, np.ceil(share * prefix).astype(np.int32)))
    return tuple(batches)
