"""Distances from triangles that points ask for, beside plain ones."""

from __future__ import annotations

import numpy as np
from surfel_cases import distances, hills

from vegtool.meshes.distance import to_triangles
from vegtool.surfels.faces import Faces


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


def test_the_least_of_some() -> None:
    """The height above one of them, or the distance from the nearest: never less than that, and
    the same where the point is above none."""
    random = np.random.default_rng(0)
    corners = random.normal(size=(200, 3, 3))
    points = random.normal(size=(300, 3))
    of, which = np.repeat(np.arange(300), 5), random.integers(200, size=1500)
    found = Faces(corners, np.zeros(200, int)).least(points, of, which)
    plain = to_triangles(points[of], corners[which]).reshape(300, 5)
    least = plain.min(axis=1)
    assert (found >= least - 1e-12).all()
    assert (np.abs(plain - found[:, None]).min(axis=1) < 1e-12).all()
    assert (found < least + 1e-12).mean() > 0.5
