"""How much of the wood is seen from outside, through the leaves.

What stands before a point is taken as spread evenly over a cell of a grid across the view: leaves
of area a before a cell of area c let exp(-a / c) through (Monsi and Saeki, 1953; a counts as seen
from there, without what is cut out of it).
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.plant import Plant
from vegtool.refine.face_texels import opacities

DIRECTIONS = 12
CELLS = 24
"""Across the plant."""


def seen_through(plant: Plant, others: IntArray, points: FloatArray) -> tuple[FloatArray, float]:
    """(n,) 0 to 1, how much is seen of points (n, 3), metres, behind the faces `others`, (k,); and
    the square metres that these cover. Both in the mean over directions from all around."""
    if not len(others):
        return np.ones(len(points)), 0.0
    center, radius = plant.center, plant.radius
    covering = plant.face_area_vectors[others] * opacities(plant, others)[:, None] / radius**2
    leaves = (plant.face_centroids[others] - center) / radius
    local = (points - center) / radius
    nth = np.arange(DIRECTIONS)
    height = 1 - (2 * nth + 1) / DIRECTIONS
    turn = np.pi * nth * (3 - 5**0.5)
    across = np.sqrt(1 - height * height)
    views = np.stack([across * np.cos(turn), height, across * np.sin(turn)], axis=1)
    seen, covered, size = np.zeros(len(points)), 0.0, (2 / CELLS) ** 2
    for view in views:
        right = np.cross([0.0, 1.0, 0.0], view)
        right /= np.linalg.norm(right)
        frame = np.stack([right, np.cross(view, right)], axis=1)
        both = np.concatenate([leaves, local])
        cell = np.clip(((both @ frame + 1) / 2 * CELLS).astype(np.int64), 0, CELLS - 1)
        key = cell[:, 0] * CELLS + cell[:, 1]
        order = np.lexsort((-(both @ view), key))
        area = np.append(np.abs(covering @ view), np.zeros(len(points)))[order]
        total = np.cumsum(area)
        start = np.searchsorted(key[order], key[order])
        before = np.empty(len(both))
        before[order] = total - total[start] + area[start]
        seen += np.exp(-before[len(leaves) :] / size)
        covered += size * float((1 - np.exp(-np.bincount(key[order], area) / size)).sum())
    return seen / DIRECTIONS, covered / DIRECTIONS * radius**2
