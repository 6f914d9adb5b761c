"""One tile: the bytes of its file, from the plants on its square or from its quarters' files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.gltf_tile import Instances, far_glb, instanced_glb, merged_glb
from vegtool.plant import Plant
from vegtool.tiles.levels import fitting, level_at
from vegtool.tiles.merge import merged
from vegtool.tiles.pyramid import FINEST, Pyramid
from vegtool.tiles.quadtree import Node
from vegtool.tiles.shared import Shared
from vegtool.timing import timed

COARSEST = 2.0
"""Where plants would have to be drawn as if they were so many times farther away than they are,
their quarters' billboards are clustered anew."""
SEEN_FROM = 0.25
"""Of its side, how much nearer a square's edge is than its middle, where it is looked at."""


@dataclass(frozen=True, eq=False)
class Tile:
    """data: of its .glb file. plants: on the square. triangles, draws: what a client draws. kind:
    how it was made. error_m: how far from its place anything is drawn, for 95 % of it; None where
    that was not measured. bounds: (2, 3) metres in the scene's frame, where what is drawn may reach
    beyond the plants."""

    node: Node
    data: bytes
    kind: str
    plants: int
    triangles: int
    draws: int
    error_m: float | None = None
    bounds: FloatArray | None = None
    seconds: dict[str, float] = field(default_factory=dict)


def make_tile(
    pyramid: Pyramid, node: Node, shared: Shared, quarter: Callable[[Node], Plant | None]
) -> Tile | None:
    """Make a tile; None where no plants turn out to stand on it. quarter: the plant that a tile
    made before is, as a client loads it."""
    height = pyramid.tree.height(node.level)
    if pyramid.instanced(height):
        return _instanced(pyramid, node, shared)
    sheet = shared.sheets[height]
    seconds: dict[str, float] = {}
    with timed(seconds, "placement"):
        stand = pyramid.stand(node)
        if not len(stand):
            return None
        level, times = fitting(
            stand, pyramid.switch_m, sheet.triangles, pyramid.made_for_m(height),
            pyramid.options.triangles, FINEST,
        )  # fmt: skip
    if times > COARSEST and not pyramid.instanced(height - 1):
        return _reclustered(pyramid, node, len(stand), quarter)
    with timed(seconds, "merging"):
        part = sheet.part[stand.species, level]
        group = merged(stand, part, sheet.sheet.parts, pyramid.origin(node))
    with timed(seconds, "writing"):
        data = merged_glb(group, sheet.files, str(node), pyramid.options.plain)
    return Tile(node, data, "merged", len(stand), len(group.indices) // 3, 1, seconds=seconds)


def _instanced(pyramid: Pyramid, node: Node, shared: Shared) -> Tile | None:
    stand = pyramid.stand(node)
    if not len(stand):
        return None
    height = pyramid.tree.height(node.level)
    level = level_at(stand, pyramid.switch_m, pyramid.made_for_m(height), FINEST)
    pair, which = np.unique(np.stack([stand.species, level], axis=1), axis=0, return_inverse=True)
    origin = pyramid.origin(node)
    drawn = []
    for index, (kind, number) in enumerate(pair.tolist()):
        here = np.flatnonzero(which.ravel() == index)
        drawn.append(
            Instances(
                shared.models[kind, number],
                stand.foot[here] - origin,
                stand.yaw[here],
                stand.scale[here],
                stand.tint[here],
            )
        )
    triangles = int(pyramid.of_level[stand.species, level].sum())
    draws = sum(len(one.model.objects["meshes"][0]["primitives"]) for one in drawn)
    return Tile(
        node, instanced_glb(drawn, str(node)), "instances", len(stand), triangles, draws, 0.0
    )


def _reclustered(
    pyramid: Pyramid, node: Node, plants: int, quarter: Callable[[Node], Plant | None]
) -> Tile:
    from vegtool.measure.pictures import client_plant
    from vegtool.tiles.recluster import drawing, group_of, reclustered

    tree, options = pyramid.tree, pyramid.options
    origin = pyramid.origin(node)
    seconds: dict[str, float] = {}
    with timed(seconds, "quarters"):
        read = {one: quarter(one) for one in tree.below[node]}
        there = {one: plant for one, plant in read.items() if plant is not None}
        places = [pyramid.origin(one) - origin for one in there]
        group = group_of(list(there.values()), places, str(node))
    away = pyramid.from_m(tree.height(node.level)) + SEEN_FROM * tree.side(node.level)
    level = reclustered(group, options.triangles, away, pyramid.display, options.max_texture)
    with timed(seconds, "writing"):
        data = far_glb(*drawing(level), str(node), level.unlit, options.plain)
    error = None if level.geometric_error_m is None else level.geometric_error_m[1]
    return Tile(
        node, data, "reclustered", plants, level.triangles, 1, error,
        client_plant(level).bounds + origin, {**seconds, **level.seconds},
    )  # fmt: skip
