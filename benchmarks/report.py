"""Error against the time it takes: every method and budget beside the baselines.

    python benchmarks/report.py                            # the standard plants
    python benchmarks/report.py oak.glb --out report/
    python benchmarks/report.py --record

What `vegtool report` measures (12 views all around, each under a sun of its own, five sizes on the
screen). `--record` appends a row per plant and row of the report to benchmarks/results/report.csv
and writes docs/error_against_time.md with its plot. A report that was interrupted goes on in its
folder, where one is named.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from time import monotonic
from typing import Any

from recorded import record

from vegtool import __version__
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample
from vegtool.report import report
from vegtool.report.options import ReportOptions
from vegtool.report.plots import COST_AXES, error_against, png
from vegtool.report.rows import Report
from vegtool.report.summary import Point, medians, points

ROOT = Path(__file__).resolve().parent.parent
MODELS = (
    "eztree_ash_small/eztree_ash_small.glb",
    "eztree_pine_medium/eztree_pine_medium.glb",
    "sapling_birch_lv2/sapling_birch_lv2.glb",
    "sapling_callistemon_bush/sapling_callistemon_bush.glb",
    "arbaro_palm/arbaro_palm.obj",
)
SAMPLES = ("broadleaf", "conifer")
PAGE = ROOT / "docs" / "error_against_time.md"
BIAS_PIXELS = 100.0


def standard(folder: Path) -> dict[str, Path]:
    """The real plants there are, and two samples, by name."""
    models = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    found = {Path(m).stem: models / m for m in MODELS if (models / m).exists()}
    for name in SAMPLES:
        found[name] = folder / f"{name}.glb"
        found[name].write_bytes(plant_glb(sample(name)))
    return found


def rows(made: Report) -> list[dict[str, Any]]:
    """A row per plant and row of the report."""
    found = []
    for plant in made.plants:
        for point in points(plant):
            flips = {
                f"flip_{size:g}": f"{error.mean:.4f}"
                for size, error in zip(point.pixels, point.errors["flip"], strict=True)
            }
            bias = point.errors["coverage_bias"][point.pixels.index(BIAS_PIXELS)].mean
            found.append({
                "version": __version__, "plant": plant.name, "row": point.name, **flips,
                "coverage_bias": f"{bias:+.3f}", "seconds": f"{point.bake_seconds:.3f}",
                "triangles": f"{point.triangles:.0f}", "texels": f"{point.texels:.0f}",
                "frame_ratio": f"{point.frame_ratio:.3f}",
            })  # fmt: skip
    return found


def document(made: Report) -> str:
    """docs/error_against_time.md."""
    said = (
        "What stands in for a plant at a distance: how far it is from the truth (FLIP, mean ± "
        "standard deviation over views, or over plants), what it takes to make and to draw. Made "
        "by `python benchmarks/report.py --record`. The number in a row's name is its budget of "
        "billboards; mesh reductions get the triangles of so many, two each. What each row is: "
        "[vegtool report](commands/report.md).",
        f"vegtool {made.version}, {made.options['view_count']} views all around, drawn by "
        f"{made.renderer}. Times compare rows of this page only; a frame is stated over that of "
        "the live original.",
    )
    blocks = ["# Error against time", *(fill(text, 100) for text in said)]
    blocks += ["![Error against the time to make it](error_against_time.png)"]
    blocks += [f"## Medians of {len(made.plants)} plants", _table(medians(made.plants))]
    for plant in made.plants:
        blocks += [f"## {plant.name}", f"{plant.triangles:,} triangles.", _table(points(plant))]
        blocks += [f"Not in the table: {n}" for n in plant.notes if n.startswith("gltfpack")]
    return "\n\n".join(blocks) + "\n"


def write_page(made: Report) -> None:
    """docs/error_against_time.md and its plot."""
    PAGE.write_text(document(made), encoding="utf-8")
    title = f"Error against the time to make it: medians of {len(made.plants)} plants"
    figure = error_against(medians(made.plants), COST_AXES[0], title)
    PAGE.with_suffix(".png").write_bytes(png(figure))


def _table(found: Sequence[Point]) -> str:
    sizes = found[0].pixels
    best = [min(p.errors["flip"][i].mean for p in found) for i in range(len(sizes))]
    head = ["row", *(f"{size:g} px" for size in sizes), "triangles", "texels", "seconds", "frame"]
    lines = [head, ["---", *["--:"] * (len(head) - 1)]]
    for point in found:
        errors = []
        for error, least in zip(point.errors["flip"], best, strict=True):
            mean = f"**{error.mean:.3f}**" if error.mean == least else f"{error.mean:.3f}"
            errors.append(f"{mean} ± {error.sd:.3f}")
        lines.append([
            point.name, *errors, f"{point.triangles:,.0f}", f"{point.texels:,.0f}",
            f"{point.bake_seconds:.2f}", f"{point.frame_ratio:.2f}",
        ])  # fmt: skip
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--out", type=Path, help="keep the report here")
    parser.add_argument("--record", action="store_true")
    known = parser.parse_args()
    start, said = monotonic(), ""

    def progress(stage: str, fraction: float) -> None:
        nonlocal said
        row = ":".join(stage.split(":")[:2]).partition(",")[0]
        if row != said:
            said = row
            print(f"{monotonic() - start:7.1f} s  {fraction:4.0%}  {stage}", flush=True)

    with tempfile.TemporaryDirectory() as name:
        sources = {p.stem: p for p in known.models} or standard(Path(name))
        out = known.out or Path(name) / "out"
        made = report(sources, ReportOptions(), ReadOptions(), out, True, progress)
    print(f"{monotonic() - start:.1f} s for {len(made.plants)} plants")
    if known.record:
        record("report", rows(made))
        write_page(made)


if __name__ == "__main__":
    main()
