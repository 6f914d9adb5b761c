"""The pyramid of a landscape: squares of ground, each of four of half its side, down to tiles.

Levels are counted from the root, as clients do; heights from the tiles of the placement, whose
height is 0. A node is there where there are plants on it. The tiles on a square are neighbours in
the order of G. M. Morton, "A computer oriented geodetic data base" (1966), in which the bits of
column and row take turns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.tiles.placement import LongArray, Tiles

SPREAD = (
    (16, 0x0000FFFF0000FFFF),
    (8, 0x00FF00FF00FF00FF),
    (4, 0x0F0F0F0F0F0F0F0F),
    (2, 0x3333333333333333),
    (1, 0x5555555555555555),
)
"""Steps that put a zero between any two of 31 bits: how far to shift, and what then stays."""


@dataclass(frozen=True, order=True)
class Node:
    """A square: level from the root, 0, on; column along x and row along z in that level."""

    level: int
    column: int
    row: int

    def __str__(self) -> str:
        return f"{self.level}/{self.column}/{self.row}"

    @property
    def parent(self) -> Node:
        """The square that this one is a quarter of."""
        return Node(self.level - 1, self.column >> 1, self.row >> 1)


@dataclass(frozen=True, eq=False)
class Quadtree:
    """The squares over the tiles of a placement.

    side_m: metres, of a tile. depth: levels below the root, that of the tiles. first: (2,) column
    and row, in the placement's own count, of the first tile. cell: (t, 2) int64 column and row of
    each tile from there on.
    """

    side_m: float
    depth: int
    first: LongArray
    cell: LongArray

    def side(self, level: int) -> float:
        """Metres, of the squares of a level."""
        return self.side_m * 2.0 ** self.height(level)

    def height(self, level: int) -> int:
        """How many levels there are below."""
        return self.depth - level

    @cached_property
    def _sorted(self) -> tuple[LongArray, LongArray]:
        """(t,) codes, ascending, and the tiles that they are of."""
        codes = _codes(self.cell)
        order = np.argsort(codes, kind="stable")
        return codes[order], order

    def nodes(self, level: int) -> list[Node]:
        """All squares of a level on which there are plants, row by row."""
        found = np.unique((self.cell >> self.height(level))[:, ::-1], axis=0)
        return [Node(level, int(column), int(row)) for row, column in found]

    def count(self, level: int) -> int:
        """How many squares of a level there are."""
        codes = self._sorted[0] >> (2 * self.height(level))
        return 1 + int(np.count_nonzero(np.diff(codes)))

    def tiles_of(self, node: Node) -> LongArray:
        """(n,) the placement's tiles on a square, ascending; none where it is not there."""
        codes, tiles = self._sorted
        bits = 2 * self.height(node.level)
        first = int(_codes(np.array([[node.column, node.row]]))[0]) << bits
        start, end = np.searchsorted(codes, [first, first + (1 << bits)])
        return np.sort(tiles[start:end])

    def quarters(self, node: Node) -> tuple[Node, ...]:
        """Those on which there are plants, row by row; none of a tile."""
        if node.level == self.depth:
            return ()
        level, column, row = node.level + 1, 2 * node.column, 2 * node.row
        four = [Node(level, column + x, row + z) for z in (0, 1) for x in (0, 1)]
        return tuple(one for one in four if len(self.tiles_of(one)))

    def middle(self, node: Node) -> FloatArray:
        """(2,) metres along x and z in the scene's frame."""
        corner = np.array([node.column, node.row]) * self.side(node.level)
        return np.asarray(corner + self.side(node.level) / 2 + self.first * self.side_m)


def nodes_of(tree: Quadtree, node: Node) -> list[Node]:
    """A square and all on it, the smallest first."""
    levels = [[node]]
    while levels[-1][0].level < tree.depth:
        levels.append([one for above in levels[-1] for one in tree.quarters(above)])
    return [one for level in reversed(levels) for one in level]


def quadtree_of(tiles: Tiles, side_m: float, above: int = 0) -> Quadtree:
    """The least pyramid over tiles of that side, of which there is one at least; and so many levels
    above it."""
    cell = tiles.cell
    if cell is None:
        middle = (tiles.low + tiles.high)[:, [0, 2]] / 2
        cell = np.floor(middle / side_m).astype(np.int64)
    first = cell.min(axis=0)
    size = int((cell.max(axis=0) - first).max()) + 1
    return Quadtree(side_m, max(size - 1, 0).bit_length() + above, first, cell - first)


def _codes(cell: LongArray) -> LongArray:
    """(n,) Morton codes of columns and rows (n, 2) below 2^31."""
    bits = np.array(cell, np.int64)
    for shift, kept in SPREAD:
        bits = (bits | (bits << shift)) & kept
    return np.asarray(bits[:, 0] | (bits[:, 1] << 1))
