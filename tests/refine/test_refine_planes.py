"""Planes cost as little as plain searches find, and every plant that can be read has some."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plants import plant_of

from vegtool.arrays import FloatArray, IntArray
from vegtool.clustering import ClusterOptions, cluster
from vegtool.clustering.features import Labels, own_corners
from vegtool.errors import UsageError
from vegtool.formats import read_plant
from vegtool.lod import Billboards
from vegtool.plant import Plant
from vegtool.refine import planes as module
from vegtool.refine.planes import PlaneOptions, merged, moved, pairs, planes, settled
from vegtool.refine.planes_pieces import (
    AXES,
    Pieces,
    Planes,
    Weights,
    costs,
    fit,
    least_costs,
    least_eigenvalues,
    pieces_of,
    tensor,
    together,
)
from vegtool.refine.planes_seen import COLUMN, DIRECTIONS, even_directions, seen

WEIGHTS = Weights(0.05, 0.003)
PIXEL = 0.01
"""Metres, where plants are a metre or two in size."""
seeds = st.integers(0, 2**32 - 1)


def all_of(plant: Plant) -> IntArray:
    return np.arange(len(plant.faces), dtype=np.int32)


def foliage(seed: int, cards: int = 60, size: float = 0.1) -> FloatArray:
    """Corners (2 cards, 3, 3) of square leaf cards anywhere within a metre, turned anyhow."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-0.5, 0.5, (cards, 3))
    frames = np.linalg.qr(rng.normal(size=(cards, 3, 3)))[0] * size / 2
    u, v = frames[:, 0], frames[:, 1]
    a, b, c, d = (middle + x * u + y * v for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3, 3)


def faces_alone(plant: Plant) -> Pieces:
    """Every face as a piece."""
    return pieces_of(plant, np.arange(len(plant.faces)))[0]


def turned(corners: FloatArray, seed: int) -> FloatArray:
    """Corners in some other position, size and direction."""
    rng = np.random.default_rng(seed)
    axes, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    axes *= np.sign(np.diag(upper))
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return np.asarray(rng.uniform(0.1, 10) * (corners @ axes.T) + rng.normal(size=3) * 3)


def cost_by_sampling(
    corners: FloatArray, center: FloatArray, normal: FloatArray, weights: Weights
) -> float:
    """What a face costs on a plane, from many points of it, term by term."""
    n = 60
    i, j = np.meshgrid(np.arange(n), np.arange(n))
    inside = i + j < n
    upper = i + j < n - 1  # each small square has two halves, of equal size
    at = np.concatenate(
        [
            np.stack([i[inside] + 1 / 3, j[inside] + 1 / 3], 1),
            np.stack([i[upper] + 2 / 3, j[upper] + 2 / 3], 1),
        ]
    )
    a, b, c = corners
    points = a + at[:, :1] / n * (b - a) + at[:, 1:] / n * (c - a)
    square = ((points - center) ** 2).sum(axis=1).mean()
    depth = (((points - center) @ normal) ** 2).mean()
    facing = np.cross(b - a, c - a)
    facing /= np.linalg.norm(facing)
    flat = weights.compactness * (square - depth)  # the distance within the plane
    return float(depth + flat + weights.orientation * (1 - (facing @ normal) ** 2))


