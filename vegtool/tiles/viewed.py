"""A tileset for the viewers of a scene: of all tiles, those that a client may draw at any eye.

What squares are wrong by is known when they are made, and those above are wrong by more. So what is
merged is made first, from the blocks on: all that is on a square that is drawn, as that is made of
it. Of squares of instances nothing is made of, and what they would be wrong by is known from their
plants. Then it is known which squares give way to their quarters; instances are made where they are
shown, and what was made and is not shown is removed.

Its facts stay in the journal: it is made again only where it is to be shown, or something else
that is, is to be made of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from math import ceil, inf, isfinite, log2
from typing import Any

import numpy as np

from vegtool.formats.tileset import TileEntry
from vegtool.progress import Progress, silent
from vegtool.tiles.estimate import FAR_BYTES, SURFEL_BYTES
from vegtool.tiles.jobs import (
    BlockJob,
    Failed,
    Job,
    Lacking,
    Made,
    ModelJob,
    Outcome,
    Surveyed,
    World,
    file_of,
    name_of,
)
from vegtool.tiles.journal import Entry, appended
from vegtool.tiles.needed import contents_of, hidden_by_ground, passed_over, pruned, skipped_over
from vegtool.tiles.quadtree import Node, nodes_of
from vegtool.tiles.run import COST, TREE, Each, Run, blocks, clean, models
from vegtool.tiles.tree import tree_of
from vegtool.tiles.view import View

STEPS = 4
"""To an octave, of the pixels that a model's metre is seen as: a camera that is moved a little
leaves models as they are."""
INSTANCE_BYTES = 52.0
"""Of a plant in a square of instances: its place, its turn, its scale and its tint."""

Write = Callable[[Entry], None]


class ViewedRun(Run):
    """A tileset that is being made for some viewers. passed: squares that none is far enough from.
    hidden: squares that none sees for the ground; skipped: those of them that nothing is made of.
    surveyed: squares of instances, by name. kept: files of the tiles that are shown."""

    def __init__(
        self, world: World, view: View, each: Each | None = None, progress: Progress = silent
    ) -> None:
        super().__init__(world, each, progress)
        self.view = view
        self.passed = passed_over(world.pyramid, view)
        self.hidden = hidden_by_ground(world.pyramid, view) - self.passed
        self.skipped = skipped_over(world.pyramid, self.passed, self.hidden)
        self._unmade = self.passed | self.skipped
        self.surveyed: dict[str, Surveyed] = {}
        self.kept: set[str] = set()
        self._plants = 0
        self._lacking: list[Lacking] = []
        self._shared: set[str] = set()

    def tiles(self) -> Iterator[Outcome]:
        """Make all parts that are shown, and what they are made of, and yield what comes of each.

        Raises OutputError where nothing can be written.
        """
        pyramid, tree = self.world.pyramid, self.world.pyramid.tree
        jobs = self._blocks()
        every = [self._merged(height) for height in range(pyramid.top, tree.depth + 1)]
        self._all = 2 * COST[BlockJob] * len(jobs) + 12 * sum(map(len, every[1:])) + 8
        clean(self.world.out)
        with appended(self.world.out) as write:
            yield from self._do(jobs, write)
            for height, nodes in enumerate(every, pyramid.top):
                if height > pyramid.top:
                    yield from self._far_squares(nodes, write)
                yield from self._do(self._sheets(nodes), write)
            root = self._root()
            self.kept = contents_of(root)
            shown = [node for node in self._all_nodes() if file_of(node) in self.kept]
            near = [node for node in shown if str(node) in self.surveyed]
            yield from self._do(self._models(near), write)
            yield from self._do(self._instances(near), write)
            far = [node for node in shown if str(node) not in self.surveyed]
            for _, same in groupby(far, lambda node: node.level):  # the lowest first
                yield from self._again(list(same), write)
            self._shared = {name_of(job) for job in self._sheets(far)}
            self._shared |= {name_of(job) for job in self._models(near)}
        self.progress("tiles", 1.0)

    def told(self) -> dict[str, Any]:
        """Plain values: whom it is made for, and what they do not need of each size of squares."""
        every = len(models(self.world.pyramid))
        kept = sum(name.startswith("model") for name in self._shared)
        models_of = {"all": every, "kept": kept}
        return {
            **self.view.told,
            "plants": self._plants,
            "left_out": self.left_out(),
            "models": models_of,
        }

    def shown(self, made: Sequence[Made]) -> list[Made]:
        """Of what was made, what the tileset has: each once, with the seconds of all times."""
        found: dict[str, Made] = {}
        for one in made:
            name, before = one.entry.name, found.get(one.entry.name)
            if before is not None:
                steps = {*before.seconds, *one.seconds}
                seconds = {s: before.seconds.get(s, 0.0) + one.seconds.get(s, 0.0) for s in steps}
                one = replace(one, again=one.again or before.again, seconds=seconds)
            found[name] = one
        return [one for one in found.values() if self._is_kept(one.entry)]

    def left_out(self) -> list[dict[str, Any]]:
        """Of each height at which anything is left out: how many squares there are and are kept;
        too_near: that every eye is too near to; hidden: before which the ground is; too_far: that
        stay behind those that they lie on, as no eye comes so near. plants: on the last two, and
        bytes: about how many all of them are."""
        tree = self.world.pyramid.tree
        rows = []
        for height in range(tree.depth + 1):
            nodes = tree.nodes(tree.depth - height)
            near = [node for node in nodes if node in self.passed]
            kept = sum(file_of(node) in self.kept for node in nodes)
            rest = [node for node in nodes if file_of(node) not in self.kept]
            skipped = [node for node in nodes if node in self.skipped]
            hidden, far = (
                [one for one in map(self._told_of, part) if one is not None]
                for part in (
                    [node for node in rest if node in self.hidden],
                    [node for node in rest if node not in self.hidden],
                )
            )
            others, unmade = [*hidden, *far], [*near, *skipped]
            if not others and not unmade:
                continue
            rows.append(
                {
                    "height": height,
                    "side_m": tree.side_m * 2.0**height,
                    "squares": kept + len(unmade) + len(others),
                    "kept": kept,
                    "too_near": len(near),
                    "too_far": len(far),
                    "hidden": len(hidden) + len(skipped),
                    "plants": sum(one.facts["plants"] for one in others)
                    + sum(map(self._count, skipped)),
                    "bytes": round(
                        sum(map(self._bytes_of, others)) + sum(map(self._unmade_bytes, unmade))
                    ),
                }
            )
        return rows

    def _told_of(self, node: Node) -> Entry | None:
        """What is known of a square with plants on it."""
        entry = self.found.get(str(node))
        if entry is None and str(node) in self.surveyed:
            entry = self.surveyed[str(node)].entry
        return entry if entry is not None and entry.facts["plants"] else None

    def _is_kept(self, entry: Entry) -> bool:
        return entry.name in self._shared or bool(self.kept & entry.files.keys())

    def _bytes_of(self, entry: Entry) -> float:
        """About how many a square would be: as it was made, or as instances are."""
        return sum(entry.files.values()) or INSTANCE_BYTES * float(entry.facts["plants"])

    def _count(self, node: Node) -> int:
        """Of plants on a square, at most."""
        pyramid = self.world.pyramid
        return int(pyramid.placement.tiles.count[pyramid.tree.tiles_of(node)].sum())

    def _unmade_bytes(self, node: Node) -> float:
        """About how many a square would be that nobody looked at."""
        pyramid, count = self.world.pyramid, float(self._count(node))
        if pyramid.instanced(pyramid.tree.height(node.level)):
            return INSTANCE_BYTES * count
        if pyramid.options.surfels:
            return SURFEL_BYTES * pyramid.surfels_for(count * float(pyramid.of_level[:, 0].mean()))
        return FAR_BYTES * pyramid.budget(node)

    def _root(self) -> TileEntry | None:
        looked_at = {
            name: one.entry for name, one in self.surveyed.items() if name not in self.failed
        }
        root = tree_of(self.world.pyramid, {**looked_at, **self.found})
        if root is None:
            return None
        alone = (node for node in self.skipped if node.parent not in self.skipped)
        self._plants = root.plants + sum(map(self._count, alone))
        return pruned(root, self.view, {file_of(node) for node in self.hidden})

    def _do(self, jobs: Sequence[Job], write: Write) -> Iterator[Outcome]:
        for outcome in super()._do(jobs, write):
            if isinstance(outcome, Surveyed):
                self.surveyed[outcome.entry.name] = outcome
            elif isinstance(outcome, Lacking):
                self._lacking.append(outcome)
            else:
                if isinstance(outcome, Failed):
                    self.found.pop(outcome.name, None)  # as it was known before
                yield outcome

    def _all_nodes(self) -> list[Node]:
        """The smallest first."""
        tree = self.world.pyramid.tree
        return [node for level in range(tree.depth, -1, -1) for node in tree.nodes(level)]

    def _merged(self, height: int) -> list[Node]:
        """Squares of a height that are made before it is known what is shown."""
        pyramid = self.world.pyramid
        if pyramid.instanced(height):
            return []
        nodes = pyramid.tree.nodes(pyramid.tree.depth - height)
        return [node for node in nodes if node not in self._unmade]

    def _blocks(self) -> list[Job]:
        """What of each is merged, and what of it is looked at."""
        pyramid, found = self.world.pyramid, list[Job]()
        for job in blocks(pyramid):
            on_it = nodes_of(pyramid.tree, job.node)
            wanted = [node for node in on_it if node not in self._unmade]
            near, made = (
                tuple(
                    n for n in wanted if pyramid.instanced(pyramid.tree.height(n.level)) == is_near
                )
                for is_near in (True, False)
            )
            if wanted:
                found.append(replace(job, made=made, surveyed=near, facts=True))
        return found

    def _instances(self, nodes: Sequence[Node]) -> list[Job]:
        """What makes these squares."""
        pyramid, wanted = self.world.pyramid, set(nodes)
        found: list[Job] = []
        for job in blocks(pyramid):
            made = tuple(one for one in nodes_of(pyramid.tree, job.node) if one in wanted)
            if made:
                found.append(replace(job, made=made))
        return found

    def _models(self, nodes: Sequence[Node]) -> list[Job]:
        """What squares of instances draw, with the texels that are seen of it."""
        pyramid = self.world.pyramid
        found: dict[tuple[int, int], float] = {}
        if not nodes:
            return []
        seen = self.view.pixels_per_metre(np.stack([pyramid.bounds(node) for node in nodes]))
        for node, pixels in zip(nodes, seen.tolist(), strict=True):
            for pair, scale in self.surveyed[str(node)].scale.items():
                found[pair] = max(found.get(pair, 0.0), pixels * scale)
        return [
            ModelJob(kind=kind, level=level, per_metre=_rounded_up(pixels))
            for (kind, level), pixels in sorted(found.items())
        ]

    def _far_squares(self, nodes: Sequence[Node], write: Write) -> Iterator[Outcome]:
        """Those above the blocks, and again what they lack, where they are made anew."""
        yield from self._do([replace(self._far(node), facts=True) for node in nodes], write)
        lacking, self._lacking = self._lacking, []
        if lacking:
            yield from self._again([one for each in lacking for one in each.quarters], write)
            yield from self._do([self._far(each.node) for each in lacking], write)

    def _again(self, nodes: Sequence[Node], write: Write) -> Iterator[Outcome]:
        """Make squares of one size whose files are gone, and before them what they are made of."""
        pyramid, tree = self.world.pyramid, self.world.pyramid.tree
        gone = [node for node in nodes if self._is_gone(node)]
        if not gone:
            return
        of_others = [
            node for node in gone
            if self.found[str(node)].facts["kind"] == "reclustered"
            or (pyramid.options.surfels and tree.height(node.level) > pyramid.top)
        ]  # fmt: skip
        yield from self._again([one for each in of_others for one in tree.quarters(each)], write)
        jobs = [
            self._far(node) if tree.height(node.level) > pyramid.top
            else BlockJob(node=node, made=(node,))
            for node in gone
        ]  # fmt: skip
        yield from self._do(jobs, write)

    def _is_gone(self, node: Node) -> bool:
        entry = self.found.get(str(node))
        return entry is not None and not entry.there(self.world.out)

    def _forget(self) -> None:
        """Remove the files of what is not shown. What is known of merged squares stays: others are
        made of them."""
        shared = {name for name in self.found if name.startswith(("model", "sheet"))}
        kept = self.kept.union(*(self.found[n].files for n in shared & self._shared))
        kept |= self.found[TREE].files.keys()
        for entry in (*self._known.values(), *self.found.values()):
            for file in entry.files:
                if file not in kept:
                    (self.world.out / file).unlink(missing_ok=True)
        for name in shared - self._shared:
            del self.found[name]


def _rounded_up(pixels: float) -> float:
    """To the next step."""
    if not isfinite(pixels):
        return inf
    return float(2.0 ** (ceil(STEPS * log2(pixels)) / STEPS)) if pixels > 0 else 0.0
