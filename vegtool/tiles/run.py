"""A tileset: what tiles share, then all tiles, the smallest first, then what clients begin with.

Each file is whole or absent, and the journal says which are there: a run that was interrupted goes
on where it was, and one whose inputs have changed makes only what they change. Squares of one
height do not depend on each other, so they are made side by side.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from vegtool.errors import UsageError
from vegtool.formats.tileset import TILESET, TileEntry, tileset_files
from vegtool.progress import Progress, silent
from vegtool.tiles.jobs import (
    TILES,
    BlockJob,
    Failed,
    FarJob,
    Job,
    Made,
    ModelJob,
    Outcome,
    SheetJob,
    TileJob,
    World,
    called,
    do,
    name_of,
)
from vegtool.tiles.journal import (
    PART,
    Entry,
    appended,
    read_journal,
    write_file,
    write_journal,
)
from vegtool.tiles.pyramid import Pyramid, used_levels
from vegtool.tiles.quadtree import Node, nodes_of
from vegtool.tiles.tree import index_json, tree_of
from vegtool.workers import alone

Each = Callable[[Sequence[Job]], Iterator[tuple[Job, list[Outcome] | None]]]
"""Does jobs, in any order; None where whoever did one was ended from outside."""
LOST = (
    "the process that made it was ended from outside, again and again, mostly for want of memory; "
    "fewer processes (-j) need less"
)
COST = {ModelJob: 1.0, SheetJob: 8.0, TileJob: 1.0, BlockJob: 4.0, FarJob: 12.0}
"""How long jobs take, beside each other."""
BEGINS = {"3dtiles": TILESET, "glb": "index.json"}
"""What readers begin with, by the format of the tiles."""
TREE = "tree"
"""What the journal calls that."""


class Run:
    """A tileset that is being made. found: the parts that are there, by name. failed: those that
    are not, and why."""

    def __init__(self, world: World, each: Each | None = None, progress: Progress = silent) -> None:
        self.world, self.progress = world, progress
        self.each = each or partial(alone, partial(do, world))
        self.found: dict[str, Entry] = {}
        self.failed: dict[str, Failed] = {}
        self._known = read_journal(world.out)
        self._done, self._all = 0.0, 0.0

    def tiles(self) -> Iterator[Outcome]:
        """Make all parts, and yield what comes of each.

        Raises OutputError where nothing can be written.
        """
        pyramid, out = self.world.pyramid, self.world.out
        tree, top = pyramid.tree, pyramid.top
        self._all = _cost(pyramid)
        clean(out)
        with appended(out) as write:
            yield from self._do(models(pyramid), write)
            yield from self._do(blocks(pyramid), write)
            for height in range(top, tree.depth + 1):
                nodes = tree.nodes(tree.depth - height)
                if height > top:
                    yield from self._do([self._far(node) for node in nodes], write)
                yield from self._do(self._sheets(nodes), write)

    def only(self, nodes: Sequence[Node]) -> Iterator[Outcome]:
        """Make some tiles, with the models and the sheets that they draw, and nothing else; others
        may be at work in the same folder.

        Raises UsageError for one that is made of quarters which are not there.
        """
        tree, top = self.world.pyramid.tree, self.world.pyramid.top
        jobs: list[Job] = []
        for node in nodes:
            if tree.height(node.level) <= top:
                jobs.append(TileJob(node=node))
                continue
            quarters = tree.quarters(node)
            for one in quarters:
                if str(one) not in self._known or not self._known[str(one)].there(self.world.out):
                    raise UsageError(
                        f"--only {node}: expected its quarters, of which it may be made; {one} is "
                        "not there. Make it first, or all tiles"
                    )
            jobs.append(
                FarJob(node=node, quarters=tuple((q, self._known[str(q)]) for q in quarters))
            )
        self._all = sum(COST[type(job)] for job in jobs)
        with appended(self.world.out) as write:
            yield from self._do(jobs, write)
            yield from self._do(self._sheets(nodes), write)
        self.progress("tiles", 1.0)

    def finish(self) -> list[str]:
        """Write what clients begin with, remove what this tileset no longer has, and put the
        journal in order. The files' names, first the one to begin with.

        Raises UsageError where there are no plants on any tile.
        """
        pyramid, out = self.world.pyramid, self.world.out
        clean(out)  # of processes that were ended
        root = self._root()
        if root is None:
            if self.failed:
                return []
            raise UsageError(
                "tiles: expected plants, found none that stands on the ground of the scene. Check "
                "[placement], and where [[species]] may grow"
            )
        placed = pyramid.placed
        if pyramid.options.format == "glb":
            files = {BEGINS["glb"]: index_json(pyramid, root, placed, self.told())}
        else:
            files = tileset_files(root, placed, scene=self.told())
        begin = BEGINS[pyramid.options.format]
        names = [begin, *(name for name in files if name != begin)]
        for name in reversed(names):
            write_file(out / name, files[name])
        self.found[TREE] = Entry(TREE, "", {name: len(files[name]) for name in names})
        self._forget()
        write_journal(out, self.found)
        return names

    def told(self) -> dict[str, Any] | None:
        """What of a scene the tileset is made for; None where it is for any."""
        return None

    def shown(self, made: Sequence[Made]) -> list[Made]:
        """Of what was made, what the tileset has."""
        return list(made)

    def _root(self) -> TileEntry | None:
        """What the tileset is to have; None where no plants turned out to stand anywhere."""
        return tree_of(self.world.pyramid, self.found)

    def _sheets(self, nodes: Sequence[Node]) -> list[SheetJob]:
        """What tiles that were made are drawn with, where any is merged."""
        tree, entries = self.world.pyramid.tree, self.found
        merged = {
            tree.height(node.level)
            for node in nodes
            if str(node) in entries and entries[str(node)].facts.get("kind") == "merged"
        }
        return [SheetJob(height=height) for height in sorted(merged)]

    def _do(self, jobs: Sequence[Job], write: Callable[[Entry], None]) -> Iterator[Outcome]:
        for job, outcomes in self.each([self._knowing(job) for job in jobs]):
            name = name_of(job)
            for outcome in outcomes or [Failed(name, f"{called(name)}: {LOST}")]:
                if isinstance(outcome, Failed):
                    self.failed[outcome.name] = outcome
                elif isinstance(outcome, Made):
                    self.found[outcome.entry.name] = outcome.entry
                    if outcome.again:
                        write(outcome.entry)
                yield outcome
            self._done += COST[type(job)]
            self.progress(name, min(self._done / self._all, 1.0))

    def _knowing(self, job: Job) -> Job:
        """A job with what the journal has of what it makes."""
        names = [name_of(job)]
        if isinstance(job, BlockJob):
            names = [str(node) for node in nodes_of(self.world.pyramid.tree, job.node)]
        return replace(job, known={n: self._known[n] for n in names if n in self._known})

    def _far(self, node: Node) -> FarJob:
        quarters = self.world.pyramid.tree.quarters(node)
        return FarJob(node=node, quarters=tuple((q, self.found.get(str(q))) for q in quarters))

    def _forget(self) -> None:
        """Remove the files of parts that this tileset does not have, and an earlier one had."""
        kept = {file for entry in self.found.values() for file in entry.files}
        for entry in self._known.values():
            for file in entry.files:
                if file not in kept:
                    (self.world.out / file).unlink(missing_ok=True)


def node_of(name: str, pyramid: Pyramid) -> Node:
    """The tile of a name such as 3/5/2: level, column and row. Raises UsageError where it has no
    plants."""
    match = re.fullmatch(r"(\d+)/(\d+)/(\d+)", name)
    node = Node(*map(int, match.groups())) if match else None
    if node is not None and (
        node.level > pyramid.tree.depth or max(node.column, node.row) >= 2**node.level
    ):
        node = None
    if node is None or not len(pyramid.tree.tiles_of(node)):
        last = pyramid.tree.nodes(pyramid.tree.depth)[0]
        raise UsageError(
            f"--only {name}: expected LEVEL/COLUMN/ROW of a tile with plants, from 0/0/0 to those "
            f"of level {pyramid.tree.depth}, such as {last}; there is none of that name"
        )
    return node


def clean(folder: Path) -> None:
    """Remove what killed runs left half-written."""
    for place in (folder, folder / TILES):
        for part in (place.rglob if place != folder else place.glob)(f".*{PART}"):
            part.unlink(missing_ok=True)


def models(pyramid: Pyramid) -> list[Job]:
    near = range(min(pyramid.options.near, pyramid.tree.depth + 1))
    pairs = {pair for height in near for pair in used_levels(pyramid, height)}
    return [ModelJob(kind=kind, level=level) for kind, level in sorted(pairs)]


def blocks(pyramid: Pyramid) -> list[BlockJob]:
    tree = pyramid.tree
    return [BlockJob(node=node) for node in tree.nodes(tree.depth - pyramid.top)]


def _cost(pyramid: Pyramid) -> float:
    """Of all jobs."""
    tree, top = pyramid.tree, pyramid.top
    far = sum(tree.count(level) for level in range(tree.depth - top))
    return (
        COST[ModelJob] * len(models(pyramid))
        + COST[BlockJob] * tree.count(tree.depth - top)
        + COST[FarJob] * far
        + COST[SheetJob]
    )
