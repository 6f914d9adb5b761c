"""Hybrids beside pure clouds and pure meshes: what they cost, and how far they are from the truth.

    python benchmarks/hybrid.py                                    # twenty minutes
    python benchmarks/hybrid.py --plants ash=models/ash.glb        # another plant beside them
    python benchmarks/hybrid.py --record --markdown --figures docs

After "Hybrid Billboard Clouds" (sketch), figure 1, and its poster, figures 1 and 2, on like models:
a cherry of `vegtool sample`, and a cartoon figure and an airplane made by script (solids/).

beside: of each model a cloud of planes, a mesh reduced to so many triangles, and a hybrid that has
no more triangles than the mesh and makes no more fragments than the cloud. dial: the figure with
four weights of polygons, from nearly a mesh to nearly a cloud. steps: a hybrid's cost from step to
step, of both ways to look for proposals, with the seconds that they take. near: of models of which
alpha cuts nothing out, the first levels of `vegtool convert` as refined ones and as hybrids, and
whether convert looks at hybrids unasked.

What is missed of what is asked is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from recorded import markdown, record, written
from solids.airplane import airplane
from solids.figure import figure

from vegtool import __version__
from vegtool.baselines.quadric import quadric
from vegtool.convert import (
    LEVEL_RATIO,
    TRIANGLES_PER_BILLBOARD,
    ConvertOptions,
    billboard_counts,
    near_pixels,
)
from vegtool.formats import read_plant
from vegtool.formats.png import encode
from vegtool.gl.context import describe
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.hybrid.cloud import cloud_of
from vegtool.hybrid.greedy import Descent, descent
from vegtool.hybrid.level import drawn_as, hybrid_level
from vegtool.hybrid.options import Budget, Weights
from vegtool.hybrid.or_refined import mesh_holds
from vegtool.hybrid.start import begun
from vegtool.lod import Display, Level
from vegtool.measure.background import bytes_over
from vegtool.measure.chain import views_of
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, fragments, live, truth
from vegtool.measure.scores import TruthsAt, scores
from vegtool.meshes.pieces import all_welded, pieces
from vegtool.plant import Plant
from vegtool.refine.level import Source, Wanted, refined_level, source_of

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "methods" / "hybrid.md"
MARK = "<!-- {} made by benchmarks/hybrid.py -->"
PARTS = ("beside", "dial", "steps", "near")
DIAL = (0.03, 0.3, 3.0, 30.0)
"""Weights of polygons."""
SOLID = ("statue", "height-field", "dead-tree", "grass-clump", "palm")
"""Samples of which alpha cuts nothing out."""
NEAR = ("what", "triangles", "billboards", "texels", "fragments", "flip", "seconds")
STEPS = 7
"""Of a descent, that are drawn."""
SECONDS = 30.0
"""Asked of the cherry, the cloud included."""


@dataclass(frozen=True)
class Case:
    """planes: of the cloud. triangles: of the mesh, and at most of the hybrid. pixels: of the
    model's longest side."""

    name: str
    planes: int
    triangles: int
    pixels: float


CASES = (
    Case("cherry", 140, 1840, 300.0),
    Case("figure", 19, 250, 300.0),
    Case("airplane", 93, 300, 300.0),
)
"""As the sketch and its poster have them: 140 billboards and 1,840 polygons, 19 and 250."""


@dataclass(frozen=True, eq=False)
class Bench:
    """A model, and what it looks like."""

    plant: Plant
    source: Source
    truth_at: TruthsAt
    near_m: float

    def level(self, found: Descent) -> Level:
        return drawn_as(self.source, Wanted(0, self.near_m), found)

    def row(self, case: str, what: str, level: Level, seconds: float) -> dict[str, Any]:
        true = self.truth_at(self.near_m)
        found = scores(true, level).values
        cameras = [camera for row in true.cameras for camera in row]
        with PlantBuffers(client_plant(level)) as buffers:
            shaded = float(np.mean([fragments(buffers, camera) for camera in cameras]))
        return {
            "model": case,
            "of": len(self.plant.faces),
            "what": what,
            "triangles": level.triangles,
            "billboards": 0 if level.billboards is None else len(level.billboards),
            "texels": level.texels,
            "fragments": round(shaded),
            "flip": round(float(found["flip"].mean()), 4),
            "silhouette": round(float(found["silhouette"].mean()), 4),
            "false_holes": round(float(found["false_holes"].mean()), 4),
            "seconds": round(seconds, 1),
        }

    def pictures(self, levels: Sequence[Level], view: int = 0) -> np.ndarray:
        """The truth and the levels, side by side."""
        true = self.truth_at(self.near_m)
        camera, light = true.cameras[0][view], true.light(true.views[view])
        with PlantBuffers(self.plant) as buffers:
            found = [bytes_over(truth(buffers, camera, light))]
        for level in levels:
            with PlantBuffers(client_plant(level), mipmaps=True) as buffers:
                found.append(bytes_over(live(buffers, camera, light)))
        return np.concatenate(found, axis=1)


