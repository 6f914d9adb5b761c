"""Connected parts of a triangle mesh, welded where a file gives every face its own vertices.

A generator emits each branch as one tube with its own vertices, so index connectivity tells the
branches apart even where they touch. A triangle soup has lost it: there, vertices at one position
are welded first, and the file's order keeps apart what only touches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray

Labels = np.ndarray
"""int64 labels, dense from 0."""

WELD = 2.0**-19  # grid step, as a fraction of the plant's radius about its mean corner
SOUP_FACES_PER_PART = 2.5  # index-connected parts smaller than this on average are no tubes
CUT_FACES_PER_PART = 16.0  # smaller than this, tubes may be cut to pieces along their rings
RUNS_PER_PART = 1.5  # at most so many stretches of the file per part: the order means something


@dataclass(frozen=True, eq=False)
class Parts:
    """Connected parts of a set of faces, with their welded vertices.

    faces: (f, 3) int64 indices into positions, numbered as the faces show them.
    positions: (v, 3) in units of the plant's radius; vertices of two parts are never one.
    face_part: (f,) part of each face, in order of first face. vertex_part: (v,).
    """

    faces: np.ndarray
    positions: FloatArray
    face_part: Labels
    vertex_part: Labels

    @property
    def count(self) -> int:
        """How many parts."""
        return int(self.face_part.max(initial=-1)) + 1


def connected_parts(positions: FloatArray, faces: np.ndarray) -> Parts:
    """The parts of `faces` (f, 3; f >= 1), `positions` in units of the plant's radius.

    Within a part, vertices at one position are one, so that a texture seam is no boundary.
    """
    place = _dense(weld(positions)[faces].ravel()).reshape(-1, 3)
    part = _face_parts(faces)
    if len(faces) < SOUP_FACES_PER_PART * (part.max() + 1):
        part = _soup_parts(place)
    elif len(faces) < CUT_FACES_PER_PART * (part.max() + 1):
        part = _sewn(place, part)
    part, _ = _by_first(part)
    vertex, first = _by_first((part[:, None] * (place.max() + 1) + place).ravel())
    corner = faces.ravel()[first]
    return Parts(vertex.reshape(-1, 3), positions[corner], part, part[first // 3])


def weld(positions: FloatArray) -> Labels:
    """(v,) labels, equal where positions (in units of the plant's radius, within +-1) are equal.

    Two grids, shifted by half a step, so that rounding noise at a cell's border does not part
    what belongs together.
    """
    first = _dense(_cell(positions, 0.0))
    second = _dense(_cell(positions, 0.5))
    count = int(first.max()) + 1
    return np.asarray(components(count + int(second.max()) + 1, first, second + count)[first])


def components(count: int, a: np.ndarray, b: np.ndarray) -> Labels:
    """(count,) labels of the connected components of the graph with edges a-b."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(a), dtype=np.int8), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _cell(positions: FloatArray, shift: float) -> Labels:
    cell = np.floor(positions / WELD + shift).astype(np.int64) + (1 << 20) + 1
    return np.asarray((cell[:, 0] << 42) + (cell[:, 1] << 21) + cell[:, 2])


def _dense(labels: Labels) -> Labels:
    return np.asarray(np.unique(labels, return_inverse=True)[1])


def _face_parts(faces: np.ndarray) -> Labels:
    a, b = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    return np.asarray(components(int(faces.max()) + 1, a, b)[faces[:, 0]])


def _sewn(place: np.ndarray, part: Labels) -> Labels:
    """Parts that share whole edges made one, as of a tube whose vertices are split where its
    normals or tangents change. Tubes that only touch share no edge."""
    edge = np.sort(place[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    key = edge[:, 0] * (place.max() + 1) + edge[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    of_edge = np.repeat(part, 3)[order]
    return np.asarray(components(int(part.max()) + 1, of_edge[same], of_edge[same + 1])[part])


def _soup_parts(place: np.ndarray) -> Labels:
    """Parts by welded position, parted where the file leaves a part and comes back later."""
    part = _face_parts(place)
    meets = (place[1:, :, None] == place[:-1, None, :]).any(axis=(1, 2))
    run = np.concatenate([[0], np.cumsum(~meets)])
    if run[-1] + 1 > RUNS_PER_PART * len(np.unique(part)):
        return part
    keyed = run[:, None] * (place.max() + 1) + place
    return _face_parts(np.unique(keyed, return_inverse=True)[1].reshape(-1, 3))


def _by_first(labels: Labels) -> tuple[Labels, np.ndarray]:
    """The labels renumbered in the order in which they first appear, and where each does."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), dtype=np.int64)
    rank[order] = np.arange(len(first))
    return rank[inverse], first[order]
