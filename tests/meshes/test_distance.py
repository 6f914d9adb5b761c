"""Distances to triangles beside a brute-force projection."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.meshes.distance import to_triangles


def nearest(point: np.ndarray, corners: np.ndarray) -> float:
    """Over a dense set of points of the triangle, edges and corners among them."""
    steps = 120
    i, j = (a.ravel() for a in np.mgrid[: steps + 1, : steps + 1])
    i, j = i[i + j <= steps], j[i + j <= steps]
    share = np.stack([steps - i - j, i, j], axis=1) / steps
    return float(np.linalg.norm(share @ corners - point, axis=1).min())


@pytest.mark.parametrize("shape", ["any", "sliver", "line", "point"])
def test_beside_all_points_of_a_triangle(shape: str) -> None:
    """Points in front of it, beside its edges and beyond its corners. Between two points of the
    dense set lies at most a step, so that is 1/120 of an edge too far at most."""
    random = np.random.default_rng(0)
    corners = random.normal(size=(60, 3, 3))
    if shape == "sliver":
        corners[:, 2] = corners[:, :2].mean(axis=1) + 1e-6 * random.normal(size=(60, 3))
    if shape == "line":
        corners[:, 2] = 0.3 * corners[:, 0] + 0.7 * corners[:, 1]
    if shape == "point":
        corners[:, 1:] = corners[:, :1]
    points = 2 * random.normal(size=(60, 3))
    found = to_triangles(points, corners)
    truth = np.array([nearest(p, c) for p, c in zip(points, corners, strict=True)])
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert (found <= truth + 1e-9).all()
    assert (truth - found <= longest / 120 + 1e-9).all()


def test_points_of_a_triangle_are_on_it() -> None:
    random = np.random.default_rng(1)
    corners = random.normal(size=(50, 3, 3))
    share = random.dirichlet([1, 1, 1], 50)
    points = np.einsum("nc,nci->ni", share, corners)
    assert to_triangles(points, corners).max() < 1e-14


def test_which_way_it_turns_changes_nothing() -> None:
    random = np.random.default_rng(2)
    corners, points = random.normal(size=(50, 3, 3)), random.normal(size=(50, 3))
    np.testing.assert_allclose(
        to_triangles(points, corners), to_triangles(points, corners[:, ::-1]), rtol=1e-9
    )
