"""Closed bodies as a scanner gives them: limbs blended into one surface, with fine relief, in
triangles of the number asked for.

The surface is where a field of distances is zero: that of tapering limbs, united by the smooth
minimum of I. Quilez, "Smooth minimum" (2013), quadratic polynomial. It is triangulated by marching
cubes, somewhat finer than asked and evened out along the surface, moved along its normals by the
relief, and collapsed by quadric error to the exact number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from solids.shapes import linear
from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.growth.solids import vertex_normals
from vegtool.meshes.collapse import edges_collapsed
from vegtool.meshes.pieces import Surface
from vegtool.plant import Material, Plant

FINER = 1.15
"""Triangles before the collapse, as a multiple of those asked for, about."""
PER_CELL = 2.85
"""Triangles that marching cubes make on so much surface as one face of a cell has, about."""
COARSE = 64
"""Cells along the longest side of a body whose area is measured."""
AGGRESSIVENESS = 2.0
"""Of the collapse: how fast its threshold rises. Higher ones fold surfaces."""
ROUNDS = 4
"""Of evening out what marching cubes make."""
STEEPEST = 0.95
"""Of a limb's radius, along it: beyond, its ends lie in each other."""

Relief = Callable[[FloatArray, FloatArray], FloatArray]
"""From positions and normals (v, 3) to how far outward each goes, (v,) metres."""


