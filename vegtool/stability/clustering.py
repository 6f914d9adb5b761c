"""Clustering: the same clusters for the same plant, and some for every plant."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache, partial

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.clustering import METHODS, ClusterOptions, cluster
from vegtool.clustering.features import face_features, face_weights
from vegtool.clustering.partition import error
from vegtool.plant import Plant
from vegtool.seeding import generator
from vegtool.stability.case import (
    Case,
    Outcome,
    exact,
    holds,
    relative,
    same_objective,
)
from vegtool.stability.plants import (
    MOTIONS,
    TRIANGLE,
    Motion,
    at,
    cube_points,
    soup,
    sphere_points,
    tree,
)

COUNT = 60
"""Clusters of the tree."""


def inertia(plant: Plant, labels: IntArray, options: ClusterOptions, count: int) -> float:
    """The objective: area-weighted squared distances, in features of the plant's own frame."""
    points = face_features(plant, options.orientation_scale(count))
    return error(points, face_weights(plant), labels.astype(np.int64))


@cache
def of_tree(method: str, options: ClusterOptions) -> IntArray:
    """Labels of the tree where it stands."""
    return cluster(tree(), method, COUNT, options)


def motion_changes_nothing(method: str, motion: Motion, options: ClusterOptions) -> Outcome:
    """Labels found on the plant moved are as good on the plant itself as its own."""
    plant = tree()
    here = of_tree(method, options)
    there = cluster(motion.plant(plant), method, COUNT, options)
    found, own = (inertia(plant, labels, options, COUNT) for labels in (there, here))
    note = "same clusters" if np.array_equal(here, there) else "other clusters"
    return same_objective(relative(found, own), motion.offset_over(plant.radius), note=note)


def ties_turned(method: str) -> Outcome:
    """Where every distance ties with many others, the file's order decides, not rounding."""
    plant = soup(at(cube_points(6)))
    turned = MOTIONS[3].plant(plant)
    options = ClusterOptions()
    labels = [cluster(p, method, 12, options) for p in (plant, turned)]
    found, own = (inertia(plant, label, options, 12) for label in reversed(labels))
    return same_objective(relative(found, own))


def always_some(method: str, made: Callable[[], FloatArray], distinct: int) -> Outcome:
    """As many clusters as asked for, or as there are distinct faces; the same ones every time."""
    asked = 5
    plant = soup(made())
    labels = cluster(plant, method, asked)
    used = np.unique(labels)
    wrong = [
        labels.shape != (len(plant.faces),),
        not np.array_equal(used, np.arange(len(used))),
        len(used) != min(asked, distinct),
        not np.array_equal(labels, cluster(plant, method, asked, seed=1)),
    ]
    return holds(
        sum(wrong), f"{min(asked, distinct)} clusters, twice the same", note=f"{asked} asked"
    )


def lattices_found(method: str, motion: Motion) -> Outcome:
    """Five lattices of 27 small triangles, far apart: the inertia is that of a lattice, 2 h^2."""
    step = 2.0**-7
    centers = np.array([[0.0, 0, 0], [3, 1, 0], [-2, 4, 1], [5, -3, 2], [1, 7, -4]])
    points = (centers[:, None] + step * cube_points(3)).reshape(-1, 3)
    plant = motion.plant(soup(at(points, 2.0**-12)))
    labels = cluster(plant, method, 5)
    centroid = plant.face_centroids - plant.center
    squares = 0.0
    for label in range(5):
        mine = centroid[labels == label]
        squares += float(((mine - mine.mean(axis=0)) ** 2).sum())
    truth = 2 * (motion.scale * step) ** 2
    return exact(relative(squares / len(points), truth), motion.offset_over(step))


