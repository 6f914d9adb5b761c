"""The plants of one tile as they are drawn, in the order in which they vanish with distance.

Far away not every plant of a small kind is drawn: of each kind in a tile those that stay are spread
evenly and wider for those that are gone (Cook et al. 2007, as of elements of one plant in
elements.py). Each plant so has a distance beyond which it is not drawn. A tile's plants are sorted
by it, so that what a frame has to look at is the first part of each tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Plants

STOCK = np.dtype(
    [
        ("offset", "f4", 3), ("scale", "f4"), ("turn", "f4", 2), ("vanish", "f4"),
        ("species", "u4"), ("tint", "u1", 4),
    ]
)  # fmt: skip
"""offset: metres from the tile's origin to the foot. scale: of the model. turn: cosine and sine of
the turn about y. vanish: times the distance up to which all of its kind are drawn, that up to which
it is. tint: see gl.instances.INSTANCE."""


@dataclass(frozen=True, eq=False)
class Stock:
    """rows: (n,) STOCK, those first that vanish last. origin: (3,) metres. reach: (n,) float32
    metres, scale times vanish times `Kinds.thinned_m` of the kind, descending: see `stocked`."""

    origin: FloatArray
    rows: np.ndarray
    reach: np.ndarray


def stocked(plants: Plants, species: Sequence[Species], thinned_m: FloatArray) -> Stock:
    """A tile's plants as stock.

    thinned_m: (s,) metres, up to which all plants of a kind are drawn, of scale 1 and detail 1.
    """
    kind = plants.species
    count = len(kind)
    rows = np.zeros(count, STOCK)
    rows["offset"] = plants.offset
    own = np.array([one.height for one in species], np.float64)
    times = plants.height / np.maximum(own[kind], 1e-9)
    rows["scale"] = np.where(np.isfinite(plants.height), times, 1.0)
    rows["turn"] = np.stack([np.cos(plants.yaw), np.sin(plants.yaw)], axis=1)
    rows["species"] = kind
    rows["tint"] = 255
    rows["tint"][:, :3] = np.clip(np.rint(127.5 * plants.tint), 0, 255)
    rows["vanish"] = 1 / np.sqrt(_place_among_its_kind(kind))
    reach = rows["scale"] * rows["vanish"] * thinned_m[kind].astype(np.float32)
    order = np.argsort(-reach, kind="stable")
    return Stock(plants.origin, rows[order], reach[order])


def _place_among_its_kind(kind: np.ndarray) -> FloatArray:
    """(n,) above 0, up to 1: of those of a kind, in order, k / n for the k-th."""
    order = np.argsort(kind, kind="stable")
    counts = np.bincount(kind)
    first = np.cumsum(counts) - counts
    place = np.empty(len(kind))
    sorted_kind = kind[order]
    place[order] = (np.arange(len(kind)) - first[sorted_kind] + 1) / counts[sorted_kind]
    return place
