"""What tiles would be: how many, how large, how long they would take, from one block of them.

All models are made, and a block with as many plants as most have; what it took stands for the
others. Far squares are not made: they cost what those of others did.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from vegtool.console import human_bytes, table
from vegtool.errors import VegtoolError
from vegtool.progress import Progress
from vegtool.tiles.jobs import TILES, Failed, Made, SheetJob, World, do
from vegtool.tiles.pyramid import MOST
from vegtool.tiles.run import blocks, models
from vegtool.tiles.shared import Shared

FAR_S = 5.0
"""Seconds of one core for a square of 65,536 triangles that is clustered anew."""
FAR_TRIANGLES = 65_536
FAR_BYTES = 60.0
"""Bytes of such a square for each triangle."""
SURFELS_S = 7.0
"""Seconds of one core for a square of MOST surfels, made of its quarters'."""
SURFEL_BYTES = 20.0


def estimated(world: World, processes: int, progress: Progress) -> tuple[dict[str, Any], str]:
    """Facts for machines, text for people. Nothing is left behind."""
    with TemporaryDirectory() as folder:
        trial = World(world.pyramid, Shared(world.pyramid, Path(folder) / TILES), Path(folder))
        return _estimated(trial, processes, progress)


def _estimated(world: World, processes: int, progress: Progress) -> tuple[dict[str, Any], str]:
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
    times = sum(plants) / max(plants[sample], 1)
    top = tree.height(squares[0].node.level)
    levels = []
    for height in range(tree.depth + 1):
        nodes = tree.nodes(tree.depth - height)
        if height <= top:
            own = [m for m in found if tree.height(int(m.entry.name.split("/")[0])) == height]
            size = times * sum(sum(m.entry.files.values()) for m in own)
            seconds = times * sum(sum(m.seconds.values()) for m in own)
        elif pyramid.options.surfels:
            size, seconds = SURFEL_BYTES * MOST * len(nodes), SURFELS_S * len(nodes)
        else:
            triangles = sum(pyramid.budget(node) for node in nodes)
            size, seconds = FAR_BYTES * triangles, FAR_S * triangles / FAR_TRIANGLES
        levels.append(
            {
                "height": height,
                "side_m": tree.side_m * 2.0**height,
                "tiles": len(nodes),
                "bytes": round(size),
                "seconds": round(seconds, 2),
            }
        )
    progress("tiles", 1.0)
    facts = {
        "plants_at_most": int(counts.sum()),
        "tiles": sum(level["tiles"] for level in levels),
        "bytes": round(shared_bytes + sum(level["bytes"] for level in levels)),
        "shared_bytes": shared_bytes,
        "seconds": round((shared_s + sum(level["seconds"] for level in levels)) / processes, 1),
        "levels": levels,
    }
    return facts, _text(facts, processes)


def _text(facts: dict[str, Any], processes: int) -> str:
    rows = [
        [
            f"{level['side_m']:,.4g} m",
            f"{level['tiles']:,}",
            human_bytes(level["bytes"]),
            f"{level['seconds']:,.1f}",
        ]
        for level in facts["levels"]
    ]
    many = f"{processes} processes" if processes > 1 else "one process"
    return (
        f"{facts['plants_at_most']:,} plants at most; {facts['tiles']:,} tiles, about "
        f"{human_bytes(facts['bytes'])} and {facts['seconds']:,.0f} s with {many}\n\n"
        f"{table(['tiles of', 'tiles', 'bytes', 'seconds'], rows)}"
    )


def _made(world: World, job: Any) -> list[Made]:
    """What a job made. Raises VegtoolError where it failed."""
    outcomes = do(world, job)
    for one in outcomes:
        if isinstance(one, Failed):
            raise VegtoolError(one.message)
    return [one for one in outcomes if isinstance(one, Made)]
