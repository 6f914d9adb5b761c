"""Tiles of a landscape: how long they take, how large they are, how far from the truth.

    python benchmarks/tiles.py                        # everything; two hours, half of it the truth
    python benchmarks/tiles.py --parts whole,merge
    python benchmarks/tiles.py --record --markdown --figures docs

The paper's 390,000 plants of ten species on a square kilometre (landscape/scenes.py), with the
options that `vegtool tiles` has.

whole: the command, from a converted library to the tileset: seconds, memory, bytes, by height.
merge: merging and writing alone. scale: 10,000, 100,000 and 1,000,000 plants. single: one tile of a
landscape of 10 x 10 km. error: FLIP of what clients draw at five stations. rebaked: squares
clustered anew beside a subsample of their quarters.

Converted plants, tiles and pictures of the truth are kept in --cache. What is missed of what is
asked is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from landscape import tables
from landscape.making import Made, command, merging, single
from landscape.rebaked import compared
from landscape.scenes import PLANTS, SIDE_M, library, scene
from landscape.stations import STATIONS, seen
from recorded import record, written
from walk.speed import alone

from vegtool import __version__
from vegtool.gl.context import describe
from vegtool.tiles.jobs import Inputs, world_of
from vegtool.tiles.options import TileOptions

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "methods" / "tiles.md"
MARK = "<!-- {} made by benchmarks/tiles.py -->"
PARTS = ("whole", "merge", "scale", "single", "error", "rebaked")
SCALE = (10_000, 100_000, 1_000_000)
LARGE, LARGE_M = 39_000_000, 10_000.0
PROCESSES = 2


def say(text: str) -> None:
    print(text, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--cache", type=Path, default=Path("/tmp/vegtool-tiles"))
    parser.add_argument("--stations", default=",".join(s.name for s in STATIONS))
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--figures", type=Path)
    given = parser.parse_args()
    parts, cache = given.parts.split(","), given.cache
    unknown = set(parts) - set(PARTS)
    if unknown:
        parser.error(f"unknown parts: {', '.join(sorted(unknown))}; known: {', '.join(PARTS)}")
    plants = library(cache, say)
    found: dict[str, list[dict[str, Any]]] = {}

    def told(name: str, rows: list[dict[str, Any]]) -> None:
        found[name] = rows
        for row in rows:
            say("  ".join(f"{key} {value}" for key, value in row.items()))

    tiles = cache / f"tiles_{PLANTS}"
    whole = one = merged = None
    scale: list[Made] = []
    stations, rebaked = [], []
    if "whole" in parts or not (tiles / "tileset.json").exists():
        whole = command(cache, PLANTS, PROCESSES, keep=True)
        told("whole", tables.made_rows([whole]))
        told("levels", tables.level_rows(whole))
    if "merge" in parts:
        merged = alone(merging, cache, PLANTS)
        told("merge", tables.merged_rows(merged))
    if "single" in parts:
        one = alone(single, cache, LARGE, LARGE_M)
        told("single", tables.single_rows(one))
    if "scale" in parts:
        scale = [command(cache, count, PROCESSES) for count in SCALE]
        told("scale", tables.made_rows(scale))
    if "rebaked" in parts:
        options = TileOptions()
        rebaked = compared(world_of(Inputs(scene(cache, PLANTS), plants, tiles, options)))
        told("rebaked", tables.compared_rows(rebaked))
    if "error" in parts:
        wanted = [one for one in STATIONS if one.name in given.stations.split(",")]
        stations = seen(
            tiles, scene(cache, PLANTS), plants, SIDE_M, cache, cache / "pictures", wanted
        )
        told("error", tables.seen_rows(stations))
    if given.record:
        machine = {"version": __version__, "renderer": describe().renderer, "cores": os.cpu_count()}
        for name, rows in found.items():
            record(f"tiles_{name}", [{**machine, **row} for row in rows])
    if given.markdown:
        for name, rows in found.items():
            written(PAGE, MARK.format(name), tables.table(rows))
    if given.figures is not None:
        from landscape.figures import figures

        figures(given.figures, found, cache / "pictures")
    missed = tables.missed(whole, merged, scale, one, stations, rebaked)
    for sentence in missed:
        say(f"missed: {sentence}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
