"""Baking: what a picture covers, wherever and however large the plant is."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.baking.bake import bake, pairs
from vegtool.boxes import BoxOptions, make_billboards
from vegtool.clustering import cluster
from vegtool.lod import Billboards, Level
from vegtool.seeding import generator
from vegtool.stability.case import (
    Case,
    Outcome,
    drawn,
    exact,
    holds,
    relative,
    same_objective,
)
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import MOTIONS, TRIANGLE, Motion, at, rotated, soup, tree

TEXELS = 150
"""Along the tree's height."""
NONE = np.zeros(1, dtype=np.int32)
"""The cluster of a lone billboard."""


def covered_area(baked: Level) -> float:
    """Square metres: what the pictures cover."""
    assert baked.billboards is not None and baked.atlas is not None
    alpha = baked.atlas.color[..., 3] / 255
    shares = [alpha[y : y + h, x : x + w].mean() for x, y, w, h in baked.atlas.front.tolist()]
    return float(4 * baked.billboards.half_size.prod(axis=1) @ np.array(shares))


def moved(billboards: Billboards, motion: Motion) -> Billboards:
    """Billboards that move with their plant."""
    return Billboards(
        motion.of(billboards.center),
        rotated(billboards.u, motion.turn),
        rotated(billboards.v, motion.turn),
        motion.scale * billboards.half_size,
        motion.scale * billboards.half_depth,
        billboards.cluster,
    )


@cache
def clouds() -> tuple[IntArray, Billboards, float]:
    """The tree's clusters, their billboards, and the area that their pictures cover."""
    labels = cluster(tree(), "kmeans", 60)
    billboards = make_billboards(tree(), labels, BoxOptions())
    return (
        labels,
        billboards,
        covered_area(bake(tree(), labels, billboards, TEXELS / tree().height)),
    )


def motion_changes_nothing(motion: Motion) -> Outcome:
    """Sixty clusters of a tree and their billboards, moved as one: the same area is covered."""
    labels, billboards, here = clouds()
    density = TEXELS / tree().height / motion.scale
    baked = bake(motion.plant(tree()), labels, moved(billboards, motion), density)
    there = covered_area(baked) / motion.scale**2
    same = drawn if motion.turns else same_objective
    return same(relative(there, here), note=f"{len(billboards)} pictures")


def half_a_picture(motion: Motion) -> Outcome:
    """A leaf that fills half of its billboard, edge on a sample: half is covered, exactly."""
    square = np.array([[-1.0, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0]])
    plant = soup(np.stack([square[[0, 1, 2]], square[[0, 2, 3]]]))
    board = Billboards(
        np.zeros((1, 3)), np.eye(3)[:1], np.eye(3)[1:2], np.ones((1, 2)), np.ones(1), NONE
    )
    labels = np.zeros(2, dtype=np.int32)
    baked = bake(motion.plant(plant), labels, moved(board, motion), 16 / motion.scale)
    return exact(relative(covered_area(baked) / motion.scale**2, 2.0))


def one_large_leaf() -> Outcome:
    """Twenty clusters of small leaves, with and without a leaf 1e4 times larger beside them."""
    random = generator(0, "stability", "bake")
    small = at(10 * random.random((200, 3)), 1.0)
    labels = (np.arange(200) // 10).astype(np.int32)
    billboards = make_billboards(soup(small), labels, BoxOptions(shape="single"))
    alone = covered_area(bake(soup(small), labels, billboards, 10.0))
    both = soup(np.concatenate([small, 1e4 * TRIANGLE[None]]))
    beside = covered_area(bake(both, np.append(labels, 20).astype(np.int32), billboards, 10.0))
    size = float(billboards.half_size.min())
    return drawn(relative(beside, alone), both.radius / size)


def a_million() -> Outcome:
    """A square of a million triangles in one picture: all of it is covered, without a seam."""
    columns, rows = np.meshgrid(np.arange(1000.0), np.arange(500.0))
    low = np.stack([columns, rows, np.zeros_like(rows)], axis=-1).reshape(-1, 1, 3)
    cells = low + np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    plant = soup(np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]))
    board = Billboards(
        plant.center[None],
        np.eye(3)[:1],
        np.eye(3)[1:2],
        np.array([[500.0, 250.0]]),
        np.ones(1),
        NONE,
    )
    baked = bake(plant, np.zeros(len(plant.faces), dtype=np.int32), board, 0.5)
    return exact(relative(covered_area(baked), 500_000.0), note=f"{len(plant.faces):,} triangles")


def always_some(made: Callable[[], FloatArray]) -> Outcome:
    """A picture of anything, the same bytes twice."""
    plant = soup(made())
    labels = np.zeros(len(plant.faces), dtype=np.int32)
    billboards = make_billboards(plant, labels)
    density = 32 / (plant.radius or 1.0)
    one, two = (bake(plant, labels, billboards, density).atlas for _ in range(2))
    assert one is not None and two is not None
    wrong = [
        not np.array_equal(one.color, two.color),
        not np.array_equal(one.depth, two.depth),
        bool((one.front[:, 2:] < 1).any()),
    ]
    note = f"atlas {one.color.shape[1]} x {one.color.shape[0]}"
    return holds(sum(wrong), "pictures with texels, twice the same", note=note)


def all_pairs() -> Outcome:
    """Faces with the billboards that show them, against all pairs there are."""
    random = generator(0, "stability", "pairs")
    labels = random.integers(0, 9, 400).astype(np.int32)
    shown = random.integers(0, 12, 30).astype(np.int32)  # some clusters have none, some no faces
    face, board = pairs(labels, shown)
    found = set(zip(face.tolist(), board.tolist(), strict=True))
    truth = set(zip(*(a.tolist() for a in np.nonzero(labels[:, None] == shown)), strict=True))
    return holds(len(found ^ truth) + len(face) - len(found), "every pair once")


CASES = (
    Case("pairs of faces and billboards", "baking", "exact", all_pairs),
    *(
        Case(f"half a picture, {motion.name}", "baking", "exact",
             partial(half_a_picture, motion), gl=True)
        for motion in MOTIONS
    ),
    *(
        Case(f"coverage of a tree, {motion.name}", "baking", "equivariance",
             partial(motion_changes_nothing, motion), gl=True)
        for motion in MOTIONS
    ),
    Case("coverage beside a leaf 1e4 times larger", "baking", "equivariance",
         one_large_leaf, gl=True),
    Case("coverage by a million triangles", "baking", "exact", a_million, gl=True),
    *(
        Case(f"pictures of {name}", "baking", "property", partial(always_some, made), gl=True)
        for name, (made, _) in DEGENERATE.items()
    ),
)  # fmt: skip