def inertia_in_fractions() -> Outcome:
    """The sum of squares as clustering computes it, against rational numbers."""
    random = generator(0, "stability", "inertia")
    points, weights = random.normal(size=(300, 3)), random.random(300)
    weights /= weights.sum()
    labels = np.arange(300) % 7
    truth = Fraction(0)
    for label in range(7):
        mine = [[Fraction(float(x)) for x in p] for p in points[labels == label]]
        mass = [Fraction(float(w)) for w in weights[labels == label]]
        for axis in zip(*mine, strict=True):
            mean = sum(w * x for w, x in zip(mass, axis, strict=True)) / sum(mass)
            truth += sum(w * (x - mean) ** 2 for w, x in zip(mass, axis, strict=True))
    return exact(relative(error(points, weights, labels), float(truth)))


def needle() -> FloatArray:
    """(1000, 3, 3) triangles along a line, a millionth of its length off it."""
    random = generator(0, "stability", "needle")
    return at(random.random((1000, 3)) * [1, 1e-6, 1e-6], 1e-8)


def flat() -> FloatArray:
    """(400, 3, 3) triangles in a plane that lies along no axis."""
    random = generator(0, "stability", "flat")
    inside = random.random((400, 2)) @ [[1.0, 0.3, -0.2], [0.1, 1.0, 0.4]]
    return inside[:, None] + 0.01 * np.array([[0, 0, 0], [1, 0.3, -0.2], [0.1, 1.0, 0.4]])


def collinear() -> FloatArray:
    """(50, 3, 3) triangles without area, all on one line."""
    steps = np.arange(50.0)[:, None] + np.array([0.0, 0.3, 0.9])
    return np.asarray(steps[..., None] * np.array([0.3, 0.5, 0.7]))


def partly_without_area() -> FloatArray:
    """(450, 3, 3) triangles in a plane, and fifty without area across it."""
    return np.concatenate([flat(), collinear() - 8.0])


def duplicates() -> FloatArray:
    """(100,000, 3, 3) copies of four triangles."""
    return np.tile(at(np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])), (25_000, 1, 1))


def one_large() -> FloatArray:
    """(201, 3, 3) a leaf, and two hundred a ten thousandth of its size."""
    random = generator(0, "stability", "large")
    return np.concatenate([1e4 * TRIANGLE[None], at(random.random((200, 3)), 1.0)])


DEGENERATE: dict[str, tuple[Callable[[], FloatArray], int]] = {
    "a needle of aspect 1e6": (needle, 1000),
    "coplanar": (flat, 400),
    "collinear, without area": (collinear, 50),
    "zero-area triangles among others": (partly_without_area, 450),
    "all points equal": (lambda: np.full((60, 3, 3), 7.0), 1),
    "two points": (lambda: np.repeat([[[0.0] * 3] * 3, [[1.0] * 3] * 3], 30, axis=0), 2),
    "one triangle": (lambda: TRIANGLE[None], 1),
    "1e5 duplicates of four": (duplicates, 4),
    "a sphere": (lambda: at(sphere_points(500)), 500),
    "a cube": (lambda: at(cube_points(8)), 512),
    "one leaf 1e4 times larger": (one_large, 201),
}
"""Name -> (corners, how many distinct faces)."""

IN_ONE_PLACE = tuple(method for method in METHODS if method != "planes")
"""Whose clusters are. A plane passes any three of five lattices."""

BY_PLACE, BOTH = ClusterOptions(), ClusterOptions(orientation_weight=0.12)

CASES = (
    Case("inertia in rational numbers", "clustering", "exact", inertia_in_fractions),
    *(
        Case(f"{method}: five lattices, {motion.name}", "clustering", "exact",
             partial(lattices_found, method, motion))
        for method in IN_ONE_PLACE
        for motion in MOTIONS
    ),
    *(
        Case(f"{method}: a tree, {motion.name}{name}", "clustering", "equivariance",
             partial(motion_changes_nothing, method, motion, options))
        for method in METHODS
        for motion in MOTIONS
        for name, options in (("", BY_PLACE), (", by orientation too", BOTH))
    ),
    *(
        Case(f"{method}: a cubic lattice, turned", "clustering", "equivariance",
             partial(ties_turned, method))
        for method in METHODS
    ),
    *(
        Case(f"{method}: {name}", "clustering", "property", partial(always_some, method, *made))
        for method in METHODS
        for name, made in DEGENERATE.items()
    ),
)  # fmt: skip
