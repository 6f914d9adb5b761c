"""How often e_p of Holst and Schumann (2007, eq. 4) is too small, and that the bounds never are.

    python benchmarks/bounds.py [MODEL...] [--record]

Without models: all in the folder of real plants (VEGTOOL_MODELS, or ../shared/models beside the
checkout), and three samples. Levels of 16, 64, 256 and 1,024 billboards of k-means clusters by
position (`crossed`: mostly two or three planes each) and by orientation too (`single`: mostly one),
12 views all around, at the distances at which the plant is 400 to 25 pixels large. Measured are
5,000 points spread over the surface, each with every plane that draws it, and for every plane the
16 corners of faces that lie farthest from it; a billboard's displacement is its largest. Per row,
over billboards, views and distances (cases, less those of billboards that displace nothing):

too_small           share (%) of cases displaced by more than e_p says
by_tenth            the same, by more than a tenth of e_p
median, p95, most   of the ratio of displacement to e_p, where e_p is too small
excess_px           largest displacement less e_p, pixels
bound_broken        cases displaced by more than projection_bound or displacement_bound says
bound_median        median of projection_bound over displacement
all_median          median of displacement_bound (any direction) over the most in the views
level_bound         the same for the worst billboard of the level, which sets its distance
nearest             geometric_error_m over the largest half depth: small where planes are crossed

`--record` appends the rows to benchmarks/results/bounds.csv and draws docs/methods/bounds.png.
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
from vegtool.arrays import FloatArray, IntArray
from vegtool.baking.bake import pairs
from vegtool.boxes import BoxOptions, fit_budget, geometric_error
from vegtool.boxes.error import surface_samples
from vegtool.clustering import ClusterOptions, cluster
from vegtool.formats import read_plant
from vegtool.growth import sample
from vegtool.lod import Billboards, Display
from vegtool.measure.bounds import (
    displacement,
    displacement_bound,
    projection_bound,
    projection_error,
)
from vegtool.measure.views import around, views
from vegtool.plant import Plant

ROOT = Path(__file__).resolve().parent.parent
PLOT = ROOT / "docs" / "methods" / "bounds.png"
MODELS = (
    "airplane/airplane.ply", "arbaro_palm/arbaro_palm.obj", "cesium_tree/tree.glb",
    "eztree_ash_notex_nouv/eztree_ash_notex_nouv.glb", "eztree_ash_small/eztree_ash_small.glb",
    "eztree_ash_zup_cm_obj/eztree_ash_zup_cm_obj.obj", "eztree_oak_heavy/eztree_oak_heavy.glb",
    "eztree_oak_small_nodes/eztree_oak_small_nodes.glb",
    "eztree_pine_medium/eztree_pine_medium.glb", "kenney_tree_oak/tree_oak_conv.glb",
    "proctree_default/proctree_default.obj", "q_mega_commontree_1/gltf/CommonTree_1.gltf",
    "sapling_birch_lv2/sapling_birch_lv2.glb",
    "sapling_callistemon_bush/sapling_callistemon_bush.glb",
)  # fmt: skip
SAMPLES = ("broadleaf", "conifer", "palm")
BUDGETS = (16, 64, 256, 1024)
KINDS = {
    "crossed": (ClusterOptions(), BoxOptions()),
    "single": (ClusterOptions(orientation_weight=0.12), BoxOptions(plane="orientation")),
}
LADDER = (400, 200, 100, 50, 25)
"""Sizes of the longest extent on the screen, in pixels."""
POINTS = 5000
FARTHEST = 16
"""Corners of faces per billboard, those that lie farthest from its plane."""
VIEWS = 12
ROUNDING = 1e-9
"""Relative: what a bound may be missed by."""
NOTHING = 1e-9
"""Pixels: flat clusters are displaced by rounding alone, and are left out."""

Level = dict[str, FloatArray]
"""Per billboard, view and distance (d, v, p): pixels `measured`, `paper`, `bound`, `all`."""


def plants(models: list[Path]) -> Iterator[tuple[str, Plant]]:
    folder = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    for model in models:
        yield model.stem, read_plant(model)
    if not models:
        for name in MODELS:
            if (folder / name).exists():
                yield Path(name).parts[0], read_plant(folder / name)
        for name in SAMPLES:
            yield name, sample(name)


def tested(plant: Plant, labels: IntArray, billboards: Billboards) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and which billboard draws each, in order of the billboards."""
    face, points = surface_samples(plant, POINTS)
    point, shown_by = pairs(labels[face], billboards.cluster)
    corner, drawn_by = pairs(labels, billboards.cluster)
    away = plant.corners[corner] - billboards.center[drawn_by][:, None]
    away = np.abs(np.einsum("nci,ni->nc", away, billboards.normal[drawn_by])).ravel()
    drawn_by = np.repeat(drawn_by, 3)
    order = np.lexsort((-away, drawn_by))
    starts = np.searchsorted(drawn_by[order], np.arange(len(billboards)))
    rank = np.arange(len(order)) - starts[drawn_by[order]]
    farthest = order[rank < FARTHEST]
    corners = plant.corners[corner[farthest // 3], farthest % 3]
    points = np.concatenate([points[point], corners])
    shown_by = np.concatenate([shown_by, drawn_by[farthest]])
    order = np.argsort(shown_by, kind="stable")
    return points[order], shown_by[order]


def measured_level(plant: Plant, labels: IntArray, billboards: Billboards) -> Level:
    points, shown_by = tested(plant, labels, billboards)
    starts = np.searchsorted(shown_by, np.arange(len(billboards)))
    display = Display()
    rows = [], [], [], []
    for pixels in LADDER:
        distance = display.distance_m(pixels / plant.extent)
        for view in views("all", VIEWS):
            camera = around(plant.positions, view.direction, distance, display)
            found = displacement(points, shown_by, billboards, camera)
            rows[0].append(np.maximum.reduceat(found, starts))
            rows[1].append(projection_error(billboards, camera))
            rows[2].append(projection_bound(billboards, camera))
            rows[3].append(displacement_bound(billboards, camera.target, distance, display))
    shape = len(LADDER), VIEWS, len(billboards)
    names = "measured", "paper", "bound", "all"
    return {name: np.reshape(row, shape) for name, row in zip(names, rows, strict=True)}


def summary(level: Level) -> dict[str, Any]:
    measured, paper, bound, everywhere = level.values()
    seen = measured > NOTHING
    short = seen & (measured > paper * (1 + ROUNDING))
    tenth = seen & (measured > 1.1 * paper)
    broken = measured > np.minimum(bound, everywhere) * (1 + ROUNDING) + NOTHING
    any_view, whole = measured.max(axis=1), everywhere.max(axis=1)
    some = any_view > NOTHING
    row = {
        "cases": int(seen.sum()),
        "too_small": f"{100 * short.sum() / max(seen.sum(), 1):.2f}",
        "by_tenth": f"{100 * tenth.sum() / max(seen.sum(), 1):.2f}",
        **dict.fromkeys(("median", "p95", "most", "excess_px"), ""),
        "bound_broken": int(broken.sum()),
        **dict.fromkeys(("bound_median", "all_median", "level_bound"), ""),
    }
    if short.any():
        ratio = measured[short] / np.maximum(paper[short], 1e-12)
        row |= {
            "median": f"{np.median(ratio):.3f}",
            "p95": f"{np.quantile(ratio, 0.95):.3f}",
            "most": f"{ratio.max():.1f}",
            "excess_px": f"{(measured - paper)[short].max():.3f}",
        }
    if some.any():
        row |= {
            "bound_median": f"{np.median(bound[seen] / measured[seen]):.3f}",
            "all_median": f"{np.median(whole[some] / any_view[some]):.3f}",
            "level_bound": f"{np.median(whole.max(axis=1) / any_view.max(axis=1)):.3f}",
        }
    return row


def plot(levels: list[Level]) -> None:
    """Shares of cases up to a ratio of displacement to estimate, for the coarsest and finest."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(9, 3.6), sharey=True, constrained_layout=True)
    for axes, first in zip(panels, (0, len(BUDGETS) - 1), strict=True):
        chosen = levels[first :: len(BUDGETS)]
        for name, color, label in (("paper", "#c44536", "e_p"), ("bound", "#2a6f97", "bound")):
            for row, style in ((0, "-"), (len(LADDER) - 1, "--")):
                measured = np.concatenate([level["measured"][row].ravel() for level in chosen])
                stated = np.concatenate([level[name][row].ravel() for level in chosen])
                seen = (measured > NOTHING) & (stated > 0)
                ratio = np.sort(measured[seen] / stated[seen])
                share = 100 * (np.arange(len(ratio)) + 1) / len(ratio)
                text = f"{label}, plant {LADDER[row]} pixels large"
                axes.plot(ratio, share, style, color=color, label=text, linewidth=1.4)
        axes.axvline(1, color="black", linewidth=0.6)
        axes.set(xlim=(0.85, 1.2), xlabel="measured displacement / stated")
        axes.set(title=f"{BUDGETS[first]:,} billboards")
    panels[0].set(ylabel="cases up to that ratio, %")
    panels[1].legend(frameon=False, fontsize=8, loc="center right")
    figure.savefig(PLOT, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--record", action="store_true")
    known = parser.parse_args()
    rows, levels = [], []
    for name, plant in plants(known.models):
        for kind, (how, boxes) in KINDS.items():
            for budget in BUDGETS:

                def clusters(count: int, how: ClusterOptions = how, of: Plant = plant) -> IntArray:
                    return cluster(of, "kmeans", count, how, 0)

                labels, billboards = fit_budget(plant, clusters, budget, boxes)
                levels.append(measured_level(plant, labels, billboards))
                error = geometric_error(plant, labels, billboards)[0]
                head = {
                    "version": __version__, "plant": name, "kind": kind, "budget": budget,
                    "billboards": len(billboards),
                }  # fmt: skip
                found = summary(levels[-1])
                nearest = f"{error / billboards.half_depth.max():.2f}" if found["cases"] else ""
                rows.append(head | found | {"nearest": nearest})
                print("  ".join(f"{value!s:>8}" for value in rows[-1].values()), flush=True)
    if known.record:
        record("bounds", rows)
        plot(levels)


if __name__ == "__main__":
    main()
