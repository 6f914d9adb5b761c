"""A part of the mesh with fewer and fewer triangles, and how wrong each is.

Edges are collapsed by their quadric error (meshes/collapse.py). Borders stay where what is beyond
them is drawn by others. A vertex is as far off as the triangles about what it has become are from
its place; area that is lost is not shown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.hybrid.cost import misplaced
from vegtool.meshes.collapse import Collapsed, carried, edges_collapsed
from vegtool.meshes.distance import to_triangles
from vegtool.meshes.pieces import Surface

FEWEST = 4
"""Triangles: of no more, none is left out."""
RATIO = 2**0.5
"""Of the triangles of one reduction to those of the next."""
AGGRESSIVE = 7.0
"""Of the collapse: edges go up to any error, those of the least first."""


@dataclass(frozen=True, eq=False)
class Reductions:
    """r of a surface of n triangles, the surface as it is first. became: of each, (n, 3) what has
    become of the corners, -1 for nothing. wrong: (r,) squared radii,
    what is displaced or not shown."""

    surfaces: tuple[Surface, ...]
    became: tuple[IntArray, ...]
    wrong: FloatArray

    @property
    def triangles(self) -> FloatArray:
        """(r,)"""
        return np.array([len(one.faces) for one in self.surfaces], dtype=np.float64)

    @property
    def area(self) -> FloatArray:
        """(r,) squared radii."""
        return np.array([one.areas.sum() for one in self.surfaces])


def reductions(surface: Surface, reach: float, borders: bool) -> Reductions:
    """Of a surface, down to FEWEST triangles or where no edge may go. borders: whether open ones
    stay."""
    surfaces, became, wrong = [surface], [surface.faces], [0.0]
    target = len(surface.faces) / RATIO
    while target >= FEWEST:
        made = edges_collapsed(surface, int(target), AGGRESSIVE, borders)
        if not 0 < len(made.faces) < len(surfaces[-1].faces):
            break
        surfaces.append(carried(surface, made))
        became.append(made.vertex)
        lost = max(0.0, float(surface.areas.sum() - surfaces[-1].areas.sum()))
        wrong.append(displaced(surface, made, reach) + lost)
        target = min(target, len(made.faces)) / RATIO
    return Reductions(tuple(surfaces), tuple(became), np.array(wrong))


def displaced(surface: Surface, made: Collapsed, reach: float) -> float:
    """Squared radii of a surface, by what their displacement costs."""
    used, first, local = np.unique(surface.faces, return_index=True, return_inverse=True)
    weight = np.bincount(local.ravel(), np.repeat(surface.areas / 3, 3), len(used))
    became = made.vertex.ravel()[first]
    corner = made.faces.ravel()
    order = np.argsort(corner, kind="stable")
    count = np.bincount(corner, minlength=len(made.positions))
    begin = np.cumsum(count) - count
    there = np.where(became >= 0, count[became], 0)
    row = np.repeat(np.arange(len(used)), there)
    nth = np.arange(len(row)) - np.repeat(np.cumsum(there) - there, there)
    triangle = order[begin[became[row]] + nth] // 3
    away = to_triangles(surface.positions[used][row], made.positions[made.faces[triangle]])
    least = np.full(len(used), np.inf)
    np.minimum.at(least, row, away)
    return float(weight @ misplaced(least, reach))
