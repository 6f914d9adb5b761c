"""Displacement beside plain distances."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_cases import distances, hills

from vegtool.surfels.displacement import Marks, displaced, marks_on
from vegtool.surfels.faces import Faces
from vegtool.surfels.sheets import Triangles, sheets


@pytest.mark.parametrize("at", [0.05, 0.2, 0.3, 0.4, 0.5, 0.7])
def test_the_other_diagonal_of_a_bent_square(at: float) -> None:
    """No vertex has gone, but the diagonals pass each other at a distance of 0.3, somewhere along
    the one that was: neither a vertex nor the middle of the edge tells how far."""
    a, b, c, d = np.array([[0, 0, 0], [1, 0, 0], [at, 0.3, 1], [at, 0.3, -1]])
    drawn = np.array([[a, c, d], [b, d, c]])
    half = np.concatenate([np.zeros((4, 3)), [(b - a) / 2]])
    marks = Marks(np.array([a, b, c, d, (a + b) / 2]), half, np.zeros(5, int))
    most, near = displaced(marks, np.zeros(5, int), drawn, np.zeros(2, int), 2)
    truth = distances(a + np.linspace(0, 1, 2001)[:, None] * (b - a), drawn).max()
    assert truth <= most[0] <= 8 / 7 * truth
    assert most[1] == 0.0
    assert set(near.tolist()) <= {0, 1}


def test_marks_are_vertices_and_middles_that_can_move() -> None:
    """Of a meadow of n x n squares: what is not on its border; an edge if one end is not."""
    plant = hills(6)
    made = sheets(plant)
    none = np.zeros(made.faces.shape, int)
    marks = marks_on(Triangles(made.faces, none, none, none[:, 0]), made.positions, made.held)
    vertex = ~marks.half.any(axis=1)
    assert vertex.sum() == 5 * 5
    # two corners are cut off by diagonals between vertices of the border
    assert (~vertex).sum() == (3 * 36 + 12) - 24 - 2
    corners = made.positions[made.faces[marks.face]]
    np.testing.assert_allclose(Faces(corners, np.arange(len(corners))).distance(
        marks.points, np.arange(len(corners))), 0, atol=1e-12)  # fmt: skip