@contextmanager
def bench(plant: Plant, pixels: float) -> Iterator[Bench]:
    display = Display()
    with PlantBuffers(plant) as buffers:
        truth_at = TruthsAt(plant, views_of(MeasureOptions(views="all")), display, buffers)
        near_m = display.distance_m(pixels / plant.extent)
        yield Bench(plant, source_of(buffers, truth_at), truth_at, near_m)


def uncut(plant: Plant) -> bool:
    return all(material.alpha_mode != "mask" for material in plant.materials)


def say(text: str) -> None:
    print(text, flush=True)


def told(row: dict[str, Any]) -> dict[str, Any]:
    say("  ".join(f"{key} {value}" for key, value in row.items()))
    return row


def beside(case: Case, plant: Plant, missed: list[str]) -> tuple[list[dict[str, Any]], np.ndarray]:
    with bench(plant, case.pixels) as on:
        began = perf_counter()
        start = begun(cloud_of(plant, case.planes), Weights())
        cloud = on.level(start)
        rows = [told(on.row(case.name, "cloud", cloud, perf_counter() - began))]
        began = perf_counter()
        mesh = quadric(plant, case.triangles)
        rows.append(told(on.row(case.name, "mesh", mesh, perf_counter() - began)))
        began = perf_counter()
        budget = Budget(mesh.triangles, start.terms.fill)
        hybrid = hybrid_level(on.source, Wanted(mesh.triangles, on.near_m), budget)
        rows.append(told(on.row(case.name, "hybrid", hybrid, perf_counter() - began)))
        of_cloud, of_mesh, of_hybrid = rows
        for key, other in (("triangles", of_mesh), ("fragments", of_cloud), ("texels", of_cloud)):
            if of_hybrid[key] > other[key]:
                missed.append(f"{case.name}: {key} {of_hybrid[key]} of {other[key]}")
        for key in ("flip", "silhouette"):
            least = min(of_cloud[key], of_mesh[key])
            if not of_hybrid[key] < least:
                missed.append(f"{case.name}: {key} {of_hybrid[key]} of {least}")
        return rows, on.pictures((cloud, mesh, hybrid))


def dial(plant: Plant) -> tuple[list[dict[str, Any]], np.ndarray]:
    with bench(plant, CASES[1].pixels) as on:
        start = begun(cloud_of(plant, 69), Weights())
        rows, levels = [], []
        for weight in DIAL:
            began = perf_counter()
            now = start.again(Weights(1.0, weight, 0.1))
            for _ in descent(now):
                pass
            levels.append(on.level(now))
            row = on.row("figure", f"polygons={weight:g}", levels[-1], perf_counter() - began)
            rows.append(told(row))
        return rows, on.pictures(levels)


