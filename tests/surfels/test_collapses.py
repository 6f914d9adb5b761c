"""One pass: which edges may collapse, and what is left."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_cases import ball, grid, hills, surface

from vegtool.plant import Plant
from vegtool.surfels.collapses import Pass
from vegtool.surfels.halving import halved
from vegtool.surfels.sheets import Sheets, Triangles, sheets


def whole(plant: Plant, group: np.ndarray | None = None) -> tuple[Triangles, Sheets]:
    made = sheets(plant)
    group = np.zeros(len(plant.faces), int) if group is None else group
    corners = plant.faces.astype(np.int64)
    return Triangles(made.faces, corners, made.seam[corners], group), made


def quarters(plant: Plant) -> np.ndarray:
    """(f,) groups by the signs of x - 0.5 and z - 0.5."""
    return (plant.face_centroids[:, [0, 2]] > 0.5) @ [2, 1]


def test_what_asks() -> None:
    """Nothing on the border of the plant or of a group; and each vertex once, along an edge."""
    plant = hills(20)
    triangles, made = whole(plant, quarters(plant))
    one = Pass(triangles, made)
    asks = one.asks()
    at = one.positions[asks.start] * plant.radius + plant.center
    line = np.isclose(at[:, [0, 2], None], [0, 0.5, 1]).any(axis=(1, 2))
    assert not line.any()
    assert len(asks.start) == len(np.unique(asks.start)) > 0.8 * 18 * 18
    edges = {frozenset(e) for f in one.faces.tolist() for e in (f[:2], f[1:], f[::2])}
    assert all(frozenset(e) in edges for e in np.stack([asks.start, asks.end], axis=1).tolist())


def test_a_tube_is_not_pinched() -> None:
    """On a bent tube of three sides, far thinner than its bends, the edges round it are the
    cheapest; but of these none may collapse, as both ends have three neighbours in common."""
    along, round_it = (a.ravel() for a in np.mgrid[:14, :3])
    angle = np.radians(120) * round_it
    bend = np.random.default_rng(0).normal(scale=0.02, size=(14, 3))[along]
    ring = np.stack([0.01 * np.cos(angle), 0.1 * along, 0.01 * np.sin(angle)], axis=1)
    faces = grid(13, 3)
    plant = surface(ring + bend, faces // 4 * 3 + faces % 4 % 3, uvs=np.zeros((42, 2)))
    one = Pass(*whole(plant))
    asks = one.asks()
    places = one.positions * plant.radius + plant.center
    ring_of = np.linalg.norm(places[:, None] - plant.positions, axis=2).argmin(axis=1) // 3
    assert len(asks.start) > 8
    assert (ring_of[asks.start] != ring_of[asks.end]).all()


def test_who_goes() -> None:
    """No two side by side; in each group the cheapest ones, and no more than so many."""
    plant = hills(20)
    triangles, made = whole(plant, quarters(plant))
    one = Pass(triangles, made)
    most = np.array([3, 1000, 0, 10])
    asks = one.asks()
    every = one.winners(asks, np.full(4, 1000))
    some = one.winners(asks, most)
    assert np.array_equal(np.bincount(some.group, minlength=4)[[0, 2, 3]], [3, 0, 10])
    for group in range(4):
        mine = every.cost[every.group == group]
        assert np.array_equal(some.cost[some.group == group], np.sort(mine)[: most[group]])
    goes = np.zeros(one.count, bool)
    goes[every.start] = True
    assert goes[one.faces].sum(axis=1).max() == 1
    assert len(every.start) > 0.15 * len(asks.start)


@pytest.mark.parametrize("kind", ["hills", "ball"])
def test_what_is_left(kind: str) -> None:
    """Two triangles fewer for each that goes; corners are vertices at the triangle's places; those
    triangles that none of them had stay as they are, in order."""
    plant = hills(20) if kind == "hills" else ball(3)
    triangles, made = whole(plant)
    one = Pass(triangles, made)
    asks = one.winners(one.asks(), np.array([1000]))
    left = one.without(asks)
    assert len(left) == len(triangles) - 2 * len(asks.start)
    places = made.positions[left.faces] * plant.radius + plant.center
    np.testing.assert_allclose(plant.positions[left.corners], places, atol=1e-12)
    gone = np.isin(triangles.faces, one.used[asks.start])
    assert not np.isin(left.faces, one.used[asks.start]).any()
    same = (left.faces[:, None] == triangles.faces[~gone.any(axis=1)]).all(axis=2)
    assert same.any(axis=0).all()
    assert (np.diff(same.argmax(axis=0)) > 0).all()


def test_halves() -> None:
    """Each group, as far as its vertices may be displaced."""
    plant = ball(4, 0.0)
    group = (plant.face_centroids[:, 0] > 0).astype(int)
    triangles, made = whole(plant, group)
    left, moves = halved(triangles, made, np.array([1.0, 1e-6]))
    assert moves[0] > moves[1] == 0.0
    assert np.array_equal(left.group, np.sort(left.group))
    before, after = np.bincount(group), np.bincount(left.group)
    assert 0.45 * before[0] < after[0] < 0.7 * before[0]
    assert after[1] == before[1]


def test_no_vertex_costs_much_more_than_the_median() -> None:
    """A meadow with a spike: the spike stays, though it is free to go and half are to go."""
    plant = hills(20, 0.01)
    positions = plant.positions.copy()
    spike = 10 * 21 + 10
    positions[spike, 1] = 0.5
    spiked = surface(positions, plant.faces)
    triangles, made = whole(spiked)
    left, _ = halved(triangles, made, np.array([9.0]))
    assert len(left) < 0.75 * len(triangles)
    assert spike in left.corners
