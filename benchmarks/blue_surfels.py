"""Progressive blue surfels: orders of points, how long they take, how even, and what they show.

    python benchmarks/blue_surfels.py                        # minutes
    python benchmarks/blue_surfels.py --parts orders --repeat 9
    python benchmarks/blue_surfels.py --record --markdown --figures docs

After Brandt, Jähn, Fischer and Meyer auf der Heide, "Rendering of complex heterogenous scenes using
progressive blue surfels" (2019), tables and figures of the same numbers, on models made by script
(solids/, samples).

candidates: of a tree, a statue and an airplane, and the share of what is seen that they miss.
orders: their table 2 and figure 3. 1.75 million candidates, as eight orthographic pictures show
them: milliseconds of drawing and of making arrays; an order at random, the paper's, ours and the
exact one, of 10,000, 50,000 and 100,000 points: milliseconds in one thread; and the distance from
each point of a prefix to the nearest other, of the largest possible. pictures: errors of prefixes
of 100 to 100,000 points of the three models beside those of other orders, with discs as asked and
with discs that cover as much as the original does; and their figure 4. plate: two sides a hair
apart, ours with normals and without: the largest hole on a side, and time. landscape: their table
3's, 30,000 trees of six kinds, whole, as surfels, as billboards and as both. It takes an hour and
more, most of it the truth, and is made where it is asked for by name; plants and pictures of
the truth are kept in --cache.

All times are of the processor. What is missed of what is asked is told at the end, and the exit
status is then 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from blue import landscape, orders, plate, prefixes, seen, tables
from blue.figures import errors, parts_of, sheet, violins
from recorded import markdown, record, written

from vegtool import __version__
from vegtool.gl.context import describe

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "methods" / "blue_surfels.md"
MARK = "<!-- {} made by benchmarks/blue_surfels.py -->"
PARTS = ("candidates", "orders", "pictures", "plate", "landscape")
LONG = ("landscape",)
"""Not made unless asked for."""
REPEATS = 7
"""Of what is timed, each with a seed of its own; medians are told."""


def say(text: str) -> None:
    print(text, flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", default=",".join(p for p in PARTS if p not in LONG))
    parser.add_argument("--repeat", type=int, default=REPEATS, help="seeds; medians are told")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--figures", type=Path)
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "blue")
    given = parser.parse_args()
    parts = given.parts.split(",")
    if set(parts) - set(PARTS):
        parser.error(f"unknown parts; known: {', '.join(PARTS)}")
    rows: dict[str, list[dict[str, Any]]] = {}
    shown: dict[str, list[dict[str, Any]]] = {}
    missed: list[str] = []

    def told(name: str, table: list[dict[str, Any]]) -> None:
        shown[name] = table
        say(f"{name}\n{markdown(table)}\n")

    if given.figures is not None:
        given.figures.mkdir(parents=True, exist_ok=True)
    if "candidates" in parts:
        rows["candidates"] = tables.seen_rows([seen.measured(name) for name in prefixes.MODELS])
        told("candidates", rows["candidates"])
    if "orders" in parts:
        ordered = orders.measured(given.repeat)
        many, side = len(ordered.pictured.found), ordered.pictured.resolution
        say(f"{many:,} candidates, of pictures of {side} pixels a side")
        say(f"compiled or loaded in {ordered.compiling_s:.1f} s, not counted\n")
        rows["orders"] = tables.order_rows(ordered)
        rows["distances"] = tables.distance_rows(ordered)
        told("orders", tables.order_table(ordered))
        told("distances", tables.distance_table(ordered))
        missed += tables.missed(ordered)
        if given.figures is not None:
            violins(given.figures / "blue_violins.png", ordered)
    if "pictures" in parts:
        found = {name: prefixes.measured(name) for name in prefixes.MODELS}
        scores = [one for those, _ in found.values() for one in those]
        rows["pictures"] = tables.picture_rows(scores)
        told("pictures", tables.picture_table(scores))
        told("equal", tables.equal_table(scores))
        if given.figures is not None:
            errors(given.figures / "blue_pictures.png", scores)
            pictures = {name: found[name][1] for name in prefixes.SHOWN}
            sheet(given.figures / "blue_prefixes.jpg", pictures)
    if "plate" in parts:
        sides = plate.measured(given.repeat)
        rows["plate"] = tables.plate_rows(sides)
        told("plate", tables.plate_table(sides))
    if "landscape" in parts:
        views, shown_of = landscape.measured(given.cache, say)
        rows["landscape"] = tables.landscape_rows(views)
        told("landscape", tables.landscape_table(views))
        missed += tables.landscape_missed(views)
        if given.figures is not None:
            parts_of(given.figures / "blue_landscape.jpg", shown_of)
    if given.record:
        machine = {"version": __version__, "renderer": describe().renderer, "cores": os.cpu_count()}
        for name, some in rows.items():
            record(f"blue_{name}", [{**machine, **row} for row in some])
    if given.markdown:
        for name, some in shown.items():
            written(PAGE, MARK.format(name), markdown(some))
    for sentence in missed:
        say(f"missed: {sentence}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
