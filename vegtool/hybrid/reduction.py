"""A part of the mesh with fewer and fewer triangles, and how wrong each is.

Edges are collapsed by their quadric error (meshes/collapse.py). Borders stay where what is beyond
them is drawn by others. A vertex is as far off as the triangles about what it has become are from
its place; area that is lost is not shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.hybrid.cost import misplaced
from vegtool.hybrid.skirt import edges_collapsed_in_skirt, sideways
from vegtool.meshes.collapse import Collapsed, carried, edges_collapsed
from vegtool.meshes.distance import to_triangles
from vegtool.meshes.pieces import Surface, open_edges
from vegtool.seeding import generator

Borders = Literal["stay", "skirted", "free"]
"""What becomes of open ones: nothing; edges go where they are straight (skirt.py); or anything."""
FEWEST = 4
"""Triangles: of no more, none is left out."""
RATIO = 2**0.25
"""Of the triangles of one reduction to those of the next."""
AGGRESSIVE = 7.0
"""Of the collapse: edges go up to any error, those of the least first."""
ROUGH = 1e-4
"""Roots of a surface's area, by which its vertices are moved out or in before it is reduced."""


@dataclass(frozen=True, eq=False)
class Reductions:
    """r of a surface of n triangles, the surface as it is first. became: of each, (n, 3) what has
    become of the corners, -1 for nothing. wrong: (r,) squared radii, what is displaced or not
    shown."""

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


def reductions(surface: Surface, reach: float, borders: Sequence[Borders]) -> Reductions:
    """Of a surface, down to FEWEST triangles or where no edge may go. borders: what becomes of open
    ones; after what the first comes to, the next."""
    surfaces, became, wrong = [surface], [surface.faces], [0.0]
    whole = float(surface.areas.sum())
    for border in borders:
        target = len(surfaces[-1].faces) / RATIO
        while target >= FEWEST:
            made = collapsed(surface, int(target), border)
            if not 0 < len(made.faces) < len(surfaces[-1].faces):
                break
            surfaces.append(carried(surface, made))
            became.append(made.vertex)
            lost = max(0.0, whole - float(surfaces[-1].areas.sum()))
            wrong.append(min(displaced(surface, made, reach) + lost, whole))
            target = min(target, len(made.faces)) / RATIO
    return Reductions(tuple(surfaces), tuple(became), np.array(wrong))


def collapsed(surface: Surface, target: int, borders: Borders) -> Collapsed:
    """Edges collapsed in lengths of the surface's own size, for errors up to fixed ones go first;
    and roughly, for where a surface is flat, errors are alike everywhere and what is least is
    rounding. To about `target` triangles."""
    used, first, local = np.unique(surface.faces, return_index=True, return_inverse=True)
    faces = local.reshape(-1, 3).astype(np.int32)
    size = size_of(surface) or 1.0
    exact = surface.positions[used]
    noise = generator(0, "hybrid", "rough").uniform(-ROUGH, ROUGH, surface.faces.size)[first]
    normals = outward(exact / size, faces)
    rough = normals if borders != "skirted" else normals + sideways(exact / size, faces, normals)
    own = Surface(exact / size + noise[:, None] * rough, faces, surface.corners)
    if borders == "skirted":
        made = edges_collapsed_in_skirt(own, normals, target, AGGRESSIVE)
    else:
        made = edges_collapsed(own, target, AGGRESSIVE, borders == "stay")
    if not len(made.faces):
        return made
    positions = size * made.positions
    still = made.vertex >= 0
    still[still] = (made.positions[made.vertex[still]] == own.positions[faces[still]]).all(axis=1)
    positions[made.vertex[still]] = exact[faces[still]]
    return replace(made, positions=positions)


def outward(positions: FloatArray, faces: IntArray) -> FloatArray:
    """(w, 3) unit normals of vertices, by the areas of the faces about them."""
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    area = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    corner = faces.ravel()
    return unit(np.stack([np.bincount(corner, x, len(positions)) for x in area.T], axis=1))


def displaced(surface: Surface, made: Collapsed, reach: float) -> float:
    """Squared radii of a surface, by what their displacement costs; at open borders, what is
    missing where they move."""
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
    faces = local.reshape(-1, 3).astype(np.int32)
    border = border_lengths(faces, surface.positions[used])
    missing = border @ np.minimum(least, size_of(surface))
    return float(weight @ misplaced(least, reach) + missing)


def border_lengths(faces: IntArray, positions: FloatArray) -> FloatArray:
    """(w,) half of the lengths of the open edges that meet in each vertex: where these move, so
    much surface is missing, or too much, for each unit of length."""
    edge = open_edges(faces)
    length = np.linalg.norm(positions[edge[:, 0]] - positions[edge[:, 1]], axis=1)
    half = np.repeat(length / 2, 2)
    return np.asarray(np.bincount(edge.ravel(), half, len(positions)), dtype=np.float64)


def size_of(surface: Surface) -> float:
    """Radii: root of its area."""
    return float(np.sqrt(surface.areas.sum()))
