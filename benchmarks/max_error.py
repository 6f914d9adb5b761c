"""Whether --max-error holds from views and under suns that were not used to choose distances.

    python benchmarks/max_error.py            # five of the plants in $VEGTOOL_MODELS
    python benchmarks/max_error.py oak.glb    # any others
    python benchmarks/max_error.py --record   # append the rows to results/max_error.csv

Levels are made and their distances chosen as `vegtool convert --max-error LIMIT` does (quick: six
views, each with a sun of its own). Each is then measured where it starts, and at half that size on
the screen if it is still used there, from 12 other directions under each of three other suns.
`over` is the mean FLIP of those 36 views less the limit: negative is within it, at most 0.02 is
what convert promises.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from recorded import record

from vegtool import __version__
from vegtool.convert import ConvertOptions, convert
from vegtool.errors import QualityError
from vegtool.formats import read_plant
from vegtool.lod import Display
from vegtool.measure.chain import HELD_OUT_MARGIN, with_distances
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import scores, truths
from vegtool.measure.views import View, direction, views
from vegtool.plant import Plant

PLANTS = (
    "eztree_ash_small", "eztree_pine_medium", "sapling_birch_lv2", "sapling_callistemon_bush",
    "arbaro_palm",
)  # fmt: skip
LIMITS = (0.1, 0.15, 0.2)
SUNS = ((40.0, 20.0), (160.0, 45.0), (280.0, 70.0))
"""Azimuth and elevation, degrees."""
OTHERS = tuple(
    View(view.direction, direction(*sun)) for view in views("all", 12, phase=0.3) for sun in SUNS
)


def rows_of(plant: Plant) -> Iterator[dict[str, Any]]:
    """A row per level and limit; one with empty figures where no level keeps to the limit."""
    display = Display()
    made = convert(plant, ConvertOptions(), MeasureOptions(measure="off")).levels[1:]
    for limit in LIMITS:
        row = {"version": __version__, "plant": plant.name, "limit": limit}
        try:
            levels, _ = with_distances(plant, made, MeasureOptions(max_error=limit), display)
        except QualityError:
            empty = ("billboards", "pixels", "chosen", "held_out", "other", "over")
            yield row | dict.fromkeys(empty)
            continue
        ends = [level.near_distance_m for level in levels[1:]] + [np.inf]
        for level, end in zip(levels, ends, strict=True):
            measured = level.measured
            assert measured is not None
            assert measured.held_out is not None
            assert level.billboards is not None
            for start in (level.near_distance_m, 2 * level.near_distance_m):
                if start > end:
                    continue
                pixels = plant.extent * display.pixels_per_metre(start)
                truth = truths(plant, OTHERS, [pixels], display)
                other = float(scores(truth, level).values["flip"].mean())
                here = start == level.near_distance_m
                yield row | {
                    "billboards": len(level.billboards),
                    "pixels": f"{pixels:.1f}",
                    "chosen": f"{measured.errors['flip'].mean:.4f}" if here else None,
                    "held_out": f"{measured.held_out.mean:.4f}" if here else None,
                    "other": f"{other:.4f}",
                    "over": f"{other - limit:.4f}",
                }


def standard() -> list[Path]:
    """The five plants' files."""
    beside = Path(__file__).resolve().parent.parent.parent / "shared" / "models"
    folder = Path(os.environ.get("VEGTOOL_MODELS") or beside)
    kinds = (".glb", ".obj")
    return [next(p for p in sorted((folder / n).iterdir()) if p.suffix in kinds) for n in PLANTS]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("plants", nargs="*", type=Path)
    parser.add_argument("--record", action="store_true")
    arguments = parser.parse_args()
    rows = []
    for path in arguments.plants or standard():
        for row in rows_of(read_plant(path)):
            print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
            rows.append(row)
    worst = max(float(row["over"]) for row in rows if row["over"])
    print(f"worst {worst:+.4f}; allowed {HELD_OUT_MARGIN:+.4f}")
    if arguments.record:
        record("max_error", rows)


if __name__ == "__main__":
    main()
