"""The comparison of Colditz et al. 2005 (section 2, figures 1 and 2) as a table: which clustering
represents plants, and their wood, best with the same number of planes?

    python benchmarks/paper.py                   # all plants, the tables and the picture
    python benchmarks/paper.py --record          # and rows in benchmarks/results/paper.csv
    python benchmarks/paper.py ash dead-tree     # those whose name contains a word; nothing written

Every method of clustering at 16, 64 and 256 planes, crossed by the form of the box as in the paper,
on the plant and on its wood: the plant without its leaves' faces, clustered and baked anew. A level
is baked for 200 pixels and drawn live at 200 and 100, from views over the whole sphere; scores
(`vegtool.measure.metrics`) are means over those. Where two triangles a plane are more than the
plant has, a row is left out.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from recorded import record

from vegtool import __version__
from vegtool.arrays import IntArray
from vegtool.baking.bake import PlantBuffers, bake
from vegtool.baselines.crossed import crossed
from vegtool.boxes import fit_budget
from vegtool.clustering import cluster
from vegtool.formats import read_plant
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.measure.background import bytes_over
from vegtool.measure.pictures import client_plant, live, truth
from vegtool.measure.scores import scores, truths
from vegtool.measure.views import Camera, direction, views
from vegtool.plant import Branches, Plant

ROOT = Path(__file__).resolve().parent.parent
PAGE, FIGURE = ROOT / "docs" / "methods" / "paper.md", ROOT / "docs" / "paper.jpg"
MARK = "<!-- made by benchmarks/paper.py -->"
BUDGETS = (16, 64, 256)
PIXELS = (200.0, 100.0)
VIEWS = 6
SCORES = ("flip", "silhouette", "false_holes", "coverage_bias")
BEATEN = SCORES[:3]  # lower is better
BASELINE = "kmeans"
COMPARED = (BASELINE, "isodata", "branches")  # the paper's
MODELS = (
    "eztree_ash_small/eztree_ash_small.glb",
    "eztree_ash_notex_nouv/eztree_ash_notex_nouv.glb",
    "eztree_ash_zup_cm_obj/eztree_ash_zup_cm_obj.obj",
    "eztree_oak_small_nodes/eztree_oak_small_nodes.glb",
    "eztree_oak_heavy/eztree_oak_heavy.glb",
    "eztree_pine_medium/eztree_pine_medium.glb",
    "sapling_birch_lv2/sapling_birch_lv2.glb",
    "sapling_callistemon_bush/sapling_callistemon_bush.glb",
    "proctree_default/proctree_default.obj",
    "arbaro_palm/arbaro_palm.obj",
    "q_mega_commontree_1/gltf/CommonTree_1.gltf",
    "cesium_tree/tree.glb",
    "kenney_tree_oak/tree_oak_conv.glb",
)
SAMPLES = ("broadleaf", "conifer", "bush", "dead-tree")
HEAD = ("version", "plant", "part", "planes", "method", "clusters", *SCORES)
CELL, FOV, SKY = 360, 25.0, (0.60, 0.72, 0.88)
SUN = Light(direction=np.array([0.35, 0.9, 0.8]), sun=0.95)


def plants() -> dict[str, Callable[[], Plant]]:
    """Name -> what reads or grows it: the real plants there are, then the samples."""
    folder = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    found: dict[str, Callable[[], Plant]] = {
        Path(name).parts[0]: partial(read_plant, folder / name)
        for name in MODELS
        if (folder / name).exists()
    }
    for name in SAMPLES:
        found[f"{name} sample"] = partial(sample, name)
    return found


def wood_of(plant: Plant) -> Plant:
    """The plant without its leaves."""
    keep, known = ~plant.face_is_leaf, plant.branches
    if known is not None:
        known = Branches(known.face_branch[keep], known.parent, known.level, known.source)
    return replace(
        plant, faces=plant.faces[keep], face_material=plant.face_material[keep], branches=known
    )


def level_of(buffers: PlantBuffers, method: str, planes: int, pixels: float) -> Level:
    """The plant in that many planes, with as many texels as it has pixels at that size."""
    plant = buffers.plant

    def clusters(count: int) -> IntArray:
        return cluster(plant, method, count)

    labels, billboards = fit_budget(plant, clusters, planes)
    density = pixels / plant.extent
    return bake(buffers, labels, billboards, density)


def compared(name: str, part: str, plant: Plant) -> Iterator[dict[str, Any]]:
    """The rows of a plant, or of its wood."""
    with PlantBuffers(plant) as buffers:
        true = truths(plant, views("all", VIEWS), PIXELS, buffers=buffers)
        for planes in BUDGETS:
            if 2 * planes > len(plant.faces):
                continue
            for method in COMPARED:
                level = level_of(buffers, method, planes, PIXELS[0])
                assert level.billboards is not None
                count = len(np.unique(level.billboards.cluster))
                values = scores(true, level).values
                means = [float(values[metric].mean()) for metric in SCORES]
                row = (__version__, name, part, planes, method, count, *means)
                yield dict(zip(HEAD, row, strict=True))


def means(rows: list[dict[str, Any]], part: str, planes: int, method: str) -> list[str]:
    """Cells of the table: means over plants and, beside k-means, on how many it is closer."""

    def values(of: str) -> np.ndarray:
        chosen = [r for r in rows if (r["part"], r["planes"], r["method"]) == (part, planes, of)]
        return np.array([[r[metric] for metric in SCORES] for r in chosen])

    mine, base = values(method), values(BASELINE)
    better = (mine < base).sum(axis=0)
    cells = []
    for metric, mean, wins in zip(SCORES, mine.mean(axis=0), better, strict=True):
        counted = metric in BEATEN and method != BASELINE
        text = f"{mean:+.2f}" if metric not in BEATEN else f"{mean:.4f}"
        cells.append(f"{text} ({wins} of {len(mine)})" if counted else text)
    return cells


def tables(rows: list[dict[str, Any]]) -> str:
    """Markdown: means over the plants, then every plant's wood."""
    lines = []
    for part in ("wood", "plant"):
        title = "the wood alone" if part == "wood" else "the whole plant"
        lines += [
            f"Means over all plants, {title}; in brackets on how many of them it is closer to the"
            " truth than k-means:",
            "",
            "| planes | method | FLIP | silhouette | false holes | coverage |",
            "|---|---|---|---|---|---|",
        ]
        for planes in BUDGETS:
            for method in COMPARED:
                cells = means(rows, part, planes, method)
                lines.append(f"| {planes} | {method} | {' | '.join(cells)} |")
        lines.append("")
    lines += [
        "Wood of each plant, FLIP / silhouette / false holes:",
        "",
        f"| plant | planes | {' | '.join(COMPARED)} |",
        "|---|---|" + "---|" * len(COMPARED),
    ]
    found = {(r["plant"], r["planes"], r["method"]): r for r in rows if r["part"] == "wood"}
    for plant, planes in dict.fromkeys((key[0], key[1]) for key in found):
        cells = [
            " / ".join(
                f"{found[plant, planes, method][metric]:.{4 if metric == 'flip' else 2}f}"
                for metric in BEATEN
            )
            for method in COMPARED
        ]
        lines.append(f"| {plant} | {planes} | {' | '.join(cells)} |")
    return "\n".join(lines)


