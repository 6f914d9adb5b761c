"""Which billboards of a hierarchy are worth their texels.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.4. First go those that are no coarser than the triangles below (eq. 16), then those that are valid
over a short range only, between what is valid before and after (eq. 17).
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.surfels.base import Base
from vegtool.surfels.box import SurfelBoxes
from vegtool.surfels.hierarchy import SurfelHierarchy, monotone, own_error
from vegtool.surfels.options import SurfelOptions
from vegtool.surfels.validity import spread


def reduced(
    base: Base, one: SurfelHierarchy, ds_max: float = SurfelOptions().ds_max
) -> SurfelHierarchy:
    """The hierarchy without what is of no use, so that a billboard's validity and its father's say
    what is drawn (select.py)."""
    left = similar_gone(base, coarser_kept(base, one), ds_max)
    return monotone(base, left, 1 / spread(left.theta))


def coarser_kept(base: Base, one: SurfelHierarchy) -> SurfelHierarchy:
    """Without billboards that are no coarser than triangles which they stand for.

    Both are seen from spheres of which the billboard's contains the triangles', so that z_min (eq.
    8, 16) is compared by error alone: for any epsilon and view.
    """
    needed = np.zeros(len(one))
    patch, over = one.pairs()
    np.maximum.at(needed, over, base.error[patch])
    keep = own_error(one.boxes, one.theta, one.least) > needed
    if len(one):
        keep |= (one.father < 0) & (needed < np.inf)
    return kept(base, one, keep)


def similar_gone(base: Base, one: SurfelHierarchy, ds_max: float) -> SurfelHierarchy:
    """Without billboards whose ds (eq. 17) is less than ds_max, and those whose father's z_min is
    not so much greater that they are valid there from everywhere. What has no father stays. Patches
    below count with the z_min of their triangles.
    """
    growth = 1 / spread(one.theta)
    father = one.father.tolist()
    below: list[set[int]] = [set() for _ in father]
    for child, above in enumerate(father):
        if above >= 0:
            below[above].add(child)
    has = one.above >= 0
    lows: list[list[float]] = [[] for _ in father]
    for at, error in zip(one.above[has].tolist(), base.error[has].tolist(), strict=True):
        lows[at].append(error)
    keep = np.ones(len(one), dtype=bool)
    for number in np.argsort(one.error, kind="stable").tolist():
        above = father[number]
        if above < 0:
            continue
        errors = np.array([one.error[child] for child in below[number]] + lows[number])
        coarser = float(one.error[above])
        if coarser >= growth * one.error[number] and similarity(coarser, errors) >= ds_max:
            continue
        keep[number] = False
        below[above].discard(number)
        below[above] |= below[number]
        lows[above] += lows[number]
        for child in below[number]:
            father[child] = above
    return kept(base, one, keep)


def similarity(father: float, children: FloatArray) -> float:
    """ds (eq. 17) of what has so large a father and children; infinite over what has no error."""
    with np.errstate(divide="ignore"):
        return float(father * (1 / children).mean())


def kept(base: Base, one: SurfelHierarchy, keep: np.ndarray) -> SurfelHierarchy:
    """Some of the billboards, (b,) bool; the others' children are their fathers'."""
    number = np.cumsum(keep).astype(np.int32) - 1
    lowest = np.full(len(one) + 1, -1, dtype=np.int32)  # the last for what has no father
    for at in range(len(one) - 1, -1, -1):
        lowest[at] = number[at] if keep[at] else lowest[one.father[at]]
    boxes = one.boxes
    some = SurfelBoxes(boxes.center[keep], boxes.axes[keep], boxes.half[keep])
    left = SurfelHierarchy(
        some,
        lowest[one.father[keep]],
        own_error(some, one.theta, one.least),
        some.center,
        np.linalg.norm(some.half, axis=1),
        lowest[one.above],
        one.theta,
        one.least,
    )
    return monotone(base, left)
