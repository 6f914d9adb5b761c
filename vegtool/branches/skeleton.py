"""The axes of the wood: every part cut into rings, the rings strung into a tree.

From its start ring (the larger boundary loop) the hops along edges count through a tube ring by
ring; vertices at one number of hops that hang together are one ring. Where the wood forks, so do
its rings. On a generator's tube a ring's mean is the axis to rounding, which is what later tells
parents apart. (A Reeb graph of the distance from the start: Lazarus and Verroust 1999, "Level set
diagrams of polyhedral objects".)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.parts import Parts, components

LOOP_TIE = 0.02  # boundary loops whose lengths differ by less are equal; the file's first starts


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Rings and how they hang together.

    center: (r, 3) and radius: (r,) in units of the plant's radius; radius is the mean distance of
    the ring's vertices from its center. parent: (r,) the ring before it towards the start, -1 at
    a start. hop: (r,) hops from the start. part: (r,) the wood part. vertex_ring: (v,).
    """

    center: FloatArray
    radius: FloatArray
    parent: np.ndarray
    hop: np.ndarray
    part: np.ndarray
    vertex_ring: np.ndarray


def skeleton(parts: Parts) -> Skeleton:
    """The rings of all parts at once."""
    edge, uses = _edges(parts.faces)
    hop = _hops(edge, start_vertices(parts, edge[uses == 1]), len(parts.positions))
    a, b = edge[:, 0], edge[:, 1]
    level = hop[a] == hop[b]
    ring = components(len(hop), a[level], b[level])
    count = int(ring.max()) + 1
    size = np.bincount(ring, minlength=count)
    center = np.stack(
        [np.bincount(ring, parts.positions[:, axis], count) / size for axis in range(3)], axis=1
    )
    away = np.linalg.norm(parts.positions - center[ring], axis=1)
    ring_hop, ring_part = np.empty((2, count), dtype=np.int64)
    ring_hop[ring], ring_part[ring] = hop, parts.vertex_part
    far = np.where(hop[a] > hop[b], a, b)[~level]
    near = np.where(hop[a] > hop[b], b, a)[~level]
    return Skeleton(
        center,
        np.bincount(ring, away, count) / size,
        _most_frequent(ring[far], ring[near], count),
        ring_hop,
        ring_part,
        ring,
    )


def start_vertices(parts: Parts, boundary: np.ndarray) -> np.ndarray:
    """Vertices from which hops are counted: each part's longest boundary loop; a part without
    boundary starts at its thicker end."""
    count = len(parts.positions)
    starts = []
    open_part = np.zeros(parts.count, dtype=bool)
    if len(boundary):
        loop = components(count, boundary[:, 0], boundary[:, 1])
        length = np.linalg.norm(
            parts.positions[boundary[:, 0]] - parts.positions[boundary[:, 1]], axis=1
        )
        loops, first, member = np.unique(
            loop[boundary[:, 0]], return_index=True, return_inverse=True
        )
        perimeter = np.bincount(member, length)
        first_vertex = np.full(len(loops), count)
        np.minimum.at(first_vertex, member, boundary.min(axis=1))
        part = parts.vertex_part[boundary[first, 0]]
        longest = np.zeros(parts.count)
        np.maximum.at(longest, part, perimeter)
        fits = perimeter >= (1 - LOOP_TIE) * longest[part]
        order = np.lexsort((first_vertex, ~fits, part))
        chosen = order[np.unique(part[order], return_index=True)[1]]
        is_start = np.zeros(count, dtype=bool)
        is_start[boundary[np.isin(member, chosen)].ravel()] = True
        starts.append(np.flatnonzero(is_start))
        open_part[part] = True
    closed = ~open_part[parts.vertex_part]
    if closed.any():
        starts.append(_thick_ends(parts, np.flatnonzero(closed)))
    return np.concatenate(starts)


def _thick_ends(parts: Parts, vertices: np.ndarray) -> np.ndarray:
    """One vertex for each part that these vertices make up, at the thicker of its two ends.

    The ends are the vertices farthest apart, found by going to the farthest twice; thickness is
    the spread across the line between them of the fifth of the part nearest to an end.
    """
    part = np.unique(parts.vertex_part[vertices], return_inverse=True)[1]
    at = parts.positions[vertices]
    count = int(part.max()) + 1
    size = np.bincount(part)

    def farthest(origin: FloatArray) -> np.ndarray:
        order = np.lexsort((np.linalg.norm(at - origin[part], axis=1), part))
        return np.asarray(order[np.cumsum(size) - 1])

    middle = np.stack([np.bincount(part, at[:, axis], count) / size for axis in range(3)], axis=1)
    one = farthest(middle)
    other = farthest(at[one])
    line = at[other] - at[one]
    square = np.maximum((line**2).sum(axis=1), np.finfo(float).tiny)
    along = ((at - at[one][part]) * line[part]).sum(axis=1) / square[part]
    across = np.linalg.norm(at - at[one][part] - along[:, None] * line[part], axis=1)

    def thickness(near: np.ndarray) -> FloatArray:
        weight = np.bincount(part[near], minlength=count)
        return np.asarray(np.bincount(part[near], across[near], count) / np.maximum(weight, 1))

    swap = thickness(along > 0.8) > thickness(along < 0.2)
    return np.asarray(vertices[np.where(swap, other, one)])


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(e, 2) edges, smaller index first, and how many faces use each."""
    corner = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    corner = corner[corner[:, 0] != corner[:, 1]]
    low, high = corner.min(axis=1), corner.max(axis=1)
    base = int(faces.max()) + 1
    key, uses = np.unique(low * base + high, return_counts=True)
    return np.stack([key // base, key % base], axis=1), uses


def _hops(edge: np.ndarray, starts: np.ndarray, count: int) -> np.ndarray:
    """(count,) int64 hops from the nearest start; a breadth-first search, one hop per round."""
    from scipy.sparse import coo_matrix

    ends = np.concatenate([edge, edge[:, ::-1]])
    graph = coo_matrix((np.ones(len(ends), dtype=np.int8), ends.T), shape=(count, count)).tocsr()
    start_of, neighbour = graph.indptr.astype(np.int64), graph.indices
    hop = np.full(count, -1, dtype=np.int64)
    hop[starts] = 0
    front, step = np.unique(starts), 0
    while len(front):
        step += 1
        degree = start_of[front + 1] - start_of[front]
        offset = np.arange(degree.sum()) - np.repeat(np.cumsum(degree) - degree, degree)
        reached = neighbour[np.repeat(start_of[front], degree) + offset]
        front = np.unique(reached[hop[reached] < 0])
        hop[front] = step
    return np.maximum(hop, 0)  # a vertex that no edge reaches (all its faces degenerate) starts


def _most_frequent(child: np.ndarray, parent: np.ndarray, count: int) -> np.ndarray:
    """(count,) for each child the parent it meets along most edges (then the least), else -1."""
    result = np.full(count, -1, dtype=np.int64)
    key, uses = np.unique(child * count + parent, return_counts=True)
    order = np.lexsort((-key, uses, key // count))  # the best of each child comes last
    result[key[order] // count] = key[order] % count
    return result
