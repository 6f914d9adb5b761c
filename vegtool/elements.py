"""The order in which a plant's elements are left out: every first part of it is spread evenly.

Cook, Halstead, Planck, Ryu: Stochastic simplification of aggregate detail (2007): of many small
elements a part is kept and enlarged. Colditz, Coconu, Deussen, Hege: Real-time rendering of complex
photorealistic landscapes using hybrid level-of-detail approaches (2005), section 4: geometry is
reduced with distance. What is drawn is the first part of an index buffer, so that a plant of any
number of elements costs no more than those.

An element is a connected piece of few faces, as a leaf card or a twig is, or else a single face.
Leaves are spread evenly over the plant: elements sorted along a Morton curve are taken in the order
of van der Corput's sequence (1935), whose every first part is spread evenly along it. Wood goes by
thickness, twigs first, slowly, and the trunk last; it is not enlarged, and no stem is left with
holes in it: from near, both are seen at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.branches.parts import connected_parts
from vegtool.plant import Plant

MOST_FACES = {"leaf": 8, "wood": 1024}
"""Of an element, by role: larger pieces are taken apart into their faces."""
WOOD_POWER = 3.0
"""Of a share of the elements that is kept, wood keeps the share of its area to one over this."""
MORTON_BITS = 10
"""Per axis."""


@dataclass(frozen=True, eq=False)
class Elements:
    """A plant's faces by material, and in each in the order in which they are kept longest.

    vertex: (v,) int32, which of the plant's vertices each of the new ones is: elements share none.
    faces: (f, 3) int32 into those. face_material: (f,) int32, ascending. face_rank: (f,) float64,
    0 to 1, ascending in each material: a face is drawn where its rank is below the share that is
    kept. middle: (v, 3) metres, of the vertex's element. rank: (v,). grows: (v,) bool, whether the
    element is enlarged where others are left out.
    """

    vertex: IntArray
    faces: IntArray
    face_material: IntArray
    face_rank: FloatArray
    middle: FloatArray
    rank: FloatArray
    grows: np.ndarray

    def __post_init__(self) -> None:
        count = len(self.vertex)
        faces = checked("Elements.faces", self.faces, (None, 3), np.int32, count)
        values = {
            "vertex": checked("Elements.vertex", self.vertex, (None,), np.int32),
            "faces": faces,
            "face_material": checked(
                "Elements.face_material", self.face_material, (len(faces),), np.int32
            ),
            "face_rank": checked("Elements.face_rank", self.face_rank, (len(faces),), np.float64),
            "middle": checked("Elements.middle", self.middle, (count, 3), np.float64),
            "rank": checked("Elements.rank", self.rank, (count,), np.float64),
            "grows": checked("Elements.grows", self.grows, (count,), np.bool_),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)


def ordered(plant: Plant) -> Elements:
    """The elements of a plant, in order."""
    element = _elements(plant)
    count = int(element.max()) + 1
    leaf = np.zeros(count, bool)
    leaf[element] = plant.face_is_leaf
    area: FloatArray = np.bincount(element, plant.face_areas, count).astype(np.float64)
    faces = np.bincount(element, minlength=count)
    middle = (
        np.stack([np.bincount(element, axis, count) for axis in plant.face_centroids.T], axis=1)
        / faces[:, None]
    )
    rank = np.empty(count)
    rank[leaf] = spread_ranks(middle[leaf])
    rank[~leaf] = area_ranks((area / faces)[~leaf], area[~leaf]) ** WOOD_POWER
    order = np.lexsort((element, rank[element], plant.face_material))
    chosen = element[order]
    # elements share no vertices: a new one for every pair of element and old vertex
    pair = chosen[:, None].astype(np.int64) * len(plant.positions) + plant.faces[order]
    pairs, corner = np.unique(pair, return_inverse=True)
    owner, vertex = np.divmod(pairs, len(plant.positions))
    return Elements(
        vertex.astype(np.int32),
        corner.reshape(-1, 3).astype(np.int32),
        plant.face_material[order],
        rank[chosen],
        middle[owner],
        rank[owner],
        leaf[owner],
    )


def unordered(plant: Plant) -> Elements:
    """All faces, by material, of a plant of which nothing is ever left out."""
    order = np.argsort(plant.face_material, kind="stable")
    count = len(plant.positions)
    return Elements(
        np.arange(count, dtype=np.int32),
        plant.faces[order],
        plant.face_material[order],
        np.zeros(len(order)),
        plant.positions,
        np.zeros(count),
        np.zeros(count, bool),
    )


def spread_ranks(middle: FloatArray) -> FloatArray:
    """(n,) from 0 on and below 1, evenly spaced: those of points (n, 3) such that all points below
    any rank are spread evenly over space."""
    count = len(middle)
    if not count:
        return np.empty(0)
    along = np.lexsort((*middle.T, morton_codes(middle)))
    taken = np.argsort(van_der_corput(count), kind="stable")
    rank = np.empty(count)
    rank[along[taken]] = np.arange(count) / count
    return rank


def area_ranks(size: FloatArray, area: FloatArray) -> FloatArray:
    """(n,) from 0 on and below 1: the share of all area (n,) that is in those of larger size."""
    order = np.argsort(-size, kind="stable")
    total = np.cumsum(area[order])
    rank = np.empty(len(area))
    rank[order] = (total - area[order]) / (total[-1] if len(area) and total[-1] > 0 else 1.0)
    return np.minimum(rank, np.nextafter(1.0, 0.0))


def morton_codes(points: FloatArray) -> np.ndarray:
    """(n,) int64: where points (n, 3) lie along a Morton curve through their bounds, a cube."""
    low = points.min(axis=0)
    size = float((points.max(axis=0) - low).max()) or 1.0
    cells = ((points - low) / size * (2**MORTON_BITS - 1)).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(MORTON_BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def van_der_corput(count: int) -> FloatArray:
    """(count,) the first numbers of the sequence in base 2: 0, 1/2, 1/4, 3/4, 1/8, ..."""
    index = np.arange(count, dtype=np.uint64)
    result = np.zeros(count)
    bits = max(count - 1, 1).bit_length()
    for bit in range(bits):
        result += ((index >> np.uint64(bit)) & np.uint64(1)).astype(float) * 2.0 ** -(bit + 1)
    return result


def _elements(plant: Plant) -> np.ndarray:
    """(f,) int64 dense labels: connected pieces of few faces of one material, else single faces."""
    local = (plant.positions - plant.center) / (plant.radius or 1.0)
    label = np.empty(len(plant.faces), np.int64)
    first = 0
    for material in np.unique(plant.face_material):
        here = np.flatnonzero(plant.face_material == material)
        part = connected_parts(local, plant.faces[here]).face_part
        alone = np.bincount(part)[part] > MOST_FACES[plant.materials[material].role]
        part = np.where(alone, part.max() + 1 + np.arange(len(here)), part)
        label[here] = first + np.unique(part, return_inverse=True)[1]
        first = int(label[here].max()) + 1
    return label
