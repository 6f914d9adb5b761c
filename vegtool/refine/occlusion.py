"""A plant whose own shade is in its colours: ambient occlusion.

Landis, "Production-ready global illumination" (2002): a point is darkened by the share of
directions from which the plant itself hides it. That share is the one that planes are weighed by:
foliage as a turbid medium (planes_seen.py), so nothing is drawn and single leaves cast no edges. It
goes into the colours of vertices, which everything that is made of the plant takes over: levels,
the original beside them, and the truth that both are measured against.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.clustering.features import quads
from vegtool.plant import Plant
from vegtool.refine.planes_pieces import pieces_of
from vegtool.refine.planes_seen import opacity, seen


def occluded(plant: Plant, strength: float) -> Plant:
    """The plant with vertex colours times 1 - strength x (share of directions that are hidden).

    strength: 0 for none, to 1. A vertex takes the mean of its faces, by area.
    """
    if strength <= 0 or not len(plant.faces):
        return plant
    factor = 1 - strength * (1 - open_shares(plant))
    corners = plant.faces.ravel()
    weight = np.repeat(plant.face_areas, 3)
    count = len(plant.positions)
    total = np.bincount(corners, weight, count)
    sums = np.bincount(corners, weight * np.repeat(factor, 3), count)
    at = np.divide(sums, total, out=np.ones(count), where=total > 0)
    colors = np.ones((count, 4)) if plant.colors is None else plant.colors.copy()
    colors[:, :3] *= at[:, None]
    return replace(plant, colors=colors)


def open_shares(plant: Plant) -> FloatArray:
    """(f,) 0 to 1: the share of directions from which nothing of the plant hides a face."""
    of_face = quads(plant)
    pieces, _, surface = pieces_of(plant, of_face)
    size = float(np.sqrt(pieces.weight @ pieces.weight * surface))
    return np.asarray(seen(pieces, surface, size, opacity(plant))[of_face])
