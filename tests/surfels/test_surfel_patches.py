"""Clusters of neighbours, and of what has none."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from surfel_cases import hills

from vegtool.surfels.patches import clustered, gathered


def neighbours(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By hand: triangles that have two vertices in common."""
    shared = (faces[:, None, :, None] == faces[None, :, None, :]).sum(axis=(2, 3))
    one, other = np.nonzero(np.triu(shared == 2))
    return one, other


def test_clusters_are_connected_and_of_a_size() -> None:
    faces = hills(12).faces
    one, other = neighbours(faces)
    label = clustered(np.ones(len(faces), np.int64), (one, other), np.ones(len(one)), 14)
    size = np.bincount(label)
    assert size.max() <= 14
    assert size.mean() > 8
    inside = label[one] == label[other]
    graph = coo_matrix((np.ones(inside.sum()), (one[inside], other[inside])), shape=(288, 288))
    assert connected_components(graph)[0] == len(size)


def test_no_two_neighbours_would_fit_into_one() -> None:
    faces = hills(12).faces
    one, other = neighbours(faces)
    size = np.random.default_rng(0).integers(1, 6, len(faces))
    label = clustered(size, (one, other), np.random.default_rng(1).random(len(one)) + 0.1, 20)
    whole = np.bincount(label, size)
    apart = label[one] != label[other]
    assert (whole[label[one]] + whole[label[other]])[apart].min() > 20


def test_most_border_comes_first() -> None:
    """Of a row of four, the two in the middle have most in common, so that the ends are left."""
    label = clustered(np.ones(4, int), (np.arange(3), np.arange(1, 4)), np.array([1.0, 3, 1]), 2)
    assert label[1] == label[2]
    assert len(set(label.tolist())) == 3


def test_gathered_by_place() -> None:
    """Two heaps of four, and one in the midst of the first that is to be apart."""
    points = np.array([[x + d, 0, 0] for x in (0, 9) for d in (0, 1, 2, 3)] + [[1.5, 0, 0]])
    label = gathered(points, np.ones(9, int), np.array([0] * 8 + [1]), 4)
    assert [len(set(part)) for part in (label[:4].tolist(), label[4:8].tolist())] == [1, 1]
    assert len({label[0], label[4], label[8]}) == 3


def test_gathered_at_one_place() -> None:
    """Halves all the same; and one that is too large stays alone."""
    label = gathered(np.zeros((9, 3)), np.array([1] * 8 + [50]), np.zeros(9, int), 3)
    size = np.bincount(label, [1] * 8 + [50])
    assert sorted(size.tolist())[-1] in (50, 51, 52)
    assert (np.sort(size)[:-1] <= 3).all()
    assert len(gathered(np.zeros((0, 3)), np.empty(0, int), np.empty(0, int), 3)) == 0
