"""Squares as progressive blue surfels: the lowest of the plants on them, others of their quarters.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 3.4: bottom-up, from children's surfels in place of
geometry, so that no more than a square and its quarters is in memory.

A client that goes on from a square to its quarters shows their plants whole, as instances, while
squares beside it stay as they are. So surfels are on the square that their plant stands on: else
crowns over a border would be cut off. Plants that are LONG beside the square would make all of it
as near as their nearest end is; they are split, and each surfel is on the square that it lies on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.formats.gltf_tile import surfels_glb
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.group import Discs, discs_of, grouped, together
from vegtool.tiles.make import Tile
from vegtool.tiles.placement import LongArray
from vegtool.tiles.pyramid import Pyramid
from vegtool.tiles.quadtree import Node
from vegtool.tiles.shared import Shared
from vegtool.tiles.stand import Stand, stand_on
from vegtool.timing import timed

LONG = 0.5
"""Of a square's side: plants that reach so far to a side of their foot are split."""
CANDIDATES = 5
"""For each surfel of a square, of its plants, at most: what is seen of them, mostly a third, is
still more than there are surfels."""
LEAST = 1e-9
"""Scale of a plant: none counts as less."""

Bools = npt.NDArray[np.bool_]


def standing(pyramid: Pyramid, node: Node, stand: Stand) -> tuple[Stand, LongArray]:
    """The plants that surfels of a square may be of: those on it, then long ones beside it; and
    (n, 2) columns and rows, from the square's on, of those beside it that these may lie on."""
    long, none = _long(pyramid, node), np.zeros((0, 2), np.int64)
    if not long.any():
        return stand, none
    tiles, tree = pyramid.placement.tiles, pyramid.tree
    reach = float(pyramid.reach_m[long].max())
    half, middle = tree.side(node.level) / 2, tree.middle(node)
    low, high = tiles.low[:, [0, 2]], tiles.high[:, [0, 2]]
    within = (low <= middle + half + reach) & (high >= middle - half - reach)
    near: np.ndarray = np.asarray(within.all(axis=1))
    near[tree.tiles_of(node)] = False
    if not near.any():
        return stand, none
    cells = tree.cell[near] >> tree.height(node.level)
    beside = stand_on(pyramid.placement, np.flatnonzero(near), pyramid.species)
    kept = long[beside.species]
    every = Stand(
        *(
            np.concatenate([getattr(stand, item.name), getattr(beside, item.name)[kept]])
            for item in fields(Stand)
        )
    )
    return every, np.unique(cells, axis=0) - [node.column, node.row]


def plants_tile(pyramid: Pyramid, shared: Shared, node: Node, stand: Stand, own: int) -> Tile:
    """A square of the plants of `standing`, of which the first `own` stand on it.

    Raises CapabilityError where nothing can draw.
    """
    seconds: dict[str, float] = {}
    on_it, long = stand.species[:own], _long(pyramid, node)
    full = int(pyramid.of_level[on_it, 0].sum())
    count = pyramid.surfels_for(full)
    with timed(seconds, "surfels"):
        kinds = np.unique(stand.species)
        sets = [shared.sample(int(kind)) for kind in kinds]
        wanted = CANDIDATES * count
        scales = [stand.scale[stand.species == kind] for kind in kinds]
        metres = _spaced(sets, scales, wanted)
        parts, whole = list[Discs](), list[Discs]()
        for kind, surfels in zip(kinds, sets, strict=True):
            which = np.flatnonzero(stand.species == kind)
            every, plant = _placed(stand, which, surfels, metres, pyramid.origin(node))
            if long[kind]:
                here = which[plant] < own
                whole.append(every.of(here))
                place = every.position + pyramid.origin(node)
                every = every.of(_lies_on(pyramid, node, place, here))
            parts.append(every)
        if not any(map(len, parts)):  # all that stands here lies elsewhere
            parts = whole
        discs = together(parts)
    of = _Of(sets, own, full)
    return _tile(pyramid, node, discs, count, of, 0.0, seconds)


