"""Surfel billboards: what a hierarchy holds, draws and errs, and how long it takes.

    python benchmarks/surfel_billboards.py                         # half an hour
    python benchmarks/surfel_billboards.py --parts table --models rabbit,tree
    python benchmarks/surfel_billboards.py --record --markdown --figures docs

After Holst and Schumann, "Surfel-based billboard hierarchies for fast rendering of 3D-objects"
(2007), tables and figures of the same numbers, on models of the same kinds and sizes made by script
(solids/).

table: their table 1, with how far what is drawn is displaced over 200 views, at distances from
where billboards begin to sixty sides of the model; primitives drawn at five distances; and errors
of the picture. counts: their figure 8, triangles and billboards over distance. selection: processor
time of choosing for 1,000 instances. depth: their figure 6, by how many neighbours are looked at
(k) and how far down boxes reach (l). linear: seconds over triangles.

What is missed of what is asked is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from recorded import markdown, record, written
from scipy.spatial import cKDTree
from solids import TABLE_1
from solids.armadillo import armadillo
from solids.rabbit import rabbit

from vegtool import __version__
from vegtool.arrays import FloatArray
from vegtool.formats.png import encode
from vegtool.gl.context import describe
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import frame_of, instances, let_through, taken
from vegtool.gl.surfel_data import TEXEL_BYTES
from vegtool.gl.surfel_read import surfels_seen
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.background import bytes_over
from vegtool.measure.metrics import reference, score
from vegtool.measure.pictures import truth
from vegtool.measure.views import around, views
from vegtool.meshes.distance import to_triangles
from vegtool.plant import Plant
from vegtool.surfels.base import base_of
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.hierarchy import whole
from vegtool.surfels.make import surfel_model
from vegtool.surfels.merging import merged
from vegtool.surfels.model import SurfelModel
from vegtool.surfels.multi_triangulation import multi_triangulation
from vegtool.surfels.options import MEGABYTE, SurfelOptions
from vegtool.surfels.pictures import framed, pictured

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "methods" / "surfel_billboards.md"
MARK = "<!-- {} made by benchmarks/surfel_billboards.py -->"
PARTS = ("table", "counts", "selection", "depth", "linear")
ASKED = {
    "airplane": (2_168, 8.6), "height field": (5_946, 15.0), "rabbit": (11_017, 20.0),
    "armadillo": (17_494, 24.0), "tree": (11_785, 25.0),
}  # fmt: skip
"""Billboards, and megabytes of textures, of table 1."""
KEPT = 0.95
"""Of the pixels that billboards draw, that are displaced by epsilon at most."""
BUILD_S, HIERARCHY_S = 40.0, 20.0
"""For 100,000 triangles, of which for the hierarchy."""
CHOICE_MS = 2.0
"""Of processor time for INSTANCES, median."""
VIEWS, POINTS = 200, 1_000
"""Of displacements: views, and pixels looked at of each."""
BEGIN, END = 2.0, 60.0
"""Mean sides of the model: distances of these views."""
SIDES = (1.0, 3.0, 10.0, 30.0, 100.0)
"""Mean sides of the model: distances at which primitives are counted, from its middle."""
SIZES = (200.0, 100.0, 50.0)
"""Pixels of the longest side, at which pictures are compared."""
PICTURES = 6
NEAREST = 16
"""Triangles, by their middles, of which one is the nearest."""
INSTANCES, FRAMES = 1_000, 200
NEIGHBOURS, STEPS = (2, 4, 8, 16), (1, 3, 5, 8)
LINEAR = (6_000, 12_000, 25_000, 50_000, 100_000, 200_000)
TWO_MODELS = ("armadillo", "tree")


@dataclass(frozen=True, eq=False)
class Bench:
    """A model as it is drawn."""

    model: SurfelModel
    buffers: SurfelBuffers

    @property
    def pc(self) -> float:
        return self.model.display.pixels_per_metre(1.0)

    @property
    def pixels(self) -> float:
        """pc / epsilon."""
        return self.pc / self.model.options.epsilon

    @property
    def side(self) -> float:
        """Metres: mean of the bounds' sides."""
        return side_of(self.model.plant)

    def eye(self, direction: FloatArray, sides: float) -> FloatArray:
        """So many sides from the middle of the model."""
        return np.asarray(self.model.plant.center + sides * self.side * direction)

    def drawn(self, eye: FloatArray) -> tuple[int, int]:
        """Triangles and billboards."""
        data, plant = self.buffers.data, self.model.plant
        found = taken(data, (eye - plant.center) / plant.radius, self.pixels)
        triangles = sum(
            int(np.diff(one.first)[let_through(one.arcs, found)].sum()) for one in data.patches
        )
        return triangles, int(let_through(data.billboards, found).sum())

    def displaced(self, rng: np.random.Generator) -> FloatArray:
        """(n,) pixels, of points that billboards draw: from where they are drawn to the surface in
        their texture, and from there to the original, of which that is a bound."""
        plant, moved, points, scale = self.model.plant, [], [], []
        for _ in range(VIEWS):
            direction = rng.normal(size=3)
            direction /= np.linalg.norm(direction)
            sides = BEGIN * (END / BEGIN) ** rng.random()
            camera = around(plant.positions, direction, sides * self.side, self.model.display)
            found = surfels_seen(self.buffers, *framed(self.buffers.data, self.model, camera))
            at = np.argwhere(found.billboard >= 0)
            at = at[rng.permutation(len(at))[:POINTS]]
            if not len(at):
                continue
            plane, surface = (
                some[at[:, 0], at[:, 1]].astype(float) + plant.center
                for some in (found.plane, found.surface)
            )
            moved.append(np.linalg.norm(camera.pixels(plane) - camera.pixels(surface), axis=1))
            points.append(surface)
            scale.append(self.pc / np.linalg.norm(surface - camera.eye, axis=1))
        off = off_surface(np.concatenate(points), plant)
        return np.asarray(np.concatenate(moved) + off * np.concatenate(scale))

    def errors(self, metric: str = "flip") -> list[float]:
        """Mean of a metric at each of SIZES."""
        plant, found = self.model.plant, []
        with PlantBuffers(plant) as original:
            for pixels in SIZES:
                away = self.model.display.distance_m(pixels / plant.extent)
                errs = []
                for view in views("all", PICTURES):
                    camera = around(plant.positions, view.direction, away, self.model.display)
                    light = Light(view.sun)
                    true = reference(truth(original, camera, light))
                    errs.append(
                        score(true, pictured(self.buffers, self.model, camera, light))[metric]
                    )
                found.append(float(np.mean(errs)))
        return found