def steps(plant: Plant, missed: list[str]) -> list[dict[str, Any]]:
    """Of the cherry, at some of the steps; seconds are without drawing them."""
    rows = []
    with bench(plant, CASES[0].pixels) as on:
        began = perf_counter()
        start = begun(cloud_of(plant, CASES[0].planes), Weights(1.0, 0.2, 0.1))
        cloud_s = perf_counter() - began
        for proposals, cheap in (("all", False), ("costliest", True)):
            now = start.again(start.weights)
            now.known = {}  # what was reduced for the other form
            taken, hybrids = [], []
            for step in descent(now, cheap):
                taken.append(step)
                hybrids.append(now.copy())
            costs = [step.cost for step in taken]
            if (np.diff(costs) > 0).any():
                missed.append(f"steps, {proposals}: the cost rises")
            if cloud_s + taken[-1].seconds > SECONDS:
                took = cloud_s + taken[-1].seconds
                missed.append(f"steps, {proposals}: {took:.0f} s of {SECONDS:g}")
            some = np.unique(np.linspace(0, len(taken) - 1, STEPS).round().astype(int))
            for number in some.tolist():
                step, level = taken[number], on.level(hybrids[number])
                errs = scores(on.truth_at(on.near_m), level).values["flip"]
                row = {
                    "proposals": proposals,
                    "step": number,
                    "billboards": step.billboards,
                    "triangles": step.triangles,
                    "error": round(step.terms.error, 4),
                    "polygons": round(step.terms.polygons, 4),
                    "fill": round(step.terms.fill, 3),
                    "cost": round(step.cost, 4),
                    "flip": round(float(errs.mean()), 4),
                    "seconds": round(cloud_s + step.seconds, 2),
                }
                rows.append(told(row))
    return rows


def near(models: Sequence[Plant]) -> list[dict[str, Any]]:
    """The first two levels of each."""
    rows = []
    options = ConvertOptions()
    for plant in models:
        counts = billboard_counts(plant, options)[:2]
        count, _ = pieces(all_welded(plant).faces)
        with bench(plant, near_pixels(counts[0])) as on:
            for nth, planes in enumerate(counts):
                at = replace(on, near_m=on.near_m * LEVEL_RATIO**nth)
                wanted = Wanted(TRIANGLES_PER_BILLBOARD * planes, at.near_m)
                for what in ("refined", "hybrid"):
                    began = perf_counter()
                    if what == "hybrid":
                        level = hybrid_level(on.source, wanted, Budget(wanted.triangles))
                    else:
                        level = refined_level(on.source, wanted)
                    row = at.row(plant.name, what, level, perf_counter() - began)
                    unasked = "yes" if mesh_holds(plant, wanted.triangles) else "no"
                    told_of = {"pieces": count, "for": wanted.triangles, "unasked": unasked}
                    kept = {key: row[key] for key in NEAR}
                    rows.append(told({"model": plant.name, **told_of, **kept}))
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--plants", nargs="*", default=[], metavar="NAME=FILE")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--figures", type=Path)
    given = parser.parse_args()
    parts = given.parts.split(",")
    if set(parts) - set(PARTS):
        parser.error(f"unknown parts; known: {', '.join(PARTS)}")
    models = {"cherry": sample("cherry"), "figure": figure(), "airplane": airplane()}
    cases = list(CASES)
    for word in given.plants:
        name, _, file = word.partition("=")
        models[name] = replace(read_plant(Path(file)), name=name)
        if not uncut(models[name]):
            cases.append(Case(name, 140, 1840, 300.0))
    missed: list[str] = []
    found: dict[str, list[dict[str, Any]]] = {}
    pictures: dict[str, np.ndarray] = {}
    if "beside" in parts:
        found["beside"] = []
        for case in cases:
            rows, pictures[f"hybrid_{case.name}"] = beside(case, models[case.name], missed)
            found["beside"] += rows
    if "dial" in parts:
        found["dial"], pictures["gallery/hybrid_dial"] = dial(models["figure"])
    if "steps" in parts:
        found["steps"] = steps(models["cherry"], missed)
    if "near" in parts:
        solid = [sample(name) for name in SOLID]
        asked = [plant for name, plant in models.items() if name not in {c.name for c in CASES}]
        found["near"] = near([*solid, *(plant for plant in asked if uncut(plant))])
    if given.record:
        machine = {"version": __version__, "renderer": describe().renderer, "cores": os.cpu_count()}
        for name, rows in found.items():
            record(f"hybrid_{name}", [{**machine, **row} for row in rows])
    if given.markdown:
        for name, rows in found.items():
            written(PAGE, MARK.format(name), markdown(rows))
    if given.figures is not None:
        for name, pixels in pictures.items():
            file = given.figures / f"{name}.png"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(encode(pixels))
    for sentence in missed:
        say(f"missed: {sentence}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
