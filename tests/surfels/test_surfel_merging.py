"""Billboards merged in pairs: by the slow way round, of few steps below, and of what cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.arrays import FloatArray
from vegtool.gl.cells import covered
from vegtool.surfels.box import boxes_of
from vegtool.surfels.merging import Merging, best_for_both, flatness, merged, nearest_pairs

pytestmark = pytest.mark.gl


def ground(cells: int, height: float = 0.0, seed: int = 0) -> tuple[FloatArray, np.ndarray]:
    """Cells of a square, each two triangles and a billboard of the base."""
    at = np.linspace(0, 1, cells + 1)
    x, z = np.meshgrid(at, at, indexing="ij")
    y = height * np.random.default_rng(seed).normal(size=x.shape)
    p = np.stack([x, y, z], axis=-1)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, 1:], p[1:, :-1]
    cell = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=2)
    corners = cell.reshape(-1, 3, 3)
    return corners, np.arange(0, len(corners), 2)


def triangles_of(children: np.ndarray, first: np.ndarray, total: int) -> list[np.ndarray]:
    ends = np.append(first[1:], total)
    sets = [np.arange(a, b) for a, b in zip(first, ends, strict=True)]
    for a, b in children:
        sets.append(np.concatenate([sets[a], sets[b]]))
    return sets


def test_all_come_together_once() -> None:
    corners, first = ground(7, 0.02)
    children = merged(corners, first)
    assert children.dtype == np.int32 and len(children) == len(first) - 1
    assert sorted(children.ravel().tolist()) == list(range(2 * len(first) - 2))
    assert (children < len(first) + np.arange(len(children))[:, None]).all(), "made before"
    root = triangles_of(children, first, len(corners))[-1]
    assert sorted(root.tolist()) == list(range(len(corners)))


def slow(corners: FloatArray, first: np.ndarray, k: int, depth: int) -> list[tuple[int, int]]:
    """The same, every weight anew in every round, all distances compared."""
    work = Merging(corners, first, depth)
    left = list(range(len(first)))
    while len(left) > 1:
        weight = {}
        for a in left:
            away = {b: np.linalg.norm(work.center[a] - work.center[b]) for b in left if b != a}
            for b in sorted(away, key=away.__getitem__)[:k]:
                pair = (min(a, b), max(a, b))
                weight[pair] = float(work.weights(np.array([pair]))[0])
        order = sorted(weight, key=lambda pair: (-weight[pair], pair))
        made, taken = [], set()
        for pair in order:
            rivals = [o for o in order[: order.index(pair)] if set(o) & set(pair)]
            if not rivals:
                made.append(pair)
                taken |= set(pair)
        new = work.merge(np.array(made))
        left = [one for one in left if one not in taken] + new.tolist()
    return work.children


@pytest.mark.parametrize("depth", [0, 1, 5])
def test_the_slow_way_round_comes_to_the_same(depth: int) -> None:
    corners, first = ground(5, 0.05, seed=3)
    fast = merged(corners, first, neighbours=6, depth=depth)
    assert [tuple(pair) for pair in fast.tolist()] == slow(corners, first, 6, depth)


def test_flat_neighbours_come_before_bent_ones() -> None:
    """Two squares in one plane, and two across: each pair of a plane is the best for both."""
    flat, _ = ground(2)
    up = flat[:, :, [1, 0, 2]] + [2.0, 0.0, 0.0]
    corners = np.concatenate([flat, up])
    children = merged(corners, np.arange(0, len(corners), 2))
    sets = triangles_of(children, np.arange(0, len(corners), 2), len(corners))[8:]
    for own in sets[:-1]:
        assert (own < 8).all() or (own >= 8).all()


def test_few_steps_below_are_enough_of_the_ground() -> None:
    """With billboards one step below in place of triangles, a plane stays a plane."""
    corners, first = ground(8)
    children = merged(corners, first, depth=1)
    for own in triangles_of(children, first, len(corners))[len(first) :]:
        assert boxes_of(corners[own], np.array([0])).half[0, 2] < 1e-12


def test_pieces_below_are_as_many_as_steps_say() -> None:
    corners, first = ground(8, 0.02)
    work = Merging(corners, first, depth=2)
    new = np.arange(len(first))
    while len(new) > 1:
        new = work.merge(new.reshape(-1, 2))
    assert len(work.pieces[-1]) == 2 * 4, "four billboards two steps below the root"


@pytest.mark.parametrize(
    ("corners", "first"),
    [
        (np.zeros((3, 3, 3)), np.arange(3)),
        (np.zeros((12, 3, 3)), np.arange(12)),
        (np.random.default_rng(0).normal(size=(20, 1, 3)).repeat(3, axis=1), np.arange(20)),
        (np.linspace(0, 1, 30).reshape(10, 3, 1) * [1.0, 2.0, 3.0], np.arange(10)),
        (np.random.default_rng(0).normal(size=(1, 3, 3)), np.arange(1)),
        (1e-9 * np.random.default_rng(0).normal(size=(6, 3, 3)) + 1e3, np.arange(6)),
    ],
    ids=["one place", "a crowd in one place", "points", "a line", "one triangle", "a speck"],
)
def test_what_is_degenerate_comes_together_too(corners: FloatArray, first: np.ndarray) -> None:
    children = merged(corners, first)
    assert len(children) == len(first) - 1
    assert np.array_equal(children, merged(corners, first)), "the same twice"


def test_best_for_both_is_the_best_of_each() -> None:
    pairs = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
    assert best_for_both(pairs, np.array([0.5, 0.9, 0.7, 0.8]), 5).tolist() == [1, 3]
    assert best_for_both(pairs, np.array([0.5, 0.5, 0.5, 0.5]), 5).tolist() == [0]


def test_nearest_pairs_are_the_nearest() -> None:
    center = np.array([[0.0, 0, 0], [1, 0, 0], [10, 0, 0], [11, 0, 0]])
    pairs = {tuple(pair) for pair in nearest_pairs(center, 1).tolist()}
    assert pairs == {(0, 1), (2, 3)}


def test_flatness_is_that_of_the_paper() -> None:
    """A box of half sizes 4, 1 and 1/2: 1 - 0.5 / 2."""
    corners = np.array([[[-4, -1, -0.5], [4, 1, 0.5], [-4, 1, -0.5]], [[4, -1, 0.5]] * 3])
    box = boxes_of(corners, np.array([0]))
    w, h, d = box.half[0]
    assert flatness(box)[0] == pytest.approx(1 - d / np.sqrt(w * h))


def test_cells_are_covered_as_far_as_triangles_reach() -> None:
    """Half of a square is covered by a triangle, all by two, none by none; 200 cells at once."""
    half = np.array([[[-1, -1], [1, -1], [-1, 1]]], dtype=float)
    other = np.array([[[1, 1], [-1, 1], [1, -1]]], dtype=float)
    corners = np.concatenate([half, half, other, half])
    found = covered(corners, np.array([0, 2, 2, 199]), 200)
    assert found[0] == pytest.approx(0.5, abs=0.04)
    assert found[2] == 1.0 and found[199] == found[0]
    assert found[1] == 0 and found[3:199].max() == 0
    back = covered(half[:, ::-1], np.array([0]), 1)
    assert back[0] == pytest.approx(0.5, abs=0.04), "either side"
