"""Where a hybrid starts: a cloud of as many billboards as its aim allows."""

from __future__ import annotations

import numpy as np

from vegtool.baking.sides import compare_sides, opposite_needed, turned
from vegtool.gl.upload import PlantBuffers
from vegtool.hybrid.budget import least_fill
from vegtool.hybrid.cloud import Cloud, cloud_of
from vegtool.hybrid.cost import PER_BILLBOARD
from vegtool.hybrid.greedy import Descent
from vegtool.hybrid.options import Budget, Weights
from vegtool.meshes.pieces import all_welded
from vegtool.progress import Progress, silent
from vegtool.refine.level import Source

STARTS_WITH = 0.5
"""Of the triangles that a budget allows: billboards. What they leave is for the mesh."""
TRIES = 5
"""At a cloud that fills no more than is allowed."""
GROWTH = 0.6
"""Exponent with which fill grows with the number of billboards; 0.3 to 0.8 on three trees."""
CLOSE = 0.97
"""Of the fill that is allowed: what is aimed at."""
ENOUGH = 0.9
"""Of it: no nearer need it be."""


def begun(cloud: Cloud, weights: Weights, per_billboard: int = PER_BILLBOARD) -> Descent:
    """A hybrid that is all billboards, of so many triangles each."""
    plant = cloud.plant
    about = cloud.billboards()
    corners = (cloud.shown.corners - plant.center) / (plant.radius or 1.0)
    sides = [np.einsum("qci,qi->qc", corners, side[cloud.plane]) for side in (about.u, about.v)]
    ends = [end for side in sides for end in (side.min(axis=1), side.max(axis=1))]
    return Descent(cloud, all_welded(plant), np.stack(ends, axis=1), weights, per_billboard)


def started(
    source: Source, triangles: int, aim: Weights | Budget, progress: Progress = silent
) -> Descent:
    """Billboards of half of so many triangles, or all of them where weights are the aim; fewer
    where what must stay on them fills more than a budget allows."""
    plant = source.plant
    if isinstance(aim, Weights):
        cloud = cloud_of(plant, max(1, triangles // PER_BILLBOARD), progress)
        return begun(cloud, aim, per_billboard(source, cloud))
    count = max(1, int(STARTS_WITH * triangles / PER_BILLBOARD))
    cloud = cloud_of(plant, count, progress)
    each = per_billboard(source, cloud)
    if each > PER_BILLBOARD:
        count = max(1, count * PER_BILLBOARD // each)
        cloud = cloud_of(plant, count, progress)
    start = begun(cloud, Weights(), each)
    return start if aim.fill is None else filling(start, count, aim.fill, progress)


def filling(start: Descent, count: int, fill: float, progress: Progress = silent) -> Descent:
    """A start like this, of `count` billboards, but of fewer where these fill too much: found as if
    fill were a power of their number."""
    filled, least = least_fill(start), start
    if filled <= fill:
        return start
    low, high, growth, best = 0, count, GROWTH, None
    for _ in range(TRIES):
        guess = int(count * (CLOSE * fill / filled) ** (1 / growth))
        if high - low < 2:
            break
        guess = min(max(guess, low + 1), high - 1)
        now = begun(cloud_of(start.cloud.plant, guess, progress), Weights(), start.per_billboard)
        before, filled_before = count, filled
        count, filled = guess, least_fill(now)
        least = min(least, now, key=least_fill)
        if filled <= fill:
            low, best = guess, now
            if filled >= ENOUGH * fill:
                break
        else:
            high = guess
        if filled > 0 and filled != filled_before:
            slope = np.log(filled_before / filled) / np.log(before / count)
            growth = float(np.clip(slope, 0.2, 2.0))
    return least if best is None else best


def per_billboard(source: Source, cloud: Cloud) -> int:
    """Triangles of a billboard: it stands in the file twice where its sides differ."""
    pair = np.arange(len(cloud.face), dtype=np.int32)
    with PlantBuffers(cloud.shown) as buffers:
        sides = compare_sides(buffers, cloud.billboards(), pair, cloud.plane, source.lit)
    billboards, sides = turned(cloud.billboards(), sides)
    return PER_BILLBOARD * (2 if opposite_needed(billboards, sides) else 1)
