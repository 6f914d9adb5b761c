"""Boxes, planes, billboards and their geometric error: known forms, and every form there is."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from math import sqrt

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes import (
    Boxes,
    BoxOptions,
    fit_boxes,
    geometric_error,
    make_billboards,
    oriented_planes,
)
from vegtool.boxes.box import MIN_EXTENT
from vegtool.boxes.fit import SHARP
from vegtool.boxes.options import PlaneFit
from vegtool.clustering import cluster
from vegtool.plant import Plant
from vegtool.stability.case import Case, Outcome, exact, holds, relative, same_objective
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import (
    MOTIONS,
    TRIANGLE,
    Motion,
    at,
    box_faces,
    cube_points,
    facing_out,
    rotated,
    rotation,
    soup,
    sphere_points,
    tree,
)

COUNT = 60
"""Clusters of the tree."""


def fitted(plant: Plant, labels: IntArray, plane: PlaneFit) -> Boxes:
    """The boxes of the clusters, by either fit."""
    count = int(labels.max()) + 1
    if plane == "orientation":
        return oriented_planes(plant.corners, labels, count)
    return fit_boxes(plant.corners.reshape(-1, 3), np.repeat(labels, 3), count)


def alone(plant: Plant) -> IntArray:
    """Labels that put all faces into one cluster."""
    return np.zeros(len(plant.faces), dtype=np.int32)


def known_box(half: tuple[float, float, float], motion: Motion) -> Outcome:
    """A box of known sides, standing at an angle: they are found."""
    corners = rotated(box_faces(half).reshape(-1, 3), rotation(1))
    plant = motion.plant(soup(corners.reshape(-1, 3, 3)))
    box = fitted(plant, alone(plant), "volume")
    truth = motion.scale * np.sort(half)[::-1]
    error = max(
        relative(a, b) if b else a / truth[0] for a, b in zip(box.half[0], truth, strict=True)
    )
    least = min(side for side in half if side)
    return exact(error, max(motion.offset, max(half)) / least)


def uneven_box() -> Outcome:
    """A brick with more points at some corners than at others: its principal axes are not its own,
    and the search by steps comes as near as it says."""
    half = (3.0, 2.0, 1.0)
    corners = rotated(box_faces(half, even=False).reshape(-1, 3), rotation(1))
    plant = soup(corners.reshape(-1, 3, 3))
    box = fitted(plant, alone(plant), "volume")
    error = relative(float(box.volume()[0]), 48.0)
    return Outcome(error, SHARP, "the search stops within this of the shortest side")


def known_triangle(plane: PlaneFit, motion: Motion) -> Outcome:
    """A triangle of sides 3, 4 and 5: its least rectangle has twice its area, 12."""
    corners = rotated(TRIANGLE * [3.0, 4.0, 0.0], rotation(1))
    plant = motion.plant(soup(corners[None]))
    box = fitted(plant, alone(plant), plane)
    area = 4 * float(np.sort(box.half[0])[1:].prod()) / motion.scale**2
    return exact(relative(area, 12.0), motion.offset)


def known_distance(motion: Motion) -> Outcome:
    """Two parallel leaves on one plane between them: each is drawn half their distance off."""
    leaf = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    corners = rotated(np.concatenate([leaf, leaf + np.array([0, 0, 0.5])]), rotation(1)).reshape(
        -1, 3, 3
    )
    plant = motion.plant(soup(corners))
    labels = alone(plant)
    billboards = make_billboards(plant, labels, BoxOptions(shape="single"))
    found = geometric_error(plant, labels, billboards)
    error = max(relative(value / motion.scale, 0.25) for value in found)
    return exact(error, motion.offset / 0.25)


def known_spheres_error(motion: Motion) -> Outcome:
    """A sphere of small triangles on three crossed planes: never off by more than 1 / sqrt 3."""
    plant = motion.plant(soup(facing_out(sphere_points(2000), 1e-3)))
    labels = alone(plant)
    billboards = make_billboards(plant, labels, BoxOptions(shape="crossed"))
    most, _ = geometric_error(plant, labels, billboards)
    over = most / motion.scale / (1 / sqrt(3)) - 1
    wrong = (len(billboards) != 3) + (over > 0.01) + (over < -0.05)
    return holds(wrong, "0.95 to 1.01 times 1 / sqrt 3", note=f"{1 + over:.3f} times")


@cache
def clusters() -> IntArray:
    """The tree's labels, by k-means."""
    return cluster(tree(), "kmeans", COUNT)