def off_surface(points: FloatArray, plant: Plant) -> FloatArray:
    """(n,) metres from points (n, 3) to a plant, of the NEAREST triangles; never too small."""
    _, near = cKDTree(plant.face_centroids).query(points, NEAREST)
    found = [to_triangles(points, plant.corners[triangles]) for triangles in near.T]
    return np.asarray(np.min(found, axis=0))


def side_of(plant: Plant) -> float:
    return float(np.diff(plant.bounds, axis=0).mean())


@contextmanager
def bench(plant: Plant, options: SurfelOptions | None = None, **how: int) -> Iterator[Bench]:
    model = surfel_model(plant, options, **how)
    with SurfelBuffers(drawn_data(model)) as buffers:
        yield Bench(model, buffers)


def say(text: str) -> None:
    print(text, flush=True)


def told(row: dict[str, Any]) -> dict[str, Any]:
    say("  ".join(f"{key} {value}" for key, value in row.items()))
    return row


def built(model: SurfelModel) -> dict[str, float]:
    """Seconds: all of it, and of the hierarchy, its textures included."""
    return {
        "seconds": round(sum(model.seconds.values()), 1),
        "of_hierarchy": round(sum(model.seconds.values()) - model.seconds["triangles"], 1),
    }


def table(names: Sequence[str], missed: list[str]) -> list[dict[str, Any]]:
    rows = []
    for name in names:
        triangles, make = TABLE_1[name]
        billboards, megabytes = ASKED[name]
        with bench(make()) as on:
            one = on.model.hierarchy
            taken_mb = TEXEL_BYTES * on.model.textures.atlas.texels / MEGABYTE
            moved = on.displaced(np.random.default_rng(0))
            kept = float((moved <= on.model.options.epsilon).mean())
            row = {
                "model": name,
                "triangles": triangles,
                "billboards": len(one),
                "theirs": billboards,
                "megabytes": round(taken_mb, 1),
                "theirs_mb": megabytes,
                "within_epsilon": round(kept, 4),
                "displaced_p95": round(float(np.quantile(moved, 0.95)), 2),
                **built(on.model),
            }
            directions = [view.direction for view in views("all", PICTURES)]
            for sides in SIDES:
                counts = [on.drawn(on.eye(direction, sides)) for direction in directions]
                mean = np.mean(counts, axis=0).round().astype(int)
                row[f"at_{sides:g}"] = f"{mean[0]:,} + {mean[1]:,}"
            for pixels, error in zip(SIZES, on.errors(), strict=True):
                row[f"flip_{pixels:g}"] = round(error, 4)
            for pixels, error in zip(SIZES, on.errors("false_holes"), strict=True):
                row[f"holes_{pixels:g}"] = round(error, 4)
        rows.append(told(row))
        for what, found, asked in (
            ("billboards", len(one), billboards), ("megabytes", taken_mb, megabytes),
        ):  # fmt: skip
            if found > asked:
                missed.append(f"{name}: {found:,.4g} {what} of {asked:,}")
        if kept < KEPT:
            missed.append(f"{name}: {kept:.3f} of all pixels within epsilon of {KEPT}")
        hundred = 100_000 / triangles
        for key, limit in (("seconds", BUILD_S), ("of_hierarchy", HIERARCHY_S)):
            if triangles >= 100_000 and row[key] * hundred > limit:
                missed.append(f"{name}: {key} {row[key] * hundred:.0f} for 100,000 of {limit:g}")
    return rows


