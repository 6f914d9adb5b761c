"""A model of surfel billboards as what the GPU is given of it.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.5. Billboards and nodes become steps from fine to coarse, of which one is taken wherever one above
it is. That must hold in single precision too, or patches would be lost or doubled: errors and
spheres are made to grow by SLACK on the way up, which is more than a shader rounds.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, IntArray, SingleArray
from vegtool.baking.dilate import nearest_covered
from vegtool.gl.surfel_data import (
    ALIKE,
    BILLBOARD_FLOATS,
    DIFFERENT,
    ONE_SIDED,
    SurfelData,
    SurfelItems,
    SurfelPatches,
)
from vegtool.surfels.bake import GUTTER
from vegtool.surfels.margin import billboards_of
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.validity import spread

SLACK = 2.0**-19
"""Of errors and radii: 32 roundings of single precision, where a shader makes a dozen."""
ALWAYS = -1.0
"""Radius of what has no error, so that no eye is within."""


def drawn_data(model: SurfelModel) -> SurfelData:
    """All that frames are drawn from."""
    mt, one = model.triangles, model.hierarchy
    count, nodes = len(one), len(mt.error)
    steps = _steps(model)
    until = np.append(steps[:count, 7] / spread(one.theta), np.inf)  # the last: under nothing
    order = np.argsort(-until[one.father], kind="stable").astype(np.int32)
    row = np.append(np.empty(count, np.int32), np.int32(-1))
    row[order] = np.arange(count, dtype=np.int32)
    steps[:count] = steps[order]

    billboards = SurfelItems(
        np.arange(count, dtype=np.int32), row[one.father[order]], until[one.father[order]], order
    )
    source = mt.start == nodes - 1
    above, until_arc = mt.start + count, steps[mt.start + count, 7]
    above[source], until_arc[source] = row[one.above], until[one.above]
    patches = tuple(
        _patches(model, int(kind), (mt.end + count).astype(np.int32), above, until_arc)
        for kind in np.unique(mt.material)
    )
    center, radius = _whole(steps, count)
    beside = np.linalg.norm(steps[:count, :3] - center, axis=1) - steps[:count, 3]
    reach = float(steps[:count, 7].min(initial=np.inf)), -float(beside.max(initial=0.0))
    return SurfelData(
        mt.plant, steps.astype(np.float32), billboards, _quads(model, billboards),
        model.textures.atlas.color, _surface(model), patches, center, radius, reach,
    )  # fmt: skip


def _unit(model: SurfelModel) -> float:
    return float(model.plant.radius or 1.0)


def _steps(model: SurfelModel) -> FloatArray:
    """(b + n, 8) billboards, then nodes, as in SurfelData."""
    mt, one, scale = model.triangles, model.hierarchy, _unit(model)
    count = len(one)
    steps = np.zeros((count + len(mt.error), 8))
    center = np.concatenate([one.center, mt.center])
    steps[:, :3] = ((center - model.plant.center) / scale).astype(np.float32)
    steps[:, 3] = np.concatenate([one.radius, mt.radius]) / scale
    steps[:count, 4:7] = one.boxes.normal * (one.boxes.half[:, 2, None] / scale)
    steps[:, 7] = np.concatenate([one.error, mt.error]) / scale
    steps[count:, 3][mt.error == 0] = ALWAYS

    source = mt.start == len(mt.error) - 1
    below = np.concatenate([mt.end[~source], mt.end[source]]) + count
    above = np.concatenate([mt.start[~source] + count, one.above])
    below = np.concatenate([below, np.arange(count)])  # of a hierarchy, fathers come after children
    above = np.concatenate([above, one.father])
    has = above >= 0
    _grown(steps, below[has], above[has], one.boxes.half[:, 2] / scale)
    return steps


def _grown(steps: FloatArray, below: IntArray, above: IntArray, depth: FloatArray) -> None:
    """Make each step above another one coarser by SLACK at least, in order."""
    center, radius, error = steps[:, :3], steps[:, 3].tolist(), steps[:, 7].tolist()
    deep = depth.tolist() + [0.0] * (len(steps) - len(depth))
    apart = np.linalg.norm(center[above] - center[below], axis=1).tolist()
    for low, high, away in zip(below.tolist(), above.tolist(), apart, strict=True):
        error[high] = max(error[high], (1 + SLACK) * max(error[low], deep[low]))
        if radius[low] != ALWAYS:
            radius[high] = max(radius[high], (1 + SLACK) * (away + radius[low]))
    steps[:, 3], steps[:, 7] = radius, error


def _patches(
    model: SurfelModel, material: int, below: IntArray, above: IntArray, until: FloatArray
) -> SurfelPatches:
    """Those of one material."""
    mt = model.triangles
    own = np.flatnonzero(mt.material == material)
    arcs = own[np.argsort(-until[own], kind="stable")].astype(np.int32)
    sizes = mt.sizes[arcs]
    first = np.append(0, np.cumsum(sizes)).astype(np.int32)
    rows = np.repeat(mt.first[arcs] - first[:-1], sizes) + np.arange(first[-1])
    items = SurfelItems(below[arcs], above[arcs].astype(np.int32), until[arcs], arcs)
    return SurfelPatches(material, items, first, mt.faces[rows])


def _whole(steps: FloatArray, count: int) -> tuple[FloatArray, float]:
    """A sphere round all."""
    taken = np.isfinite(steps[:, 7]) & (steps[:, 3] >= 0)
    center = np.zeros(3)
    if count:  # the widest, which is the root where there is one
        center = steps[int(steps[:count, 3].argmax()), :3].copy()
    away = np.linalg.norm(steps[taken, :3] - center, axis=1) + steps[taken, 3]
    return center, float(away.max(initial=0.0))


def _quads(model: SurfelModel, billboards: SurfelItems) -> SingleArray:
    one, textures, scale = model.hierarchy, model.textures, _unit(model)
    planes, atlas = billboards_of(one), textures.atlas
    own = (atlas.front != atlas.back).any(axis=1)
    quads = np.zeros((len(one), BILLBOARD_FLOATS))
    quads[:, 0:3] = (planes.center - model.plant.center) / scale
    quads[:, 3] = np.where(own, DIFFERENT, np.where(textures.behind, ALIKE, ONE_SIDED))
    quads[:, 4:7] = planes.u * planes.half_size[:, :1] / scale
    quads[:, 7] = planes.half_depth / scale
    quads[:, 8:11] = planes.v * planes.half_size[:, 1:] / scale
    quads[:, 11] = heights(one.father)
    quads[:, 12:15] = planes.normal
    quads[:, 16:20], quads[:, 20:24] = atlas.front, atlas.back
    quads = quads[billboards.number]
    quads[:, 15] = billboards.above
    return quads.astype(np.float32)


def heights(father: IntArray) -> IntArray:
    """(b,) int32: steps to the lowest billboard below each, at most; 0 of the lowest."""
    high = [0] * len(father)
    for child, above in enumerate(father.tolist()):
        if above >= 0:
            high[above] = max(high[above], high[child] + 1)
    return np.array(high, np.int32)


def _surface(model: SurfelModel) -> ByteArray:
    """(h, w, 4) normal and depth in eight bits, both carried on to where nothing is covered."""
    atlas = model.textures.atlas
    assert atlas.normal is not None
    rect = np.unique(np.concatenate([atlas.front, atlas.back]), axis=0)
    nearest = nearest_covered(atlas.color[..., 3] > 0, rect, GUTTER)
    depth = atlas.depth.astype(np.float64).reshape(-1)[nearest]
    signed = np.clip((depth - 32768) / 32767, -1, 1)
    bits = np.where(atlas.color.reshape(-1, 4)[nearest, 3] > 0, np.rint(128 + 127 * signed), 128)
    return np.dstack([atlas.normal, bits.astype(np.uint8)])
