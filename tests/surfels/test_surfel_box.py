"""Boxes of surfel billboards: flat, turned, degenerate; and sums of moments."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.arrays import FloatArray
from vegtool.surfels.box import Moments, boxes_of, moments_of


def rectangle(w: float, h: float, cells: int = 1) -> FloatArray:
    """(2 cells^2, 3, 3) triangles of a rectangle of 2 w by 2 h in the xy plane, seen from +z."""
    x, y = np.meshgrid(np.linspace(-w, w, cells + 1), np.linspace(-h, h, cells + 1), indexing="ij")
    p = np.stack([x, y, 0 * x], axis=-1)
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)]).reshape(
        -1, 3, 3
    )


def turn(seed: int) -> FloatArray:
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return np.asarray(q * np.linalg.det(q))


@pytest.mark.parametrize("seed", range(4))
def test_a_turned_rectangle_has_its_own_box(seed: int) -> None:
    """It is found wherever it lies, and looks to where its triangles are counter-clockwise."""
    r, at = turn(seed), np.array([10.0, -4.0, 7.0])
    box = boxes_of(rectangle(3.0, 1.0) @ r.T + at, np.array([0]))
    np.testing.assert_allclose(box.half[0], [3, 1, 0], atol=1e-12)
    np.testing.assert_allclose(box.center[0], at, atol=1e-12)
    np.testing.assert_allclose(box.normal[0], r[:, 2], atol=1e-12)
    assert abs(box.axes[0, 0] @ r[:, 0]) == pytest.approx(1.0)
    np.testing.assert_allclose(np.linalg.det(box.axes), 1.0)


def test_a_finer_mesh_has_the_same_box() -> None:
    """Its left half has a hundred times as many vertices: components are of the surface."""
    coarse = rectangle(2.0, 1.0)
    aside = np.array([1.0, 0.0, 0.0])
    left, right = rectangle(1.0, 1.0, 10) - aside, rectangle(1.0, 1.0) + aside
    box, other = (boxes_of(some, np.array([0])) for some in (coarse, np.concatenate([left, right])))
    np.testing.assert_allclose(box.half, other.half, atol=1e-12)
    np.testing.assert_allclose(box.center, other.center, atol=1e-12)


def test_quads_go_round_the_front() -> None:
    box = boxes_of(rectangle(3.0, 1.0), np.array([0]))
    quad = box.quads()[0]
    normal = np.cross(quad[1] - quad[0], quad[2] - quad[0])
    assert normal @ box.normal[0] > 0
    np.testing.assert_allclose(np.abs(quad), np.broadcast_to([3, 1, 0], (4, 3)), atol=1e-12)


@pytest.mark.parametrize(
    ("corners", "half"),
    [
        ([[0, 0, 0]] * 3, [0, 0, 0]),
        ([[0, 0, 0], [1, 0, 0], [3, 0, 0]], [1.5, 0, 0]),
        ([[0, 0, 0], [2, 0, 0], [0, 1, 0]], None),
    ],
    ids=["a point", "a line", "a triangle"],
)
def test_what_has_no_surface_has_a_box(corners: list[list[float]], half: list[float]) -> None:
    box = boxes_of(np.array([corners], dtype=float), np.array([0]))
    if half is not None:
        np.testing.assert_allclose(box.half[0], half, atol=1e-12)
    assert (np.diff(box.half[0]) <= 0).all() and box.half[0, 2] < 1e-12
    np.testing.assert_allclose(box.axes[0] @ box.axes[0].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(box.axes[0]) > 0


def test_moments_add_up() -> None:
    """Those of two sets are those of both together, by a sum over all points at once."""
    random = np.random.default_rng(5)
    corners = random.normal(size=(30, 3, 3)) + 100
    first = np.array([0, 12])
    parts = moments_of(corners, first)
    both = parts.of(np.array([0])).with_(parts.of(np.array([1])))
    whole = moments_of(corners, np.array([0]))
    for name in Moments.__dataclass_fields__:
        np.testing.assert_allclose(getattr(both, name), getattr(whole, name), rtol=1e-9, atol=1e-9)


def test_moments_are_integrals() -> None:
    """Beside a sum over 200,000 random points of the triangles."""
    random = np.random.default_rng(6)
    corners = random.normal(size=(5, 3, 3))
    found = moments_of(corners, np.array([0]))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                          axis=1) / 2  # fmt: skip
    which = random.choice(5, 200_000, p=area / area.sum())
    share = random.dirichlet([1, 1, 1], len(which))
    points = np.einsum("pc,pci->pi", share, corners[which])
    np.testing.assert_allclose(found.mean[0], points.mean(axis=0), atol=0.02)
    spread = np.cov(points.T) * area.sum()
    np.testing.assert_allclose(found.spread[0], spread, atol=0.02 * spread.max())
