"""Light on levels: relighting, a turning camera, pre-lit levels, crown normals; and the figures.

    python benchmarks/lighting.py                       # everything, on five plants
    python benchmarks/lighting.py ash --parts turning   # one part of one plant
    python benchmarks/lighting.py --record --markdown
    python benchmarks/lighting.py ash commontree --parts '' --figures

Plants as for benchmarks/quality.py; the procedural samples stand in where there are none. Levels
are those of `vegtool convert` as it comes and, as the plain method, with --refine none. What is
asked is told beside what was found; the exit status is 1 where something is missed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from judge.plants import MODELS, QUICK, ROOT, wanted
from light import crown, prelit, relighting, shadows, turning
from light.tables import tables
from recorded import record, written

from vegtool import __version__
from vegtool.convert import ConvertOptions, convert
from vegtool.formats import read_plant
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Plant

METHODS = ("full", "none")
"""Of --refine."""
PAGE = ROOT / "docs" / "methods" / "lighting.md"
MARK = "<!-- made by benchmarks/lighting.py -->"

Row = dict[str, object]


@dataclass(frozen=True)
class Part:
    """What a part finds of a plant: rows for its file of results, and what of these is missed."""

    file: str
    rows: Callable[[str, Plant, dict[str, LodChain]], list[Row]]
    missed: Callable[[Row], str]


def relighting_rows(name: str, plant: Plant, chains: dict[str, LodChain]) -> list[Row]:
    return [
        row
        for method, chain in chains.items()
        for row in relighting.rows(name, method, list(relighting.relit(chain)))
    ]


def turning_rows(name: str, plant: Plant, chains: dict[str, LodChain]) -> list[Row]:
    found = turning.turned(chains["full"])[1]
    return turning.rows(name, "full", found)


def prelit_rows(name: str, plant: Plant, chains: dict[str, LodChain]) -> list[Row]:
    return [
        row
        for method in METHODS
        for row in prelit.rows(name, method, list(prelit.beside(plant, method, chains[method])))
    ]


def crown_rows(name: str, plant: Plant, chains: dict[str, LodChain]) -> list[Row]:
    return crown.rows(name, list(crown.bent(plant, chains["full"])))


def shadow_rows(name: str, plant: Plant, chains: dict[str, LodChain]) -> list[Row]:
    return shadows.rows(name, list(shadows.thrown(plant, chains["full"])))


def _relit_missed(row: Row) -> str:
    ratio = float(str(row["ratio"]))
    return f"{ratio:.2f} of the flat level's shading error, at most 0.5" if ratio > 0.5 else ""


def _turned_missed(row: Row) -> str:
    worst, jump = float(str(row["worst"])), float(str(row["worst_jump"]))
    told = [f"brightness off by {worst:.1%}, at most 3 %"] * (worst > turning.BIAS)
    told += [f"a jump of {jump:.1%}, at most 1 %"] * (jump > turning.JUMP)
    return "; ".join(told)


def _nothing(row: Row) -> str:
    return ""


PARTS = {
    "relighting": Part("lighting_relit", relighting_rows, _relit_missed),
    "turning": Part("lighting_turned", turning_rows, _turned_missed),
    "prelit": Part("lighting_prelit", prelit_rows, _nothing),
    "crown": Part("lighting_crown", crown_rows, _nothing),
    "shadows": Part("lighting_shadows", shadow_rows, _nothing),
}


def prelit_missed(rows: Sequence[Row]) -> list[str]:
    """Pre-lit levels that err more than normal-textured ones without shadows, or that have more
    than half of their texels."""
    told = []
    levels = {(row["plant"], row["method"], row["level"], row["drawn"]): row for row in rows}
    for (plant, method, level, drawn), row in levels.items():
        if drawn != "pre-lit":
            continue
        other = levels[plant, method, level, "normals"]
        where = f"{plant}, {method}, LOD{level}"
        for what in ("flip", "shading_rmse"):
            if float(str(row[what])) > float(str(other[what])):
                told.append(f"{where}: {what} {row[what]}, with normals {other[what]}")
        if 2 * int(str(row["texels"])) > int(str(other["texels"])):
            told.append(f"{where}: {row['texels']} texels of {other['texels']}")
        if 2 * int(str(row["bytes"])) > int(str(other["bytes"])):
            told.append(f"{where}: {row['bytes']} bytes of {other['bytes']} as PNG")
    return told


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("plants", nargs="*", help=f"{', '.join(MODELS)}, or files")
    parser.add_argument("--parts", default=",".join(PARTS), help="of them")
    parser.add_argument("--quick", action="store_true", help=f"the first {QUICK} plants only")
    parser.add_argument("--figures", action="store_true", help="write docs/light*.jpg")
    parser.add_argument("--record", action="store_true", help="append to results/lighting_*.csv")
    parser.add_argument("--markdown", action="store_true", help="rewrite the tables of the page")
    known = parser.parse_args()
    found: dict[str, list[Row]] = {part: [] for part in known.parts.split(",") if part}
    missed: list[str] = []
    with TemporaryDirectory() as folder:
        for name, model in wanted(known.plants, known.quick, Path(folder)).items():
            plant = read_plant(model)
            off = MeasureOptions(measure="off")
            chains = {m: convert(plant, ConvertOptions(refine=m), off) for m in METHODS}
            for part in found:
                rows = PARTS[part].rows(name, plant, chains)
                found[part] += rows
                for row in rows:
                    print("  ".join(str(value) for value in row.values()), flush=True)
                    if told := PARTS[part].missed(row):
                        where = f"{name}, {row['method']}, LOD{row['level']}"
                        missed.append(f"{part}: {where}: {told}")
            if known.figures:
                from light.figures import figures

                figures(name, plant, chains, ROOT / "docs")
    missed += [f"prelit: {told}" for told in prelit_missed(found.get("prelit", []))]
    print(f"\n{len(missed)} missed", *missed, sep="\n")
    if known.record:
        for part, rows in found.items():
            record(PARTS[part].file, [{"version": __version__, **row} for row in rows])
    if known.markdown:
        written(PAGE, MARK, tables(found))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