def written(rows: list[dict[str, Any]]) -> None:
    """The tables put between the two marks of the page."""
    before, _, after = PAGE.read_text(encoding="utf-8").split(MARK)
    text = f"{before}{MARK}\n\n{tables(rows)}\n\n{MARK}{after}"
    PAGE.write_text(text, encoding="utf-8")


def figure() -> None:
    """The paper's figure 1: a bare tree, two crossed planes, and the methods at 64 planes."""
    plant = sample("dead-tree")
    towards = direction(20.0, 8.0)
    focal = CELL / (2 * np.tan(np.radians(FOV) / 2))
    distance = 1.2 * plant.height * focal / CELL
    camera = Camera(
        plant.center, towards, distance, focal, CELL, CELL, (CELL / 2, CELL / 2), 1.5 * plant.radius
    )
    with PlantBuffers(plant) as buffers:
        shown = {"original": truth(buffers, camera, SUN, 8)}
        levels = {"two crossed planes": crossed(plant)}
        for method in COMPARED:
            levels[method] = level_of(buffers, method, 64, float(CELL))
    for name, level in levels.items():
        with PlantBuffers(client_plant(level), mipmaps=True) as drawn:
            shown[name] = live(drawn, camera, SUN)
    sheet = Image.new("RGB", (CELL * len(shown), CELL + 34), (250, 250, 248))
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for column, (name, picture) in enumerate(shown.items()):
        sheet.paste(Image.fromarray(bytes_over(picture, SKY)), (column * CELL, 0))
        pen.text((column * CELL + 10, CELL + 8), name, fill=(30, 34, 38), font=font)
    sheet.save(FIGURE, quality=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("words", nargs="*")
    parser.add_argument("--record", action="store_true")
    known = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name, get in plants().items():
        if known.words and not any(word in name for word in known.words):
            continue
        plant = get()
        parts = {"wood": wood_of(plant), "plant": plant}
        if not plant.face_is_leaf.any():
            del parts["plant"]  # it would be the same again
        for part, shown in parts.items():
            for row in compared(name, part, shown):
                rows.append(row)
                cells = (f"{v:.4f}" if isinstance(v, float) else str(v) for v in row.values())
                print("  ".join(f"{cell:>9}" for cell in cells), flush=True)
    if not known.words:
        written(rows)
        figure()
    if known.record:
        record("paper", [{k: shown_value(v) for k, v in row.items()} for row in rows])


def shown_value(value: object) -> object:
    return f"{value:.4f}" if isinstance(value, float) else value


if __name__ == "__main__":
    main()
