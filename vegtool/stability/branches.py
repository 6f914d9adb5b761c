"""Branches recovered from bare geometry: the same ones wherever the plant stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches import recover_branches
from vegtool.plant import Branches, Plant
from vegtool.stability.case import Case, Outcome, holds, same_objective
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import MOTIONS, Motion, soup, tree


@cache
def recovered() -> Branches:
    """What is recovered of the tree where it stands."""
    return recover_branches(tree())


def area_by_level(plant: Plant, branches: Branches) -> FloatArray:
    """Share of the area on branches of each level, and how many branches there are."""
    level = branches.level[branches.face_branch]
    shares = np.bincount(level, plant.face_areas, minlength=12) / plant.face_areas.sum()
    return np.append(shares, len(branches))


def motion_changes_nothing(motion: Motion) -> Outcome:
    """Branches of the tree elsewhere: as much area at every level, as many branches."""
    plant = tree()
    there = recover_branches(motion.plant(plant))
    here, found = (area_by_level(plant, b) for b in (recovered(), there))
    same = float((there.face_branch == recovered().face_branch).mean())
    return same_objective(
        float(np.abs(found - here).max()),
        motion.offset_over(plant.radius),
        note=f"{len(there)} branches, {same:.2%} of the faces on the same one",
    )


def always_some(made: Callable[[], FloatArray], role: str) -> Outcome:
    """A hierarchy for anything, the same one twice; the data class checks that it is one."""
    plant = soup(made())
    if role == "wood":
        plant = replace(plant, materials=(replace(plant.materials[0], role="wood"),))
    one, two = (recover_branches(plant) for _ in range(2))
    wrong = (not np.array_equal(one.face_branch, two.face_branch)) + (
        not np.array_equal(one.parent, two.parent)
    )
    return holds(wrong, "a hierarchy, twice the same", note=f"{len(one):,} branches")


CASES = (
    *(
        Case(f"recovered: a tree, {motion.name}", "branches", "equivariance",
             partial(motion_changes_nothing, motion))
        for motion in MOTIONS
    ),
    *(
        Case(f"recovered: {name}, {role}", "branches", "property", partial(always_some, made, role))
        for name, (made, _) in DEGENERATE.items()
        for role in ("leaf", "wood")
    ),
)  # fmt: skip