@cache
def objectives(plane: PlaneFit, motion: Motion | None) -> FloatArray:
    """Volume of the boxes, area of the billboards, and both geometric errors, for scale 1."""
    plant = tree() if motion is None else motion.plant(tree())
    scale = 1.0 if motion is None else motion.scale
    boxes = fitted(plant, clusters(), plane)
    floor = MIN_EXTENT * 2 * np.linalg.norm(boxes.half, axis=1)
    billboards = make_billboards(plant, clusters(), BoxOptions(plane=plane))
    greatest, usual = geometric_error(plant, clusters(), billboards)
    return np.array(
        [
            float(boxes.volume(floor).sum()) / scale**3,
            float(4 * billboards.half_size.prod(axis=1).sum()) / scale**2,
            greatest / scale,
            usual / scale,
            float(len(billboards)),
        ]
    )


def motion_changes_nothing(plane: PlaneFit, motion: Motion) -> Outcome:
    """Boxes, billboards and errors of sixty clusters of a tree that stands elsewhere."""
    here, there = objectives(plane, None), objectives(plane, motion)
    error = float(np.abs(there / here - 1).max())
    size = 2 * tree().radius / COUNT ** (1 / 3)
    return same_objective(error, motion.offset / size, note=f"{here[-1]:.0f} billboards")


def always_some(plane: PlaneFit, made: Callable[[], FloatArray]) -> Outcome:
    """Billboards with sides, around all of the plant, and the same ones twice."""
    plant = soup(made())
    labels = alone(plant)
    boxes = fitted(plant, labels, plane)
    options = BoxOptions(plane=plane)
    one, two = (make_billboards(plant, labels, options) for _ in range(2))
    error, _ = geometric_error(plant, labels, one)
    reach = np.abs(np.einsum("ni,ai->na", plant.positions - boxes.center[0], boxes.axes[0]))
    outside = float((reach - boxes.half[0]).max()) / (plant.radius or 1.0)
    wrong = [
        not (one.half_size > 0).all(),
        not np.array_equal(one.center, two.center),
        not np.array_equal(one.half_size, two.half_size),
        not np.allclose(boxes.axes[0] @ boxes.axes[0].T, np.eye(3), atol=1e-12),
        not np.isfinite(error) or error > 2.1 * plant.radius,
        outside > 1e-9,
    ]
    return holds(sum(wrong), "billboards with sides, twice the same", note=f"{len(one)} billboards")


def a_million() -> Outcome:
    """A million triangles in one cluster, in a lattice 100 a side: a cube of 99.01 m."""
    plant = soup(at(cube_points(100)))
    labels = alone(plant)
    box = fitted(plant, labels, "volume")
    error = relative(float(box.volume()[0]), 99.01 * 99.01 * 99.0)
    return exact(error, note=f"{len(plant.faces):,} triangles")


FORMS = {
    "a cube": (1.0, 1.0, 1.0),
    "a brick": (3.0, 2.0, 1.0),
    "a square beam": (1.0, 0.1, 0.1),
    "a slab": (1.0, 1.0, 0.1),
    "a square": (1.0, 1.0, 0.0),
    "a line": (1.0, 0.0, 0.0),
    "a needle of aspect 1e6": (1.0, 1e-6, 1e-6),
}
"""Half sides, in metres."""

FITS: tuple[PlaneFit, ...] = ("volume", "orientation")

CASES = (
    *(
        Case(f"box: {name}, {motion.name}", "boxes", "exact", partial(known_box, half, motion))
        for name, half in FORMS.items()
        for motion in MOTIONS
    ),
    *(
        Case(f"{plane}: a triangle, {motion.name}", "boxes", "exact",
             partial(known_triangle, plane, motion))
        for plane in FITS
        for motion in MOTIONS
    ),
    *(
        Case(f"error: two leaves, {motion.name}", "boxes", "exact", partial(known_distance, motion))
        for motion in MOTIONS
    ),
    *(
        Case(f"error: a sphere, {motion.name}", "boxes", "property",
             partial(known_spheres_error, motion))
        for motion in MOTIONS
    ),
    *(
        Case(f"{plane}: a tree, {motion.name}", "boxes", "equivariance",
             partial(motion_changes_nothing, plane, motion))
        for plane in FITS
        for motion in MOTIONS
    ),
    *(
        Case(f"{plane}: {name}", "boxes", "property", partial(always_some, plane, made))
        for plane in FITS
        for name, (made, _) in DEGENERATE.items()
    ),
    Case("box: a brick with uneven corners", "boxes", "property", uneven_box),
    Case("box: a million triangles", "boxes", "exact", a_million),
)  # fmt: skip
