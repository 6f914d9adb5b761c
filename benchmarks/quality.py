"""Levels as stock three.js shows them: are they closer to the truth than the live original?

    python benchmarks/quality.py                       # five plants, all that is asked of them
    python benchmarks/quality.py ash pine --held-out   # some of them, from other views as well
    python benchmarks/quality.py oak.glb --options "--method kmeans" --record

Each plant is converted by the command line, and at 2.9, 5.8 and 11.6 bounding radii the level is
drawn that the manifest's own switch distances name for that view; beside it the live original, the
plain method (--refine none) at as many triangles, and gltfpack's reduction to no fewer. three.js
draws them in headless Chromium (packages and browser as for tests/clients) at 256 x 256 pixels and
40 degrees from 12 views all around; the truth at 8 x 8 samples and without mip-maps, which lose
leaves even there (--stock-truth leaves it as stock three.js draws it: an ash at 11.6 radii then
lacks an eighth of what it covers, a birch two fifths, and more the fewer samples there are).
--held-out does the same from 12 other views, each under three other suns. What is asked of all that
is in judge/asked.py; what is missed is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from judge.asked import checks, costs
from judge.chains import PLAIN, converted
from judge.plants import MODELS, QUICK, ROOT, wanted
from judge.points import Point, points_of
from judge.sitting import VIEWS
from judge.tables import line, markdown, rows, summary
from recorded import record, written

from vegtool import __version__

PAGE = ROOT / "docs" / "benchmarks.md"
MARK = "<!-- made by benchmarks/quality.py -->"
RUNS = 3


def seconds(model: Path, options: str, folder: Path) -> tuple[float, float]:
    """Of the whole conversion, and of the plain method's: medians of alternating runs."""
    runs = [
        [converted(model, folder, told).seconds for told in (options, f"{options} {PLAIN}")]
        for _ in range(RUNS)
    ]
    mine, plain = map(median, zip(*runs, strict=True))
    return mine, plain


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("plants", nargs="*", help=f"{', '.join(MODELS)}, or files")
    parser.add_argument("--options", default="", help="of vegtool convert")
    parser.add_argument("--quick", action="store_true", help=f"the first {QUICK} plants only")
    parser.add_argument("--held-out", action="store_true", help="other views and suns as well")
    parser.add_argument("--stock-truth", action="store_true", help="a truth with mip-maps")
    parser.add_argument("--time", action="store_true", help="seconds beside the plain method's")
    parser.add_argument("--cache", type=Path, help="folder that keeps photographs of originals")
    parser.add_argument("--json", type=Path, help="file for all figures")
    parser.add_argument("--record", action="store_true", help="append to results/quality.csv")
    parser.add_argument("--markdown", action="store_true", help="rewrite the table of the page")
    known = parser.parse_args()
    sets = list(VIEWS) if known.held_out else ["standard"]
    found: list[Point] = []
    times: dict[str, tuple[float, float]] = {}
    with TemporaryDirectory() as name:
        for plant, model in wanted(known.plants, known.quick, Path(name)).items():
            folder = Path(name) / f"{plant}_files"
            for point in points_of(
                plant, model, known.options, sets, folder, known.cache, known.stock_truth
            ):
                found.append(point)
                print(line(point), flush=True)
            if known.time:
                times[plant] = seconds(model, found[-1].options, folder / "timed")
    asked = [*costs(found, times)]
    for views in sets:
        some = [point for point in found if point.views == views]
        asked += checks(some)
        print(f"\nFrom {views} views", *summary(some), sep="\n")
    missed = [check for check in asked if not check.met]
    print(f"\n{len(asked) - len(missed)} of {len(asked)} met")
    for check in missed:
        print(f"missed: {check.what}: {check.found:.4g}, at most {check.most:.4g}")
    if known.json:
        told = {
            "version": __version__,
            "points": [asdict(point) for point in found],
            "seconds": times,
            "asked": [asdict(check) | {"met": check.met} for check in asked],
        }
        known.json.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    if known.record:
        record("quality", rows(found))
    if known.markdown:
        written(PAGE, MARK, markdown(found, times))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
