"""What scenes do not need: bytes that are left out, and whether anybody can tell.

    python benchmarks/scenes.py                       # all four; an hour
    python benchmarks/scenes.py road backdrop
    python benchmarks/scenes.py --record --markdown

Four scenes (needed/places.py), each converted and made into tiles twice, for the scene and without
it, with the same options and light. From 50 random eyes inside each description, every plant in
sight drawn with one library beside the other (needed/lost.py).

What is missed of what is asked is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import numpy as np
from needed.lost import Lost, measured
from needed.places import PLACES
from recorded import markdown, record, written

from vegtool import __version__
from vegtool.gl.context import describe

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "methods" / "needs.md"
MARK = "<!-- {} made by benchmarks/scenes.py -->"
WORST, MEDIAN = 0.02, 0.005
"""FLIP of a plant in sight, at most."""


def say(text: str) -> None:
    print(text, flush=True)


def missed(one: Lost) -> list[str]:
    said = []
    if one.share > one.asked:
        said.append(f"{one.name}: {one.share:.0%} of the bytes, not {one.asked:.0%}")
    if max(one.flips) > WORST:
        said.append(f"{one.name}: a plant differs by {max(one.flips):.3f}, not {WORST}")
    if np.median(one.flips) > MEDIAN:
        said.append(f"{one.name}: plants differ by {np.median(one.flips):.4f}, not {MEDIAN}")
    return said


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("places", nargs="*", default=list(PLACES))
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "scenes")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    given = parser.parse_args()
    if set(given.places) - set(PLACES):
        parser.error(f"unknown scenes; known: {', '.join(PLACES)}")
    found = [measured(PLACES[name], given.cache, say) for name in given.places]
    rows = [
        {
            "scene": one.name,
            "library_mb": round(one.library[0] / 1e6, 2),
            "for_it_mb": round(one.library[1] / 1e6, 2),
            "tiles_mb": round(one.tiles[0] / 1e6, 2),
            "tiles_for_it_mb": round(one.tiles[1] / 1e6, 2),
            "share": f"{one.share:.1%}",
            "asked": f"{one.asked:.0%}",
            "cpu_s": round(one.cpu_s[0]),
            "for_it_cpu_s": round(one.cpu_s[1]),
            "plants": len(one.flips),
            "median_flip": round(float(np.median(one.flips)), 4),
            "worst_flip": round(max(one.flips), 4),
        }
        for one in found
    ]
    say(markdown(rows))
    if given.record:
        machine = {"version": __version__, "renderer": describe().renderer, "cores": os.cpu_count()}
        record("scenes", [{**machine, **row} for row in rows])
    if given.markdown:
        written(PAGE, MARK.format("scenes"), markdown(rows))
    said = [sentence for one in found for sentence in missed(one)]
    for sentence in said:
        say(f"missed: {sentence}")
    return 1 if said else 0


if __name__ == "__main__":
    sys.exit(main())
