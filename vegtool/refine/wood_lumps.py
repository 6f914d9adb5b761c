"""Wood that is no stem, as a trunk with roots, a stump, a board: its own surface, reduced.

By quadric edge collapse (Garland, Heckbert: Surface simplification using quadric error metrics,
1997; fast-simplification) to a few numbers of triangles, each swollen about the wood's axis until
it covers as much as the original: collapsed edges cut across what is round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit
from vegtool.refine.hits import Rays, hits, rays_met
from vegtool.refine.wood_lines import Ints

LEAST = 12
"""Triangles: with fewer, nothing is left of a shape."""
RATIO = 1.3
"""From one number of triangles to the next."""
MOST = 1_000
"""Triangles: with more there is no need to reduce."""
BULK = 20_000
"""Triangles: more are collapsed to so many first, once for all."""
SWELLING = 1.3
"""The most that a lump is swollen or shrunk by."""
CELLS, ROOM = 128, 1.2
"""Of the grids on which lumps are compared: with less room, what swells is cut off."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What is reduced. positions: (v, 3). faces: (f, 3). colors: (f, 3) of the faces. axis: (n, 3)
    points along its middle."""

    positions: FloatArray
    faces: Ints
    colors: FloatArray
    axis: FloatArray

    def of(self, which: npt.NDArray[np.bool_]) -> Surface:
        """The surface of some faces, (f,) bool."""
        used, corner = np.unique(self.faces[which], return_inverse=True)
        return Surface(self.positions[used], corner.reshape(-1, 3), self.colors[which], self.axis)


@dataclass(frozen=True, eq=False)
class Lump:
    """A surface reduced. positions, normals: (v, 3). colors: (v, 3) linear. faces: (t, 3). wrong:
    the area that it covers and the original does not or the reverse, in the mean over all views."""

    positions: FloatArray
    normals: FloatArray
    colors: FloatArray
    faces: Ints
    wrong: float


def lumps(surface: Surface) -> tuple[float, tuple[Lump, ...]]:
    """What the surface covers in the mean over all views, and it with fewer and fewer triangles."""
    found: list[Lump] = []
    positions, faces = surface.positions, surface.faces
    if len(faces) > BULK:
        positions, faces = collapsed(positions, faces, BULK)
    corners = surface.positions[surface.faces]
    rays = Rays.around(corners, cells=CELLS, room=ROOM, half=True)
    truth = rays_met(rays, hits(rays, corners))
    target = float(min(MOST, len(faces)))
    while target >= LEAST:
        left, triangles = collapsed(positions, faces, int(target))
        if len(triangles) and (not found or len(triangles) < len(found[-1].faces)):
            found.append(_lump(surface, left, triangles, rays, truth))
        target = min(target, float(len(triangles))) / RATIO
    return float(truth.sum() * rays.cell), tuple(found)


def collapsed(positions: FloatArray, faces: Ints, target: int) -> tuple[FloatArray, Ints]:
    """The surface with at most `target` triangles, or as few as there can be."""
    from fast_simplification import simplify

    if len(faces) <= target:
        return positions, faces
    left, triangles = simplify(positions, faces.astype(np.int32), target_count=target)
    used, corner = np.unique(triangles, return_inverse=True)
    return np.asarray(left[used], dtype=np.float64), corner.reshape(-1, 3).astype(np.int64)


def _lump(
    surface: Surface,
    positions: FloatArray,
    faces: Ints,
    rays: Rays,
    truth: npt.NDArray[np.bool_],
) -> Lump:
    """The lump of a surface with its edges collapsed."""
    from scipy.spatial import cKDTree

    foot = surface.axis[cKDTree(surface.axis).query(positions)[1]]
    swell, made = 1.0, rays_met(rays, hits(rays, positions[faces]))
    for _ in range(2):
        if made.any():
            swell = float(np.clip(swell * truth.sum() / made.sum(), 1 / SWELLING, SWELLING))
        swollen = foot + (positions - foot) * swell
        made = rays_met(rays, hits(rays, swollen[faces]))
    return Lump(
        swollen,
        _normals(swollen, faces),
        _colors(surface, positions),
        faces,
        float((made != truth).sum() * rays.cell),
    )


def _normals(positions: FloatArray, faces: Ints) -> FloatArray:
    """(v, 3) means over the faces around each vertex, by area.

    The original's own normals, averaged, light a lump by up to a fifth too brightly: what lies
    across its axis, at a foot or an end, reaches as far as its long triangles do.
    """
    normal = _area_vectors(positions[faces])
    total = [np.bincount(faces.ravel(), np.repeat(n, 3), len(positions)) for n in normal.T]
    mean = np.stack(total, axis=1).astype(np.float64)
    mean[np.linalg.norm(mean, axis=1) < 1e-12 * np.abs(mean).max()] = [0.0, 1.0, 0.0]
    return unit(mean)


def _colors(surface: Surface, positions: FloatArray) -> FloatArray:
    """(v, 3) means over the original's faces that are nearest to each vertex, by area; of the
    nearest face where there are none."""
    from scipy.spatial import cKDTree

    corners = surface.positions[surface.faces]
    area, middle = np.linalg.norm(_area_vectors(corners), axis=1), corners.mean(axis=1)
    near = cKDTree(positions).query(middle)[1]
    weight = np.bincount(near, area, len(positions))
    total = [np.bincount(near, area * c, len(positions)) for c in surface.colors.T]
    mean = np.stack(total, axis=1) / np.where(weight > 0, weight, 1.0)[:, None]
    nearest = surface.colors[cKDTree(middle).query(positions)[1]]
    return np.asarray(np.where(weight[:, None] > 0, mean, nearest))


def _area_vectors(corners: FloatArray) -> FloatArray:
    """(f, 3) along the normals of triangles (f, 3, 3)."""
    edge, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(0.5 * np.cross(edge, other))
