"""Which squares of a landscape the viewers of a scene can ever be shown.

Source: OGC 22-025r4, 3D Tiles 1.1, section 6.3: clients draw a tile until its error, seen from the
nearest point of its box, is more than some pixels, and then its quarters in its place.

A square all of whose eyes see more of an error than that is never drawn, nor is one that it lies
on: those have larger errors, and nearer boxes. A square of which no eye does is a leaf.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.formats.tileset import BLENDED, CLIENT_PX, TileEntry
from vegtool.tiles.pyramid import Pyramid
from vegtool.tiles.quadtree import Node, nodes_of
from vegtool.tiles.view import View


def passed_over(pyramid: Pyramid, view: View) -> frozenset[Node]:
    """The squares that no client draws, as all eyes are so near to them that their quarters are
    drawn: by the errors that they have at least, in boxes that they fill at least."""
    found: set[Node] = set()
    front = pyramid.tree.nodes(0)
    while front:
        error = np.array([pyramid.error_m(pyramid.tree.height(one.level)) for one in front])
        passed = view.passed(_boxes(pyramid, front), error)
        here = [one for one, is_passed in zip(front, passed, strict=True) if is_passed]
        found.update(here)
        front = [quarter for one in here for quarter in pyramid.tree.quarters(one)]
    return frozenset(found)


def reached_by(pyramid: Pyramid, view: View) -> list[list[Node]]:
    """The squares that clients may draw, or draw the quarters of, by the errors that they have at
    least: of each height, from 0 on. Where greater errors are measured, there are more."""
    tree = pyramid.tree
    found = [tree.nodes(0)]
    for level in range(tree.depth):
        height = tree.height(level)
        error = np.full(len(found[-1]), pyramid.error_m(height))
        surfels = pyramid.options.surfels and not pyramid.instanced(height)
        seen = np.full(len(error), gives_way_px(surfels))
        on = np.zeros(0, np.bool_)
        if found[-1]:
            on = view.refined(_boxes(pyramid, found[-1]), error, seen)
        parents = [one for one, refined in zip(found[-1], on, strict=True) if refined]
        found.append([quarter for one in parents for quarter in tree.quarters(one)])
    return found[::-1]


def hidden_by_ground(pyramid: Pyramid, view: View) -> frozenset[Node]:
    """The squares, with those on them, before all of which the ground is for every eye; none where
    that is before the whole landscape, as something is to be shown."""
    found: set[Node] = set()
    if not view.hills:
        return frozenset()
    front = pyramid.tree.nodes(0)
    while front:
        behind = view.hidden(_boxes(pyramid, front)).tolist()
        for node, is_hidden in zip(front, behind, strict=True):
            if is_hidden:
                found.update(nodes_of(pyramid.tree, node))
        front = [q for node in front if node not in found for q in pyramid.tree.quarters(node)]
    for level in range(pyramid.tree.depth - 1, -1, -1):
        for node in pyramid.tree.nodes(level):
            if all(quarter in found for quarter in pyramid.tree.quarters(node)):
                found.add(node)
    return frozenset() if pyramid.tree.nodes(0)[0] in found else frozenset(found)


def skipped_over(pyramid: Pyramid, passed: Set[Node], hidden: Set[Node]) -> frozenset[Node]:
    """The hidden squares that nothing is made of: those that they lie on are hidden or passed over
    as well."""
    found: set[Node] = set()
    for level in range(pyramid.tree.depth + 1):
        for node in pyramid.tree.nodes(level):
            above = level == 0 or node.parent in passed or node.parent in found
            if above and node in hidden:
                found.add(node)
    return frozenset(found)


def gives_way_px(surfels: bool) -> float:
    """Pixels of error from which on a square's quarters are drawn: of surfels beside its own."""
    return CLIENT_PX / (1 + BLENDED) if surfels else CLIENT_PX


def pruned(root: TileEntry, view: View, hidden: Set[str] = frozenset()) -> TileEntry | None:
    """A tileset without the tiles that no client goes on to from any eye, without those whose files
    are hidden, and without those on top that have no content and a single child. None where nothing
    is left."""
    leaves: set[int] = set()
    front: Sequence[TileEntry] = [root]
    while front:
        boxes = np.stack([one.bounds for one in front])
        error = np.array([one.error_m for one in front])
        seen = np.array([gives_way_px(one.surfels > 0) for one in front])
        on = view.refined(boxes, error, seen) | np.array([one.uri is None for one in front])
        leaves.update(id(one) for one, refined in zip(front, on, strict=True) if not refined)
        front = [
            child for one, refined in zip(front, on, strict=True) if refined
            for child in one.children
        ]  # fmt: skip

    def kept(tile: TileEntry) -> TileEntry | None:
        below = () if id(tile) in leaves else map(kept, tile.children)
        there = tuple(one for one in below if one is not None)
        if tile.uri in hidden or (tile.uri is None and not there):
            return None
        return replace(tile, children=there)

    top = kept(root)
    while top is not None and top.uri is None and len(top.children) == 1:
        (top,) = top.children
    return top


def contents_of(root: TileEntry | None) -> set[str]:
    """The files of a tileset's tiles."""
    if root is None:
        return set()
    own = set() if root.uri is None else {root.uri}
    return own.union(*map(contents_of, root.children))


def _boxes(pyramid: Pyramid, nodes: Sequence[Node]) -> FloatArray:
    """(n, 2, 3)."""
    return np.stack([pyramid.bounds(node) for node in nodes])
