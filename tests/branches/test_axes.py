"""Skeletons, tubes and the nearest axis, against plain loops and known tubes."""

from __future__ import annotations

import numpy as np
from branch_cases import tube

from vegtool.branches.axes import Axes, axes_of
from vegtool.branches.parts import connected_parts
from vegtool.branches.skeleton import skeleton
from vegtool.branches.tubes import cut_tubes


def test_a_tubes_rings_are_its_axis():
    start, end = np.array([0.1, 0, 0]), np.array([0.1, 0.8, 0.3])
    vertices, faces = tube(tuple(start), tuple(end), (0.1, 0.04), rings=5)
    rings = skeleton(connected_parts(vertices, faces))
    order = np.argsort(rings.hop)
    t = np.linspace(0, 1, 5)
    assert np.allclose(rings.center[order], start + t[:, None] * (end - start))
    assert np.allclose(rings.radius[order], 0.1 - 0.06 * t)
    assert rings.parent[order].tolist() == [-1, *order[:-1]]


def test_the_start_is_the_longer_loop_whichever_comes_first():
    thin_first = tube((0, 0, 0), (0, 0.8, 0), (0.04, 0.1))
    rings = skeleton(connected_parts(*thin_first))
    assert np.allclose(rings.center[rings.hop == 0], [[0, 0.8, 0]])


def test_a_closed_tube_starts_at_its_thicker_end():
    vertices, faces = tube((0, 0, 0), (0, 0.8, 0), (0.04, 0.1))
    caps = np.array([[0, 0, 0], [0, 0.8, 0]], dtype=float)
    n = len(vertices)
    low = [(i + 1, i, n) for i in range(6)]
    high = [(n - 7 + i, n - 6 + i, n + 1) for i in range(6)]
    rings = skeleton(
        connected_parts(np.concatenate([vertices, caps]), np.vstack([faces, low, high]))
    )
    assert np.allclose(rings.center[rings.hop == 0][:, 1], 0.8)


def test_a_straight_tube_is_one_tube_with_its_length():
    rings = skeleton(connected_parts(*tube((0, 0, 0), (0, 0.8, 0), rings=6)))
    tubes = cut_tubes(rings)
    assert len(tubes) == 1
    assert tubes.fork.tolist() == [-1]
    assert np.allclose(tubes.length, 0.8)
    assert np.allclose(np.sort(tubes.along), np.linspace(0, 0.8, 6))


def test_distance_to_the_axis_and_radius_there():
    rings = skeleton(connected_parts(*tube((0, 0, 0), (0, 0.8, 0), (0.1, 0.05), rings=3)))
    axes = axes_of(rings, cut_tubes(rings))
    point = np.array([[0.3, 0.2, 0]])
    distance, radius, along = axes.measure(point, np.arange(3)[None])
    best = distance.argmin()
    assert np.allclose([distance[0, best], radius[0, best], along[0, best]], [0.3, 0.0875, 0.2])


def test_the_nearest_tube_is_that_of_a_plain_search():
    """Where the tree of samples looks at too few, a nearest segment may be missed: rarely."""
    rng = np.random.default_rng(5)
    a = rng.uniform(-1, 1, (60, 3))
    b = a + rng.uniform(-0.1, 0.1, (60, 3))
    radius = np.full(60, 0.01)
    axes = Axes(a, b, radius, radius, np.arange(60), np.zeros(60))
    points = rng.uniform(-1, 1, (500, 3))
    distance = axes.measure(points, np.tile(np.arange(60), (500, 1)))[0]
    tube_of, cost = axes.nearest_tubes(points)
    assert (tube_of == distance.argmin(axis=1)).mean() > 0.99
    again = axes.cost_to_tube(points, tube_of)
    assert np.allclose(again, cost)
