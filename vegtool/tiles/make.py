"""One tile: the bytes of its file, from the plants on its square or from its quarters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.formats.gltf_tile import (
    GroupPlants,
    Instances,
    far_glb,
    instanced_glb,
    merged_glb,
)
from vegtool.formats.plant_table import PlantTable
from vegtool.plant import Plant
from vegtool.tiles.levels import COARSEST, fitting
from vegtool.tiles.merge import merged, vertex_plants
from vegtool.tiles.pyramid import Pyramid
from vegtool.tiles.quadtree import Node
from vegtool.tiles.shared import Shared
from vegtool.tiles.stand import Stand
from vegtool.timing import timed

SEEN_FROM = 0.25
"""Of its side, how much nearer a square's edge is than its middle, where it is looked at."""


@dataclass(frozen=True, eq=False)
class Tile:
    """data: of its .glb file. plants: on the square. triangles, draws: what a client draws. kind:
    how it was made. error_m: how far from its place anything is drawn, for 95 % of it; None where
    that was not measured. bounds: (2, 3) metres in the scene's frame, where what is drawn may reach
    beyond the plants. surfels: points that it is drawn as. full: triangles of the plants that these
    stand for, in full. seconds: by step."""

    node: Node
    data: bytes
    kind: str
    plants: int
    triangles: int
    draws: int
    error_m: float | None = None
    bounds: FloatArray | None = None
    surfels: int = 0
    full: int = 0
    seconds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Chosen:
    """(n,) int32 the level of each plant on a square, and how many times farther away than it is a
    plant is as whose it is drawn."""

    level: IntArray
    times: float

    @property
    def too_coarse(self) -> bool:
        """Whether too little is left of each plant."""
        return self.times > COARSEST


def chosen(pyramid: Pyramid, shared: Shared, node: Node, stand: Stand) -> Chosen:
    """What the plants on a square are drawn as: one plant at least."""
    height = pyramid.tree.height(node.level)
    near = pyramid.instanced(height)
    most = pyramid.options.near_triangles if near else pyramid.budget(node)

    def at(times: float, of_level: FloatArray) -> Chosen:
        away = times * pyramid.made_for_m(height)
        level, more = fitting(stand, pyramid.switch_m, of_level, away, most, pyramid.finest(height))
        return Chosen(level, times * more)

    if near:
        return at(1.0, pyramid.of_level)
    if height > pyramid.options.near:
        found = at(1.0, pyramid.of_level)
        if found.too_coarse:  # as most are: then nobody needs a sheet
            return found
    return at(shared.crowded(height), shared.sheet(height).triangles)


def instanced_tile(
    pyramid: Pyramid, shared: Shared, node: Node, stand: Stand, level: IntArray
) -> Tile:
    """Plants as instances of the models of their levels."""
    seconds: dict[str, float] = {}
    with timed(seconds, "writing"):
        pair, which = np.unique(
            np.stack([stand.species, level], axis=1), axis=0, return_inverse=True
        )
        origin = pyramid.origin(node)
        table = table_of(pyramid, stand)
        drawn = []
        for index, (kind, number) in enumerate(pair.tolist()):
            here = np.flatnonzero(which.ravel() == index)
            drawn.append(
                Instances(
                    shared.model(kind, number),
                    stand.foot[here] - origin,
                    stand.yaw[here],
                    stand.scale[here],
                    stand.tint[here],
                    None if table is None else table.only(here),
                )
            )
        data = instanced_glb(drawn, str(node))
    triangles = int(pyramid.of_level[stand.species, level].sum())
    error = error_of(pyramid, stand, level)
    draws = sum(len(one.model.objects["meshes"][0]["primitives"]) for one in drawn)
    return Tile(node, data, "instances", len(stand), triangles, draws, error, seconds=seconds)


def merged_tile(
    pyramid: Pyramid, shared: Shared, node: Node, stand: Stand, level: IntArray
) -> Tile:
    """Plants as one mesh with one material."""
    sheet = shared.sheet(pyramid.tree.height(node.level))
    seconds: dict[str, float] = {}
    with timed(seconds, "merging"):
        part = sheet.part[stand.species, level]
        group = merged(stand, part, sheet.sheet.parts, pyramid.origin(node))
        table = table_of(pyramid, stand)
        plants = None
        if table is not None:
            plants = GroupPlants(table, vertex_plants(part, sheet.sheet.parts))
    with timed(seconds, "writing"):
        files = sheet.files_for(part)
        data = merged_glb(group, files, str(node), pyramid.options.plain, plants)
    error = error_of(pyramid, stand, level)
    triangles = len(group.indices) // 3
    return Tile(node, data, "merged", len(stand), triangles, 1, error, seconds=seconds)


def table_of(pyramid: Pyramid, stand: Stand) -> PlantTable | None:
    """What is told of plants, where that is asked for."""
    if not pyramid.options.attributes:
        return None
    own = np.array([one.height for one in pyramid.species])
    height = (stand.scale * own[stand.species]).astype(np.float32)
    names = tuple(one.name for one in pyramid.species)
    return PlantTable(stand.row, stand.species, height, names)


def error_of(pyramid: Pyramid, stand: Stand, level: IntArray) -> float | None:
    """Metres: the largest error of a plant as its level draws it; None where none is known."""
    error = pyramid.level_error_m[stand.species, level] * stand.scale
    return None if np.isnan(error).all() else float(np.nanmax(error))


def reclustered_tile(
    pyramid: Pyramid,
    node: Node,
    quarters: Sequence[tuple[Node, Plant]],
    plants: int,
    below_m: float = 0.0,
) -> Tile:
    """What stands for the quarters, given as a client loads them, on which are so many plants.
    below_m: how far these are off already.

    Raises CapabilityError where nothing can draw.
    """
    from vegtool.measure.pictures import client_plant
    from vegtool.tiles.recluster import drawing, group_of, reclustered

    tree, options = pyramid.tree, pyramid.options
    origin = pyramid.origin(node)
    places = [pyramid.origin(one) - origin for one, _ in quarters]
    group = group_of([plant for _, plant in quarters], places, str(node))
    away = pyramid.from_m(tree.height(node.level)) + SEEN_FROM * tree.side(node.level)
    level = reclustered(group, pyramid.budget(node), away, pyramid.display, options.max_texture)
    seconds = dict(level.seconds)
    with timed(seconds, "writing"):
        data = far_glb(*drawing(level), str(node), level.unlit, options.plain)
    error = below_m + (0.0 if level.geometric_error_m is None else level.geometric_error_m[1])
    return Tile(
        node, data, "reclustered", plants, level.triangles, 1, error,
        client_plant(level).bounds + origin, seconds=seconds,
    )  # fmt: skip