@settings(max_examples=10, deadline=None)
@given(seeds)
def test_a_face_costs_what_its_points_cost(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plant = plant_of(rng.normal(size=(3, 3, 3)))
    pieces = faces_alone(plant)
    normal = rng.normal(size=(4, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    there = Planes(rng.normal(size=(4, 3)), normal)
    left, right = costs(pieces, there, WEIGHTS)
    corners = own_corners(plant)[0]
    for face in range(3):
        for plane in range(4):
            plain = cost_by_sampling(corners[face], there.center[plane], normal[plane], WEIGHTS)
            assert left[face] @ right[:, plane] == pytest.approx(plain, rel=1e-3)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_no_other_plane_costs_a_cluster_less(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pieces = faces_alone(plant_of(foliage(seed, 8)))
    cluster = together(pieces, np.zeros(len(pieces), dtype=np.int64))
    best = fit(cluster, WEIGHTS)
    normal = rng.normal(size=(500, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    others = Planes(best.center + rng.normal(size=(500, 3)) * 0.1, normal)
    near = Planes(np.repeat(best.center, 500, 0), best.normal + 0.01 * normal)
    near = replace(near, normal=near.normal / np.linalg.norm(near.normal, axis=1, keepdims=True))

    def total(there: Planes) -> FloatArray:
        left, right = costs(pieces, there, WEIGHTS)
        return np.asarray(pieces.weight @ (left @ right))

    least = total(best)[0]
    assert least == pytest.approx(least_costs(cluster, WEIGHTS)[0], abs=1e-12)
    assert (total(others) >= least - 1e-12).all()
    assert (total(near) >= least - 1e-12).all()


@settings(max_examples=50, deadline=None)
@given(seeds, st.sampled_from([0.0, 1e-12, 1e-3, 1.0]))
def test_eigenvalues_in_closed_form(seed: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(40, 3, 3)) * [1.0, spread, spread**2]
    matrix = root @ np.swapaxes(root, 1, 2)
    six = np.stack([matrix[:, i, j] for i, j in AXES], axis=1)
    plain = np.linalg.eigvalsh(matrix)
    assert least_eigenvalues(six) == pytest.approx(plain[:, 0], abs=1e-7 * plain.max())


def test_of_equal_eigenvalues_all_are_the_least() -> None:
    six = np.array([[2.0, 2, 2, 0, 0, 0], [0, 0, 0, 0, 0, 0], [-1e-200, -1e-200, -1e-200, 0, 0, 0]])
    assert least_eigenvalues(six) == pytest.approx([2, 0, 0])


def test_pairs_are_what_their_pieces_are_together() -> None:
    pieces = faces_alone(plant_of(foliage(3, 10)))
    a, b = np.arange(10), np.arange(10, 20)
    joined = pairs(pieces, a, b)
    plain = together(pieces[np.concatenate([a, b])], np.tile(np.arange(10), 2))
    for name in ("weight", "middle", "second", "looks"):
        assert getattr(joined, name) == pytest.approx(getattr(plain, name), abs=1e-12)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(1, 40))
def test_pieces_move_to_the_best_of_all_planes(seed: int, count: int) -> None:
    """With fewer planes than are looked at, those near are all; the plain way tries each."""
    assert count < module.NEAR
    pieces = faces_alone(plant_of(foliage(seed)))
    labels = np.random.default_rng(seed).integers(0, count, len(pieces))
    labels[:count] = np.arange(count)
    there = fit(together(pieces, labels), WEIGHTS)
    left, right = costs(pieces, there, WEIGHTS)
    best = (left @ right).argmin(axis=1)
    expected = np.unique(best, return_inverse=True)[1]
    assert np.array_equal(moved(pieces, labels, there, WEIGHTS), expected)


@settings(max_examples=15, deadline=None)
@given(seeds, st.integers(1, 60))
def test_no_round_makes_it_worse(seed: int, count: int) -> None:
    pieces = faces_alone(plant_of(foliage(seed, 100)))
    labels = np.random.default_rng(seed).integers(0, count, len(pieces))
    labels = np.unique(labels, return_inverse=True)[1]

    def cost(labels: Labels) -> float:
        return float(least_costs(together(pieces, labels), WEIGHTS).sum())

    before = cost(labels)
    for _ in range(8):
        labels = moved(pieces, labels, fit(together(pieces, labels), WEIGHTS), WEIGHTS)
        now = cost(labels)
        assert now <= before * (1 + 1e-9)
        before = now


def test_merging_starts_with_the_pair_that_costs_least() -> None:
    """Of all pairs of nine cards, tried one by one."""
    pieces = faces_alone(plant_of(foliage(5, 9)[::2]))
    n = len(pieces)
    assert n <= module.PARTNERS  # so that every other is a neighbour
    alone = np.arange(n)
    added = {}
    for a in range(n):
        for b in range(a + 1, n):
            labels = np.unique(np.where(alone == b, a, alone), return_inverse=True)[1]
            added[a, b] = float(least_costs(together(pieces, labels), WEIGHTS).sum())
    labels = merged(pieces, alone, n - 1, WEIGHTS)
    assert float(least_costs(together(pieces, labels), WEIGHTS).sum()) == min(added.values())


def test_two_layers_of_leaves_are_two_planes() -> None:
    """Flat leaves at two heights, 200 of them: one plane each, and nothing is drawn beside."""
    rng = np.random.default_rng(1)
    height = np.repeat([0.0, 0.3], 100)
    middle = np.column_stack([rng.uniform(-1, 1, 200), height, rng.uniform(-1, 1, 200)])
    u, v = np.array([0.05, 0, 0]), np.array([0, 0, 0.05])
    corners = np.stack([np.stack([c - u - v, c - u + v, c + u]) for c in middle])
    labels, billboards = planes(plant_of(corners), np.arange(200, dtype=np.int32), 2, PIXEL)
    assert len(billboards) == 2
    assert np.array_equal(labels == labels[0], height == 0)
    assert billboards.half_depth == pytest.approx(0, abs=1e-8)  # features are rounded to 1e-9
    assert np.abs(np.cross(billboards.u, billboards.v)[:, 1]) == pytest.approx(1)


def test_leaves_of_two_directions_are_shown_from_their_front() -> None:
    """Two kinds of leaves among each other, at right angles: no plane mixes them."""
    rng = np.random.default_rng(2)
    x, y, z = 0.05 * np.eye(3)
    corners = []
    for i in range(80):
        c = rng.uniform(-0.06, 0.06, 3)
        side = x if i % 2 else z
        corners += [np.stack([c - side - y, c + side - y, c + y])]
    labels, _ = planes(plant_of(corners), np.arange(80, dtype=np.int32), 8, PIXEL)
    kinds = np.arange(80) % 2
    assert all(len(set(kinds[labels == label])) == 1 for label in set(labels.tolist()))


@settings(max_examples=5, deadline=None)
@given(seeds)
def test_a_plant_turned_moved_and_scaled_is_cut_alike(seed: int) -> None:
    corners = foliage(seed)
    one, other = plant_of(corners), plant_of(turned(corners, seed))
    labels, here = planes(one, all_of(one), 12, PIXEL * one.radius)
    again, there = planes(other, all_of(other), 12, PIXEL * other.radius)
    assert np.array_equal(labels, again)
    assert len(here) == len(there)


def test_the_same_again_and_the_plant_unchanged() -> None:
    plant = plant_of(foliage(8))
    before = plant.positions.copy()
    labels, one = planes(plant, all_of(plant), 20, PIXEL, seed=1)
    again, other = planes(plant, all_of(plant), 20, PIXEL, seed=2)
    assert np.array_equal(plant.positions, before)
    assert np.array_equal(labels, again)
    assert np.array_equal(one.center, other.center) and np.array_equal(one.u, other.u)


def test_faces_that_are_not_asked_for_are_not_shown() -> None:
    plant = plant_of(foliage(4))
    asked = np.arange(10, 60, dtype=np.int32)
    labels, billboards = planes(plant, asked, 5, PIXEL)
    rest = np.setdiff1d(all_of(plant), asked)
    assert set(labels[asked].tolist()) == set(billboards.cluster.tolist()) == set(range(5))
    assert set(labels[rest].tolist()) == {5}


def checked(plant: Plant, count: int) -> Billboards:
    """Billboards of a plant that show each of its corners within their rectangle and depth."""
    labels, billboards = planes(plant, all_of(plant), count, PIXEL)
    assert 1 <= len(billboards) <= count
    assert np.array_equal(np.sort(billboards.cluster), np.arange(len(billboards)))
    offset = plant.corners - billboards.center[labels][:, None]
    room = 1e-9 * plant.radius + 1e-12 * np.abs(plant.positions).max()
    for axis, half in (
        (billboards.u, billboards.half_size[:, 0]),
        (billboards.v, billboards.half_size[:, 1]),
        (np.cross(billboards.u, billboards.v), billboards.half_depth),
    ):
        along = np.abs(np.einsum("fci,fi->fc", offset, axis[labels]))
        assert (along <= half[labels][:, None] + room).all()
    return billboards


@settings(max_examples=40, deadline=None)
@given(
    seeds,
    st.integers(1, 40),
    st.sampled_from(
        ["coplanar", "one", "no area", "points", "alike", "far", "needle", "sphere", "mixed"]
    ),
)
def test_anything_that_can_be_read_has_planes(seed: int, count: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(30, 3, 3))
    if kind == "coplanar":
        corners[..., rng.integers(3)] = 2.0
    elif kind == "one":
        corners = corners[:1]
    elif kind == "no area":
        corners[:, 2] = corners[:, 1]
    elif kind == "points":
        corners = np.repeat(corners[:, :1], 3, axis=1)
    elif kind == "alike":
        corners = np.repeat(corners[:3], 10, axis=0)
    elif kind == "far":
        corners += 1e6
    elif kind == "needle":
        corners *= [1e-6, 1.0, 1e-6]
    elif kind == "sphere":
        corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    else:
        corners[::2, 2] = corners[::2, 1]
    checked(plant_of(corners), count)


def test_everything_at_one_point() -> None:
    assert len(checked(plant_of(np.ones((4, 3, 3))), 3)) <= 3


def test_more_billboards_than_leaf_cards() -> None:
    assert len(checked(plant_of(foliage(6, 7)), 1000)) == 7


def test_nothing_to_show() -> None:
    plant = plant_of(foliage(6, 3))
    labels, billboards = planes(plant, np.empty(0, dtype=np.int32), 5, PIXEL)
    assert len(billboards) == 0 and len(labels) == 6


def test_no_billboards_asked_for() -> None:
    plant = plant_of(foliage(6, 3))
    with pytest.raises(UsageError, match="at least 1, got 0"):
        planes(plant, all_of(plant), 0, PIXEL)


def test_many_pieces_start_from_clusters(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coarse start ends nearly where the fine one does: within a fifth of what it costs."""
    plant = plant_of(foliage(7, 400))

    def cost() -> float:
        labels, found = planes(plant, all_of(plant), 30, PIXEL, PlaneOptions(outside=0))
        assert len(found) == 30
        pieces = faces_alone(plant)
        return float(least_costs(together(pieces, labels.astype(np.int64)), WEIGHTS).sum())

    fine = cost()
    monkeypatch.setattr(module, "MOST_PIECES", 200)
    assert cost() < 1.2 * fine


def seen_plainly(pieces: Pieces, surface: float, size: float, opacity: float) -> FloatArray:
    """The same, piece by piece and direction by direction."""
    result = np.zeros(len(pieces))
    shown = np.zeros(len(pieces))
    for d in even_directions(DIRECTIONS):
        turn = [np.sqrt(max(p @ tensor(d[None])[0], 0)) for p in pieces.looks]
        across = np.cross(d, np.eye(3)[np.abs(d).argmin()])
        across /= np.linalg.norm(across)
        other = np.cross(d, across)
        cell = [
            tuple(np.floor(np.array([x @ across, x @ other]) / (COLUMN * size) + 0.5).astype(int))
            for x in pieces.middle
        ]
        for i in range(len(pieces)):
            sums = {True: 0.0, False: 0.0}
            for j in range(len(pieces)):
                if i != j and cell[i] == cell[j]:
                    nearer = bool(pieces.middle[j] @ d > pieces.middle[i] @ d)
                    sums[nearer] += opacity * surface * pieces.weight[j] * turn[j]
            column = (COLUMN * size) ** 2
            result[i] += turn[i] * sum(np.exp(-s / column) for s in sums.values()) / 2
            shown[i] += turn[i]
    return result / shown


def test_what_is_seen_is_what_one_finds_piece_by_piece() -> None:
    pieces = faces_alone(plant_of(foliage(9, 20)))
    plain = seen_plainly(pieces, 3.0, 0.1, 0.7)
    assert seen(pieces, 3.0, 0.1, 0.7) == pytest.approx(plain, abs=1e-9)


def test_of_a_stack_of_leaves_the_outer_ones_are_seen() -> None:
    """Nine large leaves upon each other, seen from above and below."""
    quad = np.array([[[-1, 0, -1], [1, 0, -1], [1, 0, 1]], [[-1, 0, -1], [1, 0, 1], [-1, 0, 1]]])
    corners = np.concatenate([quad + np.array([0, 0.05 * i, 0]) for i in range(9)])
    plant = plant_of(corners)
    pieces, _, surface = pieces_of(plant, np.arange(9).repeat(2))
    share = seen(pieces, surface, 1.0, 1.0)
    assert share.argmin() == 4
    assert (np.diff(share)[:4] < 0).all() and (np.diff(share)[4:] > 0).all()


def test_hidden_leaves_have_a_plane_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "seen", lambda pieces, *_: np.zeros(len(pieces)))
    assert len(checked(plant_of(foliage(10)), 9)) == 9


@pytest.mark.models
def test_an_ash_costs_less_than_by_kmeans(models: Path) -> None:
    plant = read_plant(next((models / "eztree_ash_small").rglob("*.glb")))
    leaves = np.flatnonzero(plant.face_is_leaf).astype(np.int32)
    labels, billboards = planes(plant, leaves, 400, PIXEL * plant.radius, PlaneOptions(outside=0))
    assert len(billboards) == 400
    shown = replace(
        plant,
        faces=plant.faces[leaves],
        face_material=plant.face_material[leaves],
        branches=None,
    )
    first = cluster(shown, "kmeans", 400, ClusterOptions(orientation_weight=0.12))
    pieces = faces_alone(shown)

    def cost(of_face: IntArray) -> float:
        weights = Weights(0.01, 0.003)
        return float(least_costs(together(pieces, of_face.astype(np.int64)), weights).sum())

    assert cost(labels[leaves]) < 0.7 * cost(first)


def test_moving_ends_where_nothing_is_saved() -> None:
    pieces = faces_alone(plant_of(foliage(11, 200)))
    start = merged(pieces, np.arange(len(pieces)), 40, WEIGHTS)
    done = settled(pieces, start, WEIGHTS, PlaneOptions(rounds=100, settled=0.0))
    again = settled(pieces, done, WEIGHTS, PlaneOptions(rounds=1, settled=0.0))
    assert np.array_equal(done, again)