def counts(names: Sequence[str], missed: list[str]) -> list[dict[str, Any]]:
    """Triangles and billboards over distance, the mean over twelve directions."""
    rows = []
    for name in names:
        with bench(TABLE_1[name][1]()) as on:
            directions = np.array([view.direction for view in views("all", 12)])
            away = np.geomspace(0.9, 300.0, 60)
            found = np.array([[on.drawn(on.eye(d, s)) for s in away] for d in directions])
        for each in found:
            without = np.flatnonzero(each[:, 0] == 0)
            if not len(without):
                missed.append(f"{name}: triangles never come to an end")
            elif (np.diff(each[without[0] :], axis=0) > 0).any():
                missed.append(f"{name}: counts rise again beyond the last triangle")
        mean = found.mean(axis=0)
        rows += [
            {
                "model": name, "sides": round(float(s), 3), "triangles": round(float(t), 1),
                "billboards": round(float(b), 1),
            }
            for s, (t, b) in zip(away, mean, strict=True)
        ]  # fmt: skip
        say(f"{name}: most billboards {mean[:, 1].max():.0f}, no triangles from "
            f"{away[np.argmax(mean[:, 0] == 0)]:.3g} sides on")  # fmt: skip
    return rows


def selection(names: Sequence[str], missed: list[str]) -> list[dict[str, Any]]:
    """Processor time of what is chosen for instances that stand in a field about the eye."""
    rows, rng = [], np.random.default_rng(0)
    for name in names:
        data = drawn_data(surfel_model(TABLE_1[name][1]()))
        side, pc = side_of(data.plant), Display().pixels_per_metre(1.0)
        took, calls = [], []
        for _ in range(FRAMES):
            foot = rng.uniform(-1, 1, (INSTANCES, 3)) * [50 * side, 0, 50 * side]
            turn, scale = rng.uniform(0, 6.3, INSTANCES), rng.uniform(0.7, 1.3, INSTANCES)
            eye = np.array([0.0, rng.uniform(0.5, 20) * side, 0.0])
            began = process_time()
            found = frame_of(data, instances(data, eye, foot, turn, scale), pc)
            took.append(process_time() - began)
            calls.append(len(found.billboards) + sum(len(runs) for runs in found.patches))
        low, median, high = (1000 * np.quantile(took, q) for q in (0.1, 0.5, 0.9))
        row = {
            "model": name, "instances": INSTANCES, "ms": round(median, 3), "p10": round(low, 3),
            "p90": round(high, 3), "calls": round(float(np.mean(calls)), 1),
        }  # fmt: skip
        rows.append(told(row))
        if median > CHOICE_MS:
            missed.append(f"{name}: choosing takes {median:.2f} ms of {CHOICE_MS:g}")
    return rows


def depth(name: str) -> list[dict[str, Any]]:
    """By k and l, the mean half depth of all billboards before any goes, as a share of the model's
    radius; and what is left of it."""
    rows, plant = [], TABLE_1[name][1]()
    base = base_of(multi_triangulation(plant))
    local = (base.corners - plant.center) / plant.radius
    for neighbours in NEIGHBOURS:
        for steps in STEPS:
            began = process_time()
            children = merged(local, base.first, neighbours, steps)
            took = process_time() - began
            deep = whole(base, children, SurfelOptions().theta).boxes.half[:, 2].mean()
            with bench(plant, neighbours=neighbours, depth=steps) as on:
                errs = on.errors()
                row = {
                    "k": neighbours, "l": steps, "seconds": round(took, 2),
                    "mean_depth": round(float(deep / plant.radius), 5),
                    "billboards": len(on.model.hierarchy),
                    "megabytes": round(
                        TEXEL_BYTES * on.model.textures.atlas.texels / MEGABYTE, 2
                    ),
                    "drawn_at_10": round(float(np.mean([
                        on.drawn(on.eye(view.direction, 10.0))[1] for view in views("all", 6)
                    ]))),
                    **{f"flip_{size:g}": round(e, 4) for size, e in zip(SIZES, errs, strict=True)},
                }  # fmt: skip
            rows.append(told(row))
    return rows


