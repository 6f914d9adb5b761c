"""The whole pipeline: a plant elsewhere, of another size or turned has the same levels."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.convert import ConvertOptions, convert
from vegtool.errors import UsageError
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Plant
from vegtool.stability.case import Case, Outcome, holds, same_objective
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import MOTIONS, Motion, soup, tree

OPTIONS = ConvertOptions(billboards=48, levels=2)


def levels_of(plant: Plant) -> LodChain:
    """The chain with distances by rule."""
    return convert(plant, OPTIONS, MeasureOptions(measure="off"))


def objectives(chain: LodChain, scale: float) -> FloatArray:
    """(levels, 6): triangles, both errors, area of the billboards; area covered, texels. For scale
    1."""
    rows = []
    for level in chain.levels[1:]:
        assert level.billboards and level.atlas and level.geometric_error_m
        alpha = level.atlas.color[..., 3] / 255
        share = [alpha[y : y + h, x : x + w].mean() for x, y, w, h in level.atlas.front.tolist()]
        area = 4 * level.billboards.half_size.prod(axis=1) / scale**2
        greatest, usual = level.geometric_error_m
        rows.append(
            [
                *(level.triangles, greatest / scale, usual / scale, area.sum()),
                *(area @ np.array(share), level.atlas.texels),
            ]
        )
    return np.array(rows)


@cache
def objectives_of_tree(motion: Motion | None) -> FloatArray:
    """The objectives of the tree, moved, or where it stands."""
    if motion is None:
        return objectives(levels_of(tree()), 1.0)
    return objectives(levels_of(motion.plant(tree())), motion.scale)


def geometry_stays(motion: Motion) -> Outcome:
    """All levels have the same triangles, errors and areas."""
    here, there = (objectives_of_tree(m)[:, :4] for m in (None, motion))
    size = 2 * tree().radius / OPTIONS.billboards ** (1 / 3)
    error = float(np.abs(there / here - 1).max())
    return same_objective(error, motion.offset_over(size), note=f"{len(here)} levels")


def coverage_stays(motion: Motion) -> Outcome:
    """All levels cover as much, on as many texels."""
    here, there = (objectives_of_tree(m)[:, 4:] for m in (None, motion))
    return same_objective(float(np.abs(there / here - 1).max()))


@cache
def own_distances() -> tuple[float, ...]:
    """From where the tree's levels may be used, measured where it stands."""
    chain = convert(tree(), OPTIONS, MeasureOptions(measure="quick"))
    return tuple(level.near_distance_m for level in chain.levels[1:])


def distances_stay(motion: Motion) -> Outcome:
    """Distances that were measured scale with the plant."""
    chain = convert(motion.plant(tree()), OPTIONS, MeasureOptions(measure="quick"))
    there = [level.near_distance_m / motion.scale for level in chain.levels[1:]]
    right = own_distances()
    apart = [abs(a / b - 1) for a, b in zip(there, right, strict=True)]
    note = ", ".join(f"{d:g} m" for d in right)
    return same_objective(max(apart), note=note)


def without_extent() -> Outcome:
    """A plant that is a point is seen from no distance: a sentence says so."""
    try:
        levels_of(soup(DEGENERATE["all points equal"][0]()))
    except UsageError as error:
        return holds("extent" not in str(error), "is refused in a sentence")
    return holds(1, "is refused in a sentence")


def always_some(made: Callable[[], FloatArray]) -> Outcome:
    """Levels of anything with an extent: fewer triangles in each, the same bytes twice."""
    one, two = (levels_of(soup(made())) for _ in range(2))
    wrong = int(len(one.levels) < 2)
    for a, b in zip(one.levels[1:], two.levels[1:], strict=True):
        assert a.atlas and b.atlas
        wrong += not np.array_equal(a.atlas.color, b.atlas.color)
    triangles = ", ".join(f"{level.triangles:,}" for level in one.levels)
    return holds(wrong, "levels, twice the same", note=f"{triangles} triangles")


CASES = (
    *(
        Case(f"convert: a tree, {motion.name}", "convert", "equivariance",
             partial(geometry_stays, motion), gl=True)
        for motion in MOTIONS
    ),
    *(
        Case(f"convert: coverage of a tree, {motion.name}", "convert", "equivariance",
             partial(coverage_stays, motion), gl=True)
        for motion in MOTIONS
        if not motion.turns  # its pictures would be sampled elsewhere
    ),
    *(
        Case(f"convert: {name}", "convert", "property", partial(always_some, made), gl=True)
        for name, (made, _) in DEGENERATE.items()
        if name != "all points equal"
    ),
    *(
        Case(f"convert: distances, {motion.name}", "convert", "equivariance",
             partial(distances_stay, motion), gl=True)
        for motion in MOTIONS
        if not motion.turns  # other views would be measured
    ),
    Case("convert: all points equal", "convert", "property", without_extent, gl=True),
)  # fmt: skip
