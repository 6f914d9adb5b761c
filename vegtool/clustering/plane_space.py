"""Clusters that share planes, wherever on them they are.

Décoret, Durand, Sillion, Dorsey: Billboard clouds for extreme model simplification (2003).

How far faces may move onto a plane, epsilon, is about the least with which the planes are no more
than asked for (`plane_cover.py`): their number is taken to fall with a power of it, which the last
two tries tell. What they fall short of the number, the largest clusters are cut in two, which saves
empty texels.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import IntArray, unit
from vegtool.clustering import ClusterOptions, compact
from vegtool.clustering.features import (
    SAME,
    Labels,
    cells,
    face_weights,
    own_corners,
    samples,
    spread_to,
)
from vegtool.clustering.partition import compacted, split
from vegtool.clustering.plane_cover import GRID, ROUNDING, Cover, Pieces, cover
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

FIRST = 0.25
"""Radii times the root of the number of planes: the first epsilon that is tried; foliage takes
0.36, smooth bodies 0.07."""
FILLED = 0.85
"""Of the number of planes: as many are enough."""
SOME = 1 << 11
"""Pieces, every nth, among which epsilon is sought first."""
SPARSE = 1 / 3
"""Power of how many times as many there are, with which epsilon grows from those to all."""
FALLS = 2.0
"""Power of epsilon with which the number of planes falls, as long as no two are known."""
LEAST_FALLS, MOST_FALLS = 0.5, 4.0
"""Between which it is believed."""
TRIES = 8
"""That many epsilons, at most."""
TOO_MANY = 2
"""Times the number of planes: no more are sought."""
FINEST, ALL = 1e-7, 2.0
"""Radii: epsilon lies between."""
BRACKETED = 1.02
"""Times an epsilon that is too small, one that is not is small enough."""


def planes(
    plant: Plant, count: int, options: ClusterOptions, seed: int, progress: Progress
) -> IntArray:
    """(f,) int32 labels of at most `count` clusters, each near one plane. Nothing is random."""
    points = samples(plant, options.orientation_scale(count), count)
    piece = by_first_face(points.of_face)
    pieces, _ = pieces_of(plant, piece)
    found = planes_for(pieces, count, progress)
    labels = compacted(spread_to(points.of_face, found.labels[piece]))
    labels = split(points.points, points.weights, labels, min(count, len(points.points)))
    return np.asarray(labels[points.of_face], dtype=np.int32)


def by_first_face(of_face: Labels) -> Labels:
    """(f,) the same pieces, in the order of their first faces: that of points hangs on rounding."""
    return compact(of_face.astype(np.int32)).astype(np.int64)


def pieces_of(plant: Plant, of_face: Labels) -> tuple[Pieces, np.ndarray]:
    """The faces of each piece as one, in the plant's own frame, and the axes (3, 3) of that. Of
    equal faces of a piece there is one."""
    corners, axes = own_corners(plant)
    equal = cells(corners.reshape(-1, 9), SAME, of_face)
    _, kept, equal = np.unique(equal, return_index=True, return_inverse=True)
    weight = np.bincount(equal, face_weights(plant))
    order = np.lexsort([kept, of_face[kept]])
    corners, weight = corners[kept[order]], weight[order]
    edges = np.roll(corners, -1, axis=1) - corners
    across = np.cross(edges[:, 0], edges[:, 1])
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    flat = np.linalg.norm(across, axis=1) > ROUNDING * longest  # else its normal is rounding
    normal = unit(np.where(flat[:, None], across, 0.0))
    first = np.flatnonzero(np.diff(of_face[kept[order]], prepend=-1))
    area = weight[:, None] * normal
    bare = np.where(area.any(axis=1), 0.0, weight)
    own = np.ascontiguousarray(corners.swapaxes(0, 1))
    return Pieces(own, first, area, bare), axes


def planes_for(pieces: Pieces, count: int, progress: Progress = silent) -> Cover:
    """At most `count` planes near all pieces, by about the least epsilon that allows it."""
    epsilon = FIRST / count**0.5
    if len(pieces) > SOME:
        some = pieces.of(np.arange(0, len(pieces), -(-len(pieces) // SOME)))
        _, epsilon = _search(some, count, epsilon, lambda _, f: progress("planes", f / 3))
        epsilon *= (len(pieces) / len(some)) ** SPARSE
    found, _ = _search(pieces, count, epsilon, lambda _, f: progress("planes", (1 + 2 * f) / 3))
    return found


def _search(pieces: Pieces, count: int, epsilon: float, progress: Progress) -> tuple[Cover, float]:
    """The planes, and their epsilon; what is given is tried first."""
    best, fails, fits = one_plane(pieces), FINEST, ALL
    falls, known = FALLS, (0.0, 0)
    for nth in range(TRIES):
        if len(best.normal) >= FILLED * count or fits <= BRACKETED * fails:
            break
        progress("planes", nth / TRIES)
        found = cover(pieces, epsilon, TOO_MANY * count)
        number = TOO_MANY * count if found is None else len(found.normal)
        if found is not None and number <= count:
            best, fits = found, epsilon
        else:
            fails = epsilon
        if found is not None:
            if known[1]:
                falls = float(np.log(number / known[1]) / np.log(known[0] / epsilon))
                falls = min(max(falls, LEAST_FALLS), MOST_FALLS)
            known = epsilon, number
        epsilon *= (2 * number / ((1 + FILLED) * count)) ** (1 / falls)
        if not fails < epsilon < fits:
            epsilon = (fails * fits) ** 0.5
    return best, fits


def one_plane(pieces: Pieces) -> Cover:
    """Through the middle, across the direction in which most area is projected."""
    nth = int(pieces.projected(GRID).sum(axis=1).argmax())
    return Cover(np.zeros(len(pieces), dtype=np.int64), GRID[nth][None], np.zeros(1))
