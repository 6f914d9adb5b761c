"""The whole pipeline: a plant elsewhere, of another size or turned has the same levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.convert import ConvertOptions, convert
from vegtool.errors import UsageError
from vegtool.lod import Level, LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Plant
from vegtool.stability.case import Case, Outcome, holds, same_objective
from vegtool.stability.clustering import DEGENERATE
from vegtool.stability.plants import MOTIONS, Motion, soup, tree

PLAIN = ConvertOptions(billboards=48, levels=2, refine="none")
REFINED = replace(PLAIN, refine="full")
OFF = MeasureOptions(measure="off")


def levels_of(plant: Plant, options: ConvertOptions = PLAIN) -> LodChain:
    """The chain with distances by rule."""
    return convert(plant, options, OFF)


def objectives(chain: LodChain, scale: float) -> FloatArray:
    """(levels, 6): triangles, both errors, area of the surface; area covered, texels. For scale
    1."""
    rows = []
    for level in chain.levels[1:]:
        assert level.geometric_error_m
        greatest, usual = level.geometric_error_m
        solid = 0.0 if level.mesh is None else float(level.mesh.face_areas.sum()) / scale**2
        area, share = np.zeros(0), np.zeros(0)
        if level.billboards and level.atlas:
            alpha = level.atlas.color[..., 3] / 255
            share = np.array([alpha[y : y + h, x : x + w].mean() for x, y, w, h in
                              level.atlas.front.tolist()])  # fmt: skip
            area = 4 * level.billboards.half_size.prod(axis=1) / scale**2
        rows.append(
            [
                *(level.triangles, greatest / scale, usual / scale, area.sum() + solid),
                *(area @ share + solid, max(level.texels, 1)),
            ]
        )
    return np.array(rows)


@cache
def objectives_of_tree(options: ConvertOptions, motion: Motion | None) -> FloatArray:
    """The objectives of the tree, moved, or where it stands."""
    if motion is None:
        return objectives(levels_of(tree(), options), 1.0)
    return objectives(levels_of(motion.plant(tree()), options), motion.scale)


def geometry_stays(options: ConvertOptions, motion: Motion) -> Outcome:
    """All levels have the same triangles, errors and areas."""
    here, there = (objectives_of_tree(options, m)[:, :4] for m in (None, motion))
    size = 2 * tree().radius / options.billboards ** (1 / 3)
    error = float(np.abs(there / here - 1).max())
    return same_objective(error, motion.offset_over(size), note=f"{len(here)} levels")


def coverage_stays(options: ConvertOptions, motion: Motion) -> Outcome:
    """All levels cover as much, on as many texels."""
    here, there = (objectives_of_tree(options, m)[:, 4:] for m in (None, motion))
    return same_objective(float(np.abs(there / here - 1).max()))


@cache
def own_distances() -> tuple[float, ...]:
    """From where the tree's levels may be used, measured where it stands."""
    chain = convert(tree(), PLAIN, MeasureOptions(measure="quick"))
    return tuple(level.near_distance_m for level in chain.levels[1:])


def distances_stay(motion: Motion) -> Outcome:
    """Distances that were measured scale with the plant."""
    chain = convert(motion.plant(tree()), PLAIN, MeasureOptions(measure="quick"))
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


def always_some(options: ConvertOptions, made: Callable[[], FloatArray]) -> Outcome:
    """Levels of anything with an extent: fewer triangles in each, the same bytes twice."""
    one, two = (levels_of(soup(made()), options) for _ in range(2))
    wrong = int(len(one.levels) < 2)
    for a, b in zip(one.levels[1:], two.levels[1:], strict=True):
        wrong += not same(a, b)
    triangles = ", ".join(f"{level.triangles:,}" for level in one.levels)
    return holds(wrong, "levels, twice the same", note=f"{triangles} triangles")


def same(one: Level, two: Level) -> bool:
    """Whether they are alike to the last bit."""
    if one.kind != two.kind:
        return False
    pairs: list[tuple[npt.NDArray[Any], npt.NDArray[Any]]] = []
    if one.atlas and two.atlas and one.billboards and two.billboards:
        pairs += [(one.atlas.color, two.atlas.color), (one.atlas.depth, two.atlas.depth)]
        if one.atlas.normal is not None and two.atlas.normal is not None:
            pairs += [(one.atlas.normal, two.atlas.normal)]
        pairs += [(one.billboards.center, two.billboards.center)]
    if one.mesh and two.mesh:
        pairs += [(one.mesh.corners, two.mesh.corners)]
        if one.mesh.colors is not None and two.mesh.colors is not None:
            pairs += [(one.mesh.colors, two.mesh.colors)]
    return all(np.array_equal(a, b) for a, b in pairs)


CASES = (
    *(
        Case(f"convert: a tree, {motion.name}", "convert", "equivariance",
             partial(geometry_stays, PLAIN, motion), gl=True)
        for motion in MOTIONS
    ),
    *(
        Case(f"convert: a tree, refined, {motion.name}", "convert", "equivariance",
             partial(geometry_stays, REFINED, motion), gl=True)
        for motion in MOTIONS
        if not motion.turns  # another extent, other pixels
    ),
    *(
        Case(f"convert: coverage of a tree, {motion.name}", "convert", "equivariance",
             partial(coverage_stays, PLAIN, motion), gl=True)
        for motion in MOTIONS
        if not motion.turns  # its pictures would be sampled elsewhere
    ),
    *(
        Case(f"convert: {name}{said}", "convert", "property",
             partial(always_some, options, made), gl=True)
        for name, (made, _) in DEGENERATE.items()
        for options, said in ((PLAIN, ""), (REFINED, ", refined"))
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
