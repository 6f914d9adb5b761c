"""Displacement beside plain distances."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_cases import distances, hills

from vegtool.surfels.displacement import Faces, Marks, displaced, marks_on
from vegtool.surfels.sheets import Triangles, sheets


def test_the_nearest_triangle_of_a_group() -> None:
    """Above nine fields of hills: nearly always the nearest one, and never one of another field.
    Points of no group, and of one without triangles, are over none."""
    random = np.random.default_rng(0)
    corners = hills(24).corners
    field = (corners.mean(axis=1)[:, [0, 2]] * 3).astype(int) @ [3, 1]
    order = np.argsort(field, kind="stable")
    corners, own = corners[order], field[order]
    at = random.integers(len(corners), size=2000)
    points = corners[at].mean(axis=1) + 0.005 * random.normal(size=(2000, 3))
    group = np.where(random.random(2000) < 0.1, random.choice([-1, 9], 2000), own[at])
    faces = Faces(corners, own)
    near = faces.nearest(points, group)
    rows = np.isin(group, own)
    assert np.array_equal(near >= 0, rows)
    assert np.array_equal(own[near[rows]], group[rows])
    found = faces.distance(points[rows], near[rows])
    truth = np.empty(len(found))
    for one in range(9):
        mine = group[rows] == one
        truth[mine] = distances(points[rows][mine], corners[own == one])
    assert (found >= truth - 1e-12).all()
    assert (found <= 1.01 * truth + 1e-7).mean() > 0.95


def test_a_triangle_without_area_is_no_ground() -> None:
    """Points are not on it for having no plane; where there is no other, they are as far from it as
    from a line."""
    line = np.array([[0, 0, 0], [1, 0, 0], [0.5, 0, 0]], float)
    other = np.array([[0, 0.2, 0], [1, 0.2, 0], [0.5, 0.2, 1]], float)
    point = np.array([[0.5, 0.1, 0.3]])
    both = Faces(np.stack([line, other]), np.zeros(2, int))
    assert both.nearest(point, np.zeros(1, int)) == [1]
    alone = Faces(line[None], np.zeros(1, int))
    assert alone.nearest(point, np.zeros(1, int)) == [0]
    np.testing.assert_allclose(alone.distance(point, np.zeros(1, int)), np.hypot(0.1, 0.3))


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
