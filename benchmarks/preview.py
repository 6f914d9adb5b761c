"""A walk through landscapes: how fast, how much is shown, how far from the truth, how smooth.

    python benchmarks/preview.py                           # everything; hours, most of it the truth
    python benchmarks/preview.py meadow --parts speed      # one part of one landscape
    python benchmarks/preview.py --parts truth --stations 3
    python benchmarks/preview.py --record --markdown --figures docs

365,000 plants on 300 x 300 m, 390,000 on 1 x 1 km, and dense undergrowth (walk/scenes.py), 1024 x
768 pixels, 4x antialiasing, 4x anisotropy, at eye height along a trail, with plants in reach
(walk/path.py).

speed: frames per second, plants displayed, vertices and memory, at the rate that is asked for, at
15 frames per second, at detail 1, of two crossed billboards for every plant, and of all geometry.
truth: FLIP at ten stations. tradeoff: error against the time of a frame. transition: coverage and
change from frame to frame where one level becomes the next (walk/transition.py).

Converted plants, scenes and pictures of the truth are kept in --cache by version and options, so
that what was interrupted goes on; after a change to what makes or draws them, empty it. What is
missed of what is asked is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from recorded import record, written
from walk import asked, sheet, tables, tradeoff
from walk.path import STATIONS, VIEWS, evenly, views_of
from walk.scenes import OPAQUE, PLANTS, SETTINGS, TEXTURED, library, scene_of, world_of
from walk.speed import CROSSED, GEOMETRY, LEVELS, Walk, Walked, alone, walked
from walk.transition import PAIRS, Changes, changes
from walk.truth import Error, Sitting, errors

from vegtool import __version__
from vegtool.gl.context import describe

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "methods" / "preview.md"
MARK = "<!-- {} made by benchmarks/preview.py -->"
PARTS = ("speed", "transition", "truth", "tradeoff")
WITH_TEXTURES = ("broadleaf", "bush")
"""Plants whose transitions are told of as they are converted by default too."""
AIM = 15.0
"""Frames per second."""


def say(text: str) -> None:
    print(text, flush=True)


def speeds(scene: str, cache: Path, views: int, parts: Sequence[str]) -> list[Walked]:
    """Every way to draw a walk; where only the truth is asked for, those whose detail it needs."""
    walks = [Walk(scene, LEVELS, SETTINGS[scene].fps), Walk(scene, LEVELS, AIM)]
    if "speed" in parts:
        walks += [Walk(scene, drawn) for drawn in (LEVELS, CROSSED, GEOMETRY)]
    found = []
    for walk in walks:
        found.append(alone(walked, walk, cache, views))
        say(_line(tables.speed_rows(found[-1:])[0]))
    return found


def transitions(cache: Path, pairs: int) -> list[Changes]:
    """Of all plants, and of some with textures."""
    found = []
    for options, names in ((OPAQUE, PLANTS), (TEXTURED, WITH_TEXTURES)):
        folder = library(cache, names, options, say)
        kind = "opaque" if options is OPAQUE else "textured"
        for name in names:
            for change in changes(folder, kind, name, pairs):
                found.append(change)
                say(_line(tables.transition_rows([change])[0]))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(SETTINGS)}")
    parser.add_argument("--parts", default=",".join(PARTS), help="of them")
    parser.add_argument("--cache", type=Path, default=ROOT / "build" / "preview",
                        help="folder that keeps plants, scenes and pictures")  # fmt: skip
    parser.add_argument("--views", type=int, default=VIEWS, help="frames of a walk")
    parser.add_argument("--stations", type=int, default=STATIONS, help="compared with the truth")
    parser.add_argument("--pairs", type=int, default=PAIRS, help="of frames at each transition")
    parser.add_argument("--figures", type=Path, help="folder for preview_*.png and .jpg")
    parser.add_argument("--record", action="store_true", help="append to results/preview_*.csv")
    parser.add_argument("--markdown", action="store_true", help="rewrite the tables of the page")
    known = parser.parse_args()
    parts = [part for part in known.parts.split(",") if part]
    scenes = known.scenes or list(SETTINGS)
    if unknown := {*scenes, *parts} - {*SETTINGS, *PARTS}:
        parser.error(f"unknown: {', '.join(unknown)}")
    cache = known.cache.resolve()
    for scene in scenes:
        world_of(SETTINGS[scene], cache, say)
    with_truth = known.figures is not None or {"truth", "tradeoff"} & {*parts}
    drawn: list[Walked] = []
    if with_truth or "speed" in parts:
        for scene in scenes:
            drawn += speeds(scene, cache, known.views, parts)
    smooth = transitions(cache, known.pairs) if "transition" in parts else []
    seen: list[Error] = []
    bought: list[tradeoff.Point] = []
    strips: list[sheet.Strip] = []
    for scene in scenes if with_truth else ():
        setting = SETTINGS[scene]
        world, file = world_of(setting, cache, say), scene_of(setting, cache, say)
        views = views_of(setting, world, file.parent)
        stations = [(i, views[i]) for i in evenly(len(views), known.stations)]
        few = [stations[i] for i in evenly(len(stations), tradeoff.STATIONS)]
        held = {w.walk.name: w.detail for w in drawn if w.walk.scene == scene and w.walk.fps}
        whole = {Walk(scene, LEVELS).name: 1.0}
        with Sitting(scene, world, file, cache, say) as sitting:
            if "truth" in parts:
                for error in errors(sitting, stations, held | whole):
                    seen.append(error)
                    say(f"{scene}  view {error.station}  {error.drawn}  FLIP {error.flip:.4f}")
            if "tradeoff" in parts or known.figures is not None:
                for point in tradeoff.points(sitting, few):
                    bought.append(point)
                    say(_line(tables.tradeoff_rows([point])[0]))
            if known.figures is not None:
                detail = held[Walk(scene, LEVELS, setting.fps).name]
                strips += sheet.strips(sitting, few, detail)
    told = {
        "speed": tables.speed_rows(drawn) if "speed" in parts else [],
        "truth": tables.truth_rows(seen),
        "tradeoff": tables.tradeoff_rows(bought),
        "transition": tables.transition_rows(smooth),
    }
    shown = tables.sections(told | {"transition": tables.transition_summary(smooth)})
    text = "\n\n".join(shown.values())
    say(f"\n{text}\n\n{os.cpu_count()} cores, {describe().renderer}")
    if known.figures is not None:
        known.figures.mkdir(parents=True, exist_ok=True)
        (known.figures / "preview_tradeoff.png").write_bytes(tradeoff.plot(bought))
        few_strips = strips[1 :: tradeoff.STATIONS][:2]
        for name, shown_strips in (("sheet", strips), ("walk", few_strips)):
            picture = sheet.sheet(shown_strips)
            picture.save(known.figures / f"preview_{name}.jpg", quality=75, optimize=True)
    if known.record:
        about = {"version": __version__, "renderer": describe().renderer, "cores": os.cpu_count()}
        for part, rows in told.items():
            if rows:
                record(f"preview_{part}", [about | row for row in rows])
    if known.markdown:
        for part, section in shown.items():
            written(PAGE, MARK.format(part), section)
    missed = [*asked.missed_of_speed(drawn, describe().software)] if "speed" in parts else []
    missed += asked.missed_of_transition(smooth)
    print(f"\n{len(missed)} missed", *missed, sep="\n")
    return 1 if missed else 0


def _line(row: tables.Row) -> str:
    return "  ".join(str(value) for value in row.values())


if __name__ == "__main__":
    sys.exit(main())