def linear(missed: list[str]) -> list[dict[str, Any]]:
    rows = []
    for name, make in (("rabbit", rabbit), ("armadillo", armadillo)):
        took = []
        for count in LINEAR:
            plant = make(count)
            began = process_time()
            model = surfel_model(plant)
            took.append(process_time() - began)
            row = {
                "model": name, "triangles": len(plant.faces), "cpu_seconds": round(took[-1], 2),
                **{f"{stage}_s": round(s, 2) for stage, s in model.seconds.items()},
            }  # fmt: skip
            rows.append(told(row))
        power = np.polyfit(np.log(LINEAR[-3:]), np.log(took[-3:]), 1)[0]
        say(f"{name}: seconds rise as triangles to the {power:.2f}")
        if power > 1.25:
            missed.append(f"{name}: seconds rise as triangles to the {power:.2f}")
    return rows


def figures(found: dict[str, list[dict[str, Any]]], folder: Path) -> None:
    """Plots of counts, and of seconds."""
    from matplotlib.figure import Figure

    if "counts" in found:
        names = list(dict.fromkeys(row["model"] for row in found["counts"]))
        whole_figure = Figure(figsize=(9, 3.4), layout="constrained")
        panels = whole_figure.subplots(1, len(names), squeeze=False)[0]
        for name, axes in zip(names, panels, strict=True):
            rows = [row for row in found["counts"] if row["model"] == name]
            sides = [row["sides"] for row in rows]
            for key, color in (("triangles", "#e69f00"), ("billboards", "#0072b2")):
                axes.plot(sides, [row[key] for row in rows], color=color, label=key)
            axes.set(title=name, xscale="log", yscale="symlog", xlabel="distance, mean sides")
            axes.set_ylabel("drawn")
            axes.set_ylim(0)
            axes.legend(frameon=False)
            axes.spines[["top", "right"]].set_visible(False)
        whole_figure.savefig(folder / "surfel_counts.png", dpi=110)
    if "linear" in found:
        whole_figure = Figure(figsize=(5, 3.4), layout="constrained")
        axes = whole_figure.subplots()
        for name in dict.fromkeys(row["model"] for row in found["linear"]):
            rows = [row for row in found["linear"] if row["model"] == name]
            x, y = ([row[key] for row in rows] for key in ("triangles", "cpu_seconds"))
            axes.plot(x, y, "o-", label=name)
        axes.set(xlabel="triangles", ylabel="seconds of processor time", xlim=(0, None), ylim=0)
        axes.legend(frameon=False)
        axes.spines[["top", "right"]].set_visible(False)
        whole_figure.savefig(folder / "surfel_linear.png", dpi=110)


def pictures(name: str, folder: Path) -> None:
    """The truth, and what is drawn, at three sizes."""
    plant = TABLE_1[name][1]()
    with bench(plant) as on, PlantBuffers(plant) as original:
        view, columns = views("all", PICTURES)[2], []
        for pixels in (400.0, 150.0, 50.0):
            away = on.model.display.distance_m(pixels / plant.extent)
            camera = around(plant.positions, view.direction, away, on.model.display)
            light, pair = Light(view.sun), []
            for each in (
                truth(original, camera, light),
                pictured(on.buffers, on.model, camera, light),
            ):
                times = max(int(400 / pixels), 1)
                pair.append(np.kron(bytes_over(each), np.ones((times, times, 1), np.uint8)))
            columns.append(np.concatenate(pair, axis=0))
        high = max(len(each) for each in columns)
        padded = [np.pad(c, ((0, high - len(c)), (0, 8), (0, 0)), mode="edge") for c in columns]
        (folder / f"surfel_{name}.png").write_bytes(encode(np.concatenate(padded, axis=1)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--models", default=",".join(ASKED), help="of the table")
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--figures", type=Path)
    given = parser.parse_args()
    parts = given.parts.split(",")
    if set(parts) - set(PARTS):
        parser.error(f"unknown parts; known: {', '.join(PARTS)}")
    missed: list[str] = []
    found: dict[str, list[dict[str, Any]]] = {}
    if "table" in parts:
        found["table"] = table(given.models.split(","), missed)
    if "counts" in parts:
        found["counts"] = counts(TWO_MODELS, missed)
    if "selection" in parts:
        found["selection"] = selection(("rabbit", "tree"), missed)
    if "depth" in parts:
        found["depth"] = depth("rabbit")
    if "linear" in parts:
        found["linear"] = linear(missed)
    if given.record:
        machine = {"version": __version__, "renderer": describe().renderer, "cores": os.cpu_count()}
        for name, rows in found.items():
            record(f"surfel_{name}", [{**machine, **row} for row in rows])
    if given.markdown:
        for name, rows in found.items():
            if name != "counts":
                written(PAGE, MARK.format(name), markdown(rows))
    if given.figures is not None:
        figures(found, given.figures)
        if "table" in parts:
            for name in ("rabbit", "tree"):
                pictures(name, given.figures)
    for sentence in missed:
        say(f"missed: {sentence}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