@dataclass(frozen=True, eq=False)
class Limb:
    """A ball drawn from a start to an end, (3,) metres, while its radius goes from one to another.

    side, flat: its radius along that direction is `flat` times that across. blend: metres within
    which it melts into what is there before it. cut: whether it is taken away instead.
    """

    start: FloatArray
    end: FloatArray
    radius: tuple[float, float]
    side: FloatArray
    flat: float
    blend: float
    cut: bool

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) metres."""
        ends = np.stack([self.start, self.end])
        reach = np.array(self.radius)[:, None] * max(1.0, self.flat)
        return np.stack([(ends - reach).min(axis=0), (ends + reach).max(axis=0)])

    def distance(self, points: FloatArray) -> FloatArray:
        """(...,) metres of points (..., 3), negative inside; true near the surface."""
        along = self._squashed(self.end - self.start)
        length = max(float(np.linalg.norm(along)), 1e-9)
        along = along / length
        offset = self._squashed(points - self.start)
        axial = offset @ along
        aside = np.sqrt(np.maximum(np.einsum("...i,...i", offset, offset) - axial**2, 0.0))
        # the ball that is nearest lies where the cone's surface is met at a right angle
        slope = np.clip((self.radius[1] - self.radius[0]) / length, -STEEPEST, STEEPEST)
        place = np.clip(axial + slope / sqrt(1 - slope**2) * aside, 0.0, length)
        offset = offset - place[..., None] * along
        away = np.linalg.norm(offset, axis=-1)
        # what one metre on the way outward is in squashed ones
        steep = np.linalg.norm(self._squashed(offset), axis=-1)
        scale = np.divide(away, steep, out=np.ones_like(away), where=steep > 1e-9)
        return (away - np.interp(place, (0.0, length), self.radius)) * scale

    def _squashed(self, vectors: FloatArray) -> FloatArray:
        return vectors + (vectors @ self.side)[..., None] * ((1 / self.flat - 1) * self.side)


def limbs(
    path: npt.ArrayLike,
    radius: Sequence[float],
    blend: float,
    side: npt.ArrayLike = (0.0, 0.0, 1.0),
    flat: float = 1.0,
    cut: bool = False,
) -> list[Limb]:
    """One after another along a path (n, 3) with n radii; of one point, a ball."""
    path = np.asarray(path, dtype=np.float64)
    if len(path) == 1:
        path, radius = np.repeat(path, 2, axis=0), [*radius, *radius]
    side = unit(np.asarray(side, dtype=np.float64))
    return [
        Limb(path[i], path[i + 1], (radius[i], radius[i + 1]), side, flat, blend, cut)
        for i in range(len(path) - 1)
    ]


def mirrored(parts: Sequence[Limb]) -> list[Limb]:
    """To the other side of the plane z = 0."""
    other = np.array([1.0, 1.0, -1.0])
    return [
        replace(limb, start=limb.start * other, end=limb.end * other, side=limb.side * other)
        for limb in parts
    ]


def folded(points: FloatArray) -> FloatArray:
    """Points (v, 3), those of the other side of the plane z = 0 mirrored to this one."""
    return np.column_stack([points[:, :2], np.abs(points[:, 2])])


def nearest(parts: Sequence[Limb], points: FloatArray) -> FloatArray:
    """(v,) metres of points (v, 3) to the nearest of some limbs, negative inside."""
    return np.min([limb.distance(points) for limb in parts], axis=0)


def surface(parts: Sequence[Limb], spacing: float) -> tuple[FloatArray, IntArray]:
    """Positions (v, 3) metres and faces (f, 3), turned outward, of what the limbs make together.
    spacing: metres between samples of the field."""
    reach = max(limb.blend for limb in parts) + 2 * spacing
    low, high = _bounds(parts) + np.array([[-reach], [reach]])
    shape = np.ceil((high - low) / spacing).astype(int) + 1
    field = np.full(shape, reach, dtype=np.float32)
    for limb in parts:
        # farther away it changes nothing
        first = np.maximum(np.floor((limb.bounds[0] - reach - low) / spacing).astype(int), 0)
        end = np.ceil((limb.bounds[1] + reach - low) / spacing).astype(int) + 1
        box = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        axes = (low[i] + spacing * np.arange(shape[i])[box[i]] for i in range(3))
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        field[box] = _joined(field[box], limb.distance(points), limb)
    places, faces, _, _ = marching_cubes(
        field, 0.0, gradient_direction="descent", allow_degenerate=False
    )
    faces = faces.astype(np.int32)
    return low + spacing * _evened(places, faces, field / spacing), faces


def _evened(places: FloatArray, faces: IntArray, field: FloatArray) -> FloatArray:
    """Vertices (v, 3) in cells, moved into the middle of their neighbours and back onto the surface
    of a field in cells."""
    count = len(places)
    start, end = np.concatenate([faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]).T
    sums = coo_matrix((np.ones(len(start)), (start, end)), shape=(count, count)).tocsr()
    number = np.bincount(start, minlength=count)[:, None]
    places = places.astype(np.float64)
    for _ in range(ROUNDS):
        places = sums @ places / number
        off = map_coordinates(field, places.T, order=1, mode="nearest")
        places = places - off[:, None] * vertex_normals(places, faces)
    return places


def _joined(field: FloatArray, distance: FloatArray, limb: Limb) -> FloatArray:
    sign = -1.0 if limb.cut else 1.0
    near = np.maximum(limb.blend - np.abs(sign * field - distance), 0.0)
    return sign * (np.minimum(sign * field, distance) - near**2 / (4 * limb.blend))


def plates(points: FloatArray, size: float, groove: float) -> FloatArray:
    """(v,) of points (v, 3), from 0 in the grooves between plates about `size` wide to 1 on them.
    groove: their width; both in metres. A plate is what is nearest to the middle of the points in
    one cell of a grid (S. Worley, "A cellular texture basis function", SIGGRAPH 1996)."""
    _, cell = np.unique(np.floor(points / size).astype(np.int64), axis=0, return_inverse=True)
    count = np.bincount(cell.ravel())
    seeds = np.stack([np.bincount(cell.ravel(), of) / count for of in points.T], axis=1)
    first, second = cKDTree(seeds).query(points, k=2)[0].T
    share = np.clip((second - first) / groove, 0, 1)
    return share * share * (3 - 2 * share)


def scanned(name: str, parts: Sequence[Limb], relief: Relief, triangles: int, color: str) -> Plant:
    """Of exactly so many triangles, an even number, standing on the ground; each edge is one of
    two triangles. color: sRGB."""
    coarse, of = surface(parts, float(np.ptp(_bounds(parts), axis=0).max()) / COARSE)
    spacing = sqrt(PER_CELL * float(_areas(coarse, of).sum()) / (FINER * triangles))
    positions, faces = surface(parts, spacing)
    normals = vertex_normals(positions, faces)
    positions = positions + relief(positions, normals)[:, None] * normals
    made = edges_collapsed(Surface(positions, faces, faces), triangles, AGGRESSIVENESS)
    assert len(made.faces) == triangles, f"{name}: {len(made.faces)} triangles of {len(faces)}"
    assert _is_closed(made.faces), f"{name}: folded by its collapse"
    positions = np.asarray(made.positions, dtype=np.float64)
    return Plant(
        name=name,
        positions=positions - np.array([0.0, positions[:, 1].min(), 0.0]),
        normals=vertex_normals(positions, made.faces),
        uvs=np.zeros((len(positions), 2)),
        faces=made.faces,
        face_material=np.zeros(triangles, np.int32),
        materials=(Material(name, base_color=linear(color), roughness=0.7),),
        source=f"benchmarks/solids, {name}",
    )


def _is_closed(faces: IntArray) -> bool:
    """Whether each directed edge is there once, and its opposite once."""
    edges = np.concatenate([faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    there, back = (np.sort(edges.astype(np.int64) @ way) for way in ([1 << 32, 1], [1, 1 << 32]))
    return bool((np.diff(there) > 0).all() and (there == back).all())


def _bounds(parts: Sequence[Limb]) -> FloatArray:
    """(2, 3) metres."""
    low, high = np.stack([limb.bounds for limb in parts if not limb.cut], axis=1)
    return np.stack([low.min(axis=0), high.max(axis=0)])


def _areas(positions: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = (positions[faces[:, corner]] for corner in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
