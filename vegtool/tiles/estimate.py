"""What tiles would be: how many, how large, how long they would take, from one block of them.

All models are made, and a block with as many plants as most have; what it took stands for the
others. Far squares are not made: they cost what those of others did.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from vegtool.console import human_bytes, table
from vegtool.errors import VegtoolError
from vegtool.progress import Progress
from vegtool.tiles.jobs import TILES, Failed, Made, SheetJob, World, do
from vegtool.tiles.needed import hidden_by_ground, passed_over, reached_by, skipped_over
from vegtool.tiles.pyramid import MOST, Pyramid
from vegtool.tiles.quadtree import Node
from vegtool.tiles.run import blocks, models
from vegtool.tiles.shared import Shared
from vegtool.tiles.view import View

FAR_S = 5.0
"""Seconds of one core for a square of 65,536 triangles that is clustered anew."""
FAR_TRIANGLES = 65_536
FAR_BYTES = 60.0
"""Bytes of such a square for each triangle."""
SURFELS_S = 7.0
"""Seconds of one core for a square of MOST surfels, made of its quarters'."""
SURFEL_BYTES = 20.0
TOO_NEAR, HIDDEN, TOO_FAR = "eyes too near", "behind ground", "eyes too far"
"""What is said of squares that no viewer is shown."""


def estimated(
    world: World, processes: int, progress: Progress, view: View | None = None
) -> tuple[dict[str, Any], str]:
    """Facts for machines, text for people. view: whom it is for. Nothing is left behind."""
    with TemporaryDirectory() as folder:
        trial = World(world.pyramid, Shared(world.pyramid, Path(folder) / TILES), Path(folder))
        return _estimated(trial, processes, progress, view)


@dataclass(frozen=True)
class _Squares:
    """Of a height: those that are written, those that are made, and why others are not."""

    kept: list[Node]
    made: list[Node]
    too_near: int = 0
    hidden: int = 0


def _squares(pyramid: Pyramid, view: View | None) -> list[_Squares]:
    """Of each height, from 0 on, by the errors that squares have at least."""
    tree = pyramid.tree
    every = [tree.nodes(tree.depth - height) for height in range(tree.depth + 1)]
    if view is None:
        return [_Squares(nodes, nodes) for nodes in every]
    found, passed = [], passed_over(pyramid, view)
    behind = hidden_by_ground(pyramid, view)
    skipped = skipped_over(pyramid, passed, behind - passed)
    for height, (nodes, reached) in enumerate(zip(every, reached_by(pyramid, view), strict=True)):
        kept = [node for node in reached if node not in passed and node not in behind]
        made = kept
        if not pyramid.instanced(height):  # others may be made of them
            made = [node for node in nodes if node not in passed and node not in skipped]
        near, hidden = (sum(node in part for node in nodes) for part in (passed, behind - passed))
        found.append(_Squares(kept, made, near, hidden))
    return found


def _estimated(
    world: World, processes: int, progress: Progress, view: View | None
) -> tuple[dict[str, Any], str]:
    pyramid, tree = world.pyramid, world.pyramid.tree
    counts = pyramid.placement.tiles.count
    shared_bytes, shared_s = 0, 0.0
    first = [*models(pyramid)]
    for index, job in enumerate(first):
        progress("models", 0.8 * index / len(first))
        for made in _made(world, job):
            shared_bytes += sum(made.entry.files.values())
            shared_s += sum(made.seconds.values())
    squares = blocks(pyramid)
    plants = [int(counts[tree.tiles_of(job.node)].sum()) for job in squares]
    sample = int(np.argsort(plants)[len(plants) // 2])
    progress("a block", 0.8)
    found = _made(world, squares[sample])
    if any(one.entry.facts.get("kind") == "merged" for one in found):
        for made in _made(world, SheetJob(height=pyramid.options.near)):
            shared_bytes += sum(made.entry.files.values())
            shared_s += sum(made.seconds.values())
    top = tree.height(squares[0].node.level)
    levels = []
    for height, here in enumerate(_squares(pyramid, view)):
        nodes = tree.nodes(tree.depth - height)
        kept, anew = (
            sum(int(counts[tree.tiles_of(node)].sum()) for node in nodes) / max(plants[sample], 1)
            for nodes in (here.kept, here.made)
        )
        if height <= top:
            own = [m for m in found if tree.height(int(m.entry.name.split("/")[0])) == height]
            size = kept * sum(sum(m.entry.files.values()) for m in own)
            seconds = anew * sum(sum(m.seconds.values()) for m in own)
        elif pyramid.options.surfels:
            size, seconds = SURFEL_BYTES * MOST * len(here.kept), SURFELS_S * len(here.made)
        else:
            size = FAR_BYTES * sum(map(pyramid.budget, here.kept))
            seconds = FAR_S * sum(map(pyramid.budget, here.made)) / FAR_TRIANGLES
        level: dict[str, Any] = {
            "height": height,
            "side_m": tree.side_m * 2.0**height,
            "tiles": len(here.kept),
            "bytes": round(size),
            "seconds": round(seconds, 2),
        }
        if view is not None:
            level |= {
                "too_near": here.too_near,
                "hidden": here.hidden,
                "too_far": len(nodes) - len(here.kept) - here.too_near - here.hidden,
            }
        levels.append(level)
    progress("tiles", 1.0)
    facts = {
        "plants_at_most": int(counts.sum()),
        "tiles": sum(level["tiles"] for level in levels),
        "bytes": round(shared_bytes + sum(level["bytes"] for level in levels)),
        "shared_bytes": shared_bytes,
        "seconds": round((shared_s + sum(level["seconds"] for level in levels)) / processes, 1),
        "levels": levels,
    }
    if view is not None:
        facts["scene"] = view.told
    return facts, _text(facts, processes)


def _text(facts: dict[str, Any], processes: int) -> str:
    head = ["tiles of", "tiles", "bytes", "seconds"]
    rows = [
        [
            f"{level['side_m']:,.4g} m",
            f"{level['tiles']:,}",
            human_bytes(level["bytes"]),
            f"{level['seconds']:,.1f}",
        ]
        for level in facts["levels"]
    ]
    if "scene" in facts:
        head += [TOO_NEAR, HIDDEN, TOO_FAR]
        for row, level in zip(rows, facts["levels"], strict=True):
            row += [f"{level[key]:,}" for key in ("too_near", "hidden", "too_far")]
    many = f"{processes} processes" if processes > 1 else "one process"
    return (
        f"{facts['plants_at_most']:,} plants at most; {facts['tiles']:,} tiles, about "
        f"{human_bytes(facts['bytes'])} and {facts['seconds']:,.0f} s with {many}\n\n"
        f"{table(head, rows)}"
    )


def _made(world: World, job: Any) -> list[Made]:
    """What a job made. Raises VegtoolError where it failed."""
    outcomes = do(world, job)
    for one in outcomes:
        if isinstance(one, Failed):
            raise VegtoolError(one.message)
    return [one for one in outcomes if isinstance(one, Made)]