def quarters_tile(
    pyramid: Pyramid,
    node: Node,
    quarters: Sequence[tuple[Node, SurfelSet]],
    plants: int,
    full: int,
    below_m: float,
) -> Tile:
    """A square of its quarters' surfels, given as a client loads them. below_m: how far these are
    off already. One quarter alone is seen at half the size: a quarter of its surfels are enough.

    Raises CapabilityError where nothing can draw.
    """
    seconds: dict[str, float] = {}
    count = pyramid.surfels_for(full, len(quarters[0][1]) if len(quarters) == 1 else None)
    with timed(seconds, "surfels"):
        away = [pyramid.origin(one) - pyramid.origin(node) for one, _ in quarters]
        sets = [one.moved(shift) for (_, one), shift in zip(quarters, away, strict=True)]
        discs = together([discs_of(one) for one in sets])
    of = _Of(sets, plants, full)
    return _tile(pyramid, node, discs, count, of, below_m, seconds)


@dataclass(frozen=True, eq=False)
class _Of:
    """What a square is made of: sets, plants, and their triangles in full."""

    sets: Sequence[SurfelSet]
    plants: int
    full: int


def _tile(
    pyramid: Pyramid, node: Node, discs: Discs, count: int, of: _Of, below_m: float,
    seconds: dict[str, float],
) -> Tile:  # fmt: skip
    with timed(seconds, "order"):
        unlit = all(one.unlit for one in of.sets)
        double_sided = any(one.double_sided for one in of.sets)
        made = grouped(discs, count, unlit=unlit, double_sided=double_sided)
    surfels = made.surfels
    with timed(seconds, "writing"):
        data = surfels_glb(surfels, str(node), pyramid.options.plain)
    return Tile(
        node, data, "surfels", of.plants, 0, 1, below_m + made.error_m,
        surfels.bounds + pyramid.origin(node), len(surfels), of.full, seconds,
    )  # fmt: skip


def _spaced(sets: Sequence[SurfelSet], scale: Sequence[FloatArray], wanted: int) -> float:
    """Metres: the radius of discs of which plants of these scales together need as many as are
    wanted; p(r) of section 4.1, and each no more than it has."""
    both = zip(sets, scale, strict=True)
    at_one = [one.spacing.length * one.spacing.radius_m**2 * s**2 for one, s in both]
    return float((sum(float(one.sum()) for one in at_one) / wanted) ** 0.5)


def _placed(
    stand: Stand, which: npt.NDArray[np.integer], surfels: SurfelSet, metres: float,
    origin: FloatArray,
) -> tuple[Discs, IntArray]:  # fmt: skip
    """Discs, relative to an origin, of the plants `which`, all of one species; and (n,) of which of
    those each is."""
    scale = stand.scale[which]
    prefix, radius = surfels.discs(metres / np.maximum(scale, LEAST))
    of = np.repeat(np.arange(len(which), dtype=np.int32), prefix)
    row = np.arange(len(of)) - (np.cumsum(prefix) - prefix)[of]
    cos, sin = np.cos(stand.yaw[which])[of], np.sin(stand.yaw[which])[of]

    def turned(vectors: FloatArray) -> FloatArray:
        x, y, z = vectors[row].T
        return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=1)

    discs = Discs(
        scale[of, None] * turned(surfels.position) + (stand.foot[which] - origin)[of],
        turned(surfels.normal),
        surfels.color[row] * stand.tint[which][of],
        (scale * radius)[of] * surfels.size[row],
        surfels.size[row],
        None if surfels.light is None else surfels.light[row],
        surfels.transmission_tint,
    )
    return discs, of


def _long(pyramid: Pyramid, node: Node) -> Bools:
    """(s,) species whose plants are split."""
    return np.asarray(pyramid.reach_m > LONG * pyramid.tree.side(node.level))


def _lies_on(pyramid: Pyramid, node: Node, position: FloatArray, own: Bools) -> Bools:
    """(n,) places (n, 3), metres in the scene's frame, that are on a square; or on none where a
    plant stands, and of a plant that stands on this one."""
    tree = pyramid.tree
    side = tree.side(node.level)
    cell = np.floor(position[:, [0, 2]] / side - tree.first * tree.side_m / side).astype(np.int64)
    cells, which = np.unique(cell, axis=0, return_inverse=True)
    there = np.zeros(len(cells), np.bool_)
    for index, (column, row) in enumerate(cells.tolist()):
        inside = min(column, row) >= 0 and max(column, row) < 2**node.level
        there[index] = inside and len(tree.tiles_of(Node(node.level, column, row))) > 0
    here = (cells == [node.column, node.row]).all(axis=1)
    which = which.ravel()
    return np.asarray(here[which] | (own & ~there[which]))
