"""The pyramid of a landscape: squares of ground, each of four of half its side, down to tiles.

Levels are counted from the root, as clients do; heights from the tiles of the placement, whose
height is 0. A node is there where there are plants on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.tiles.placement import LongArray, Tiles


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
    def tile(self) -> dict[Node, int]:
        """The tiles of the placement, by their squares."""
        return {
            Node(self.depth, int(column), int(row)): index
            for index, (column, row) in enumerate(self.cell)
        }

    def nodes(self, level: int) -> list[Node]:
        """All squares of a level on which there are plants, row by row."""
        found = np.unique((self.cell >> self.height(level))[:, ::-1], axis=0)
        return [Node(level, int(column), int(row)) for row, column in found]

    @cached_property
    def below(self) -> dict[Node, tuple[Node, ...]]:
        """The quarters, with plants on them, of every square that is no tile."""
        found: dict[Node, list[Node]] = {}
        for level in range(1, self.depth + 1):
            for node in self.nodes(level):
                found.setdefault(node.parent, []).append(node)
        return {node: tuple(quarters) for node, quarters in found.items()}

    def tiles_of(self, node: Node) -> LongArray:
        """(n,) the placement's tiles on a square, ascending."""
        on = (self.cell >> self.height(node.level)) == (node.column, node.row)
        return np.flatnonzero(on.all(axis=1)).astype(np.int64)

    def middle(self, node: Node) -> FloatArray:
        """(2,) metres along x and z in the scene's frame."""
        corner = np.array([node.column, node.row]) * self.side(node.level)
        return np.asarray(corner + self.side(node.level) / 2 + self.first * self.side_m)


def quadtree_of(tiles: Tiles, side_m: float) -> Quadtree:
    """The least pyramid over tiles of that side, of which there is one at least."""
    cell = tiles.cell
    if cell is None:
        middle = (tiles.low + tiles.high)[:, [0, 2]] / 2
        cell = np.floor(middle / side_m).astype(np.int64)
    first = cell.min(axis=0)
    size = int((cell.max(axis=0) - first).max()) + 1
    return Quadtree(side_m, max(size - 1, 0).bit_length(), first, cell - first)
