"""The squares over the tiles of a placement, against squares walked one by one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from tile_cases import TWO_SPECIES, placed

from vegtool.seeding import generator
from vegtool.tiles.placement import Tiles
from vegtool.tiles.quadtree import Node, Quadtree, quadtree_of

SIDE = 32.0


def on_cells(cells: npt.ArrayLike, side: float = SIDE) -> Tiles:
    """A tile with a plant in the middle of each (column, row)."""
    middle = (np.asarray(cells, np.float64).reshape(-1, 2) + 0.5) * side
    feet = np.stack([middle[:, 0], 0 * middle[:, 0], middle[:, 1]], axis=1)
    return Tiles(feet, feet, np.ones(len(feet), np.int64))


def scattered(count: int = 40, seed: int = 0) -> np.ndarray:
    """(n, 2) cells, each once, on both sides of the origin."""
    cells = generator(seed, "cells").integers(-9, 11, (count, 2))
    return np.unique(cells, axis=0)


def all_nodes(tree: Quadtree) -> list[Node]:
    return [node for level in range(tree.depth + 1) for node in tree.nodes(level)]


def inside(tree: Quadtree, node: Node, tiles: Tiles) -> list[int]:
    """Tiles whose middle lies on a square, by its corners in metres."""
    half = tree.side(node.level) / 2
    low, high = tree.middle(node) - half, tree.middle(node) + half
    found = []
    for index, foot in enumerate(tiles.low):
        if low[0] <= foot[0] < high[0] and low[1] <= foot[2] < high[1]:
            found.append(index)
    return found


def test_one_tile_is_the_root() -> None:
    tree = quadtree_of(on_cells([3, -2]), SIDE)
    assert (tree.depth, tree.nodes(0)) == (0, [Node(0, 0, 0)])
    assert tree.quarters(Node(0, 0, 0)) == () and tree.tiles_of(Node(0, 0, 0)).tolist() == [0]
    assert tree.middle(Node(0, 0, 0)).tolist() == [3.5 * SIDE, -1.5 * SIDE]


@pytest.mark.parametrize(
    ("across", "depth"), [(1, 0), (2, 1), (3, 2), (4, 2), (5, 3), (8, 3), (9, 4)]
)
def test_the_root_is_the_least_power_of_two_that_holds_all(across: int, depth: int) -> None:
    """Whether they lie along x or along z, and wherever the first is."""
    for cells in ([[0, 0], [across - 1, 0]], [[-7, 5], [-7, 4 + across]]):
        tree = quadtree_of(on_cells(cells), SIDE)
        assert (tree.depth, tree.side(0), tree.side(depth)) == (depth, SIDE * 2**depth, SIDE)
        assert [tree.height(level) for level in (0, depth)] == [depth, 0]


def test_levels_above_hold_what_the_least_root_does() -> None:
    """Each of twice the side, with one quarter on which there are plants."""
    cells = scattered()
    tree, more = quadtree_of(on_cells(cells), SIDE), quadtree_of(on_cells(cells), SIDE, above=3)
    assert (more.depth, more.side(3)) == (tree.depth + 3, tree.side(0))
    for level in range(3):
        assert more.nodes(level) == [Node(level, 0, 0)]
        assert more.quarters(Node(level, 0, 0)) == (Node(level + 1, 0, 0),)
        assert len(more.tiles_of(Node(level, 0, 0))) == len(cells)
    assert more.middle(Node(3, 0, 0)).tolist() == tree.middle(Node(0, 0, 0)).tolist()


def test_a_border_belongs_to_the_square_that_begins_there() -> None:
    """As of the placement, whose squares are floor(x / side)."""
    at = np.array([[0.0, 0, 0], [SIDE, 0, 0], [np.nextafter(SIDE, 0), 0, 0], [-1e-9, 0, 0]])
    tree = quadtree_of(Tiles(at, at, np.ones(4)), SIDE)
    assert (tree.cell[:, 0] + tree.first[0]).tolist() == [0, 1, 0, -1]


def test_squares_are_where_tiles_are_row_by_row() -> None:
    tiles = on_cells(scattered())
    tree = quadtree_of(tiles, SIDE)
    for level in range(tree.depth + 1):
        wanted = set()
        for column, row in tree.cell.tolist():
            for _ in range(tree.height(level)):
                column, row = column // 2, row // 2
            wanted.add((row, column))
        assert tree.nodes(level) == [Node(level, c, r) for r, c in sorted(wanted)]
        assert tree.count(level) == len(wanted)
    assert tree.nodes(0) == [Node(0, 0, 0)]
    assert len(tree.nodes(tree.depth)) == len(tree.cell), "the last level is that of the tiles"


def test_tiles_of_a_square_lie_on_it() -> None:
    tiles = on_cells(scattered())
    tree = quadtree_of(tiles, SIDE)
    for node in all_nodes(tree):
        assert tree.tiles_of(node).tolist() == inside(tree, node, tiles), str(node)
    for node in tree.nodes(tree.depth):
        (index,) = tree.tiles_of(node)
        np.testing.assert_allclose(tree.middle(node), tiles.low[index, [0, 2]], atol=1e-9)
    for absent in (Node(tree.depth, 2**tree.depth, 0), Node(0, 1, 0), Node(1, 0, 2)):
        assert not len(tree.tiles_of(absent))


def test_every_tile_of_a_square_is_on_exactly_one_of_its_quarters() -> None:
    tree = quadtree_of(on_cells(scattered()), SIDE)
    for node in all_nodes(tree):
        quarters = tree.quarters(node)
        if node.level == tree.depth:
            assert not quarters, "a tile has none"
            continue
        assert 1 <= len(quarters) <= 4
        assert all(one.parent == node and one in tree.nodes(one.level) for one in quarters)
        found = np.concatenate([tree.tiles_of(one) for one in quarters])
        assert sorted(found.tolist()) == tree.tiles_of(node).tolist()


def test_a_quarter_is_a_quarter_of_its_square() -> None:
    tree = quadtree_of(on_cells(scattered()), SIDE)
    for node in all_nodes(tree):
        for one in tree.quarters(node):
            away = np.abs(tree.middle(one) - tree.middle(node))
            np.testing.assert_allclose(away, tree.side(node.level) / 4, rtol=1e-12)


def test_moved_tiles_have_moved_squares() -> None:
    cells = scattered()
    here, there = (quadtree_of(on_cells(c), SIDE) for c in (cells, cells + np.array([1000, -3])))
    np.testing.assert_array_equal(here.cell, there.cell)
    assert (there.first - here.first).tolist() == [1000, -3]
    for node in all_nodes(here):
        assert here.quarters(node) == there.quarters(node)
        moved = there.middle(node) - here.middle(node)
        assert moved.tolist() == [1000 * SIDE, -3 * SIDE]


def test_the_order_of_tiles_does_not_matter_and_they_stay_as_they_are() -> None:
    cells = scattered()
    tiles = on_cells(cells)
    before = tiles.low.tobytes(), tiles.high.tobytes()
    tree, other = quadtree_of(tiles, SIDE), quadtree_of(on_cells(cells[::-1]), SIDE)
    assert all_nodes(tree) == all_nodes(other)
    assert all(tree.quarters(node) == other.quarters(node) for node in all_nodes(tree))
    assert (tiles.low.tobytes(), tiles.high.tobytes()) == before


def test_squares_are_named_and_sorted_by_level() -> None:
    assert str(Node(3, 5, 2)) == "3/5/2"
    assert Node(3, 5, 2).parent == Node(2, 2, 1)
    assert sorted([Node(1, 1, 0), Node(0, 0, 0), Node(1, 0, 1)]) == [
        Node(0, 0, 0), Node(1, 0, 1), Node(1, 1, 0),
    ]  # fmt: skip


def test_every_tile_of_a_placement_has_a_square_of_its_own(tmp_path: Path) -> None:
    """The ground goes on for 1 cm beyond the last whole tile."""
    head = TWO_SPECIES + "[placement]\nspacing_m = 3\n[terrain]\n"
    side = placed(tmp_path, head + "extent_m = [90, 90]", SIDE).tile_m
    placement = placed(tmp_path, head + f"extent_m = [{4 * side + 0.02}, 60]", SIDE)
    assert placement.tile_m == side
    tree = quadtree_of(placement.tiles, side)
    assert len(tree.nodes(tree.depth)) == len(placement.tiles)
