"""The gallery: plants side by side as stock three.js shows them, with the error of each picture.

    python benchmarks/gallery.py                  # five plants into docs/gallery
    python benchmarks/gallery.py ash --out /tmp/gallery --options "--billboards 300"

Pictures are drawn as for benchmarks/quality.py: the truth, the live original, the level that the
manifest names for the distance, the plain method at as many triangles. Each is enlarged so that its
pixels are seen, twice, four and eight times from near to far, with its real size below it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from judge.chains import DISTANCES
from judge.photographs import SIZE, VIEWS, Pictures
from judge.plants import MODELS, QUICK, ROOT, wanted
from judge.scores import each, over_background, score
from judge.sitting import Sitting, sit
from PIL import Image, ImageDraw, ImageFont

from vegtool import __version__
from vegtool.arrays import FloatArray

OUT = ROOT / "docs" / "gallery"
VIEW = VIEWS // 2 - 1
"""A little above the horizon."""
NAMES = {
    Sitting.TRUTH: "the truth",
    Sitting.LIVE: "the original, live",
    Sitting.OURS: "vegtool",
    Sitting.PLAIN: "the plain method",
}
ZOOM = (2, 4, 8)
"""At DISTANCES: the plant is about as large in each picture."""
FRAME = 6
"""Pixels around the plant, nearest by, on each side."""
GAP, LITTLE, HEAD, LINE = 14, 6, 72, 23
PAPER, INK, FAINT = (250, 250, 248), (30, 34, 38), (100, 106, 112)
QUALITY = 75
"""Of a JPEG."""


def sheet(name: str, sitting: Sitting) -> Image.Image:
    """The plant's picture: columns of NAMES, rows of DISTANCES."""
    columns = [what for what in NAMES if what in sitting.files]
    side, offset = _frame(sitting.pictures("standard", Sitting.TRUTH, 0))
    cell, sides = side * ZOOM[0], [side * ZOOM[0] // zoom for zoom in ZOOM]
    strips = [max(LITTLE + side, 2 * LINE) + GAP for side in sides]
    size = (GAP + len(columns) * (cell + GAP), HEAD + len(ZOOM) * cell + sum(strips))
    paper = Image.new("RGB", size, PAPER)
    pen = ImageDraw.Draw(paper)
    title, text = ImageFont.load_default(24), ImageFont.load_default(19)
    pen.text((GAP, 8), name, fill=INK, font=title)
    for column, what in enumerate(columns):
        x, y = GAP + column * (cell + GAP), HEAD
        pen.text((x, y - 28), NAMES[what], fill=INK, font=text)
        for i, distance in enumerate(DISTANCES):
            pictures = sitting.pictures("standard", what, i)
            picture = _cropped(pictures, offset * ZOOM[0] / ZOOM[i], sides[i])
            paper.paste(picture.resize((cell, cell), Image.Resampling.NEAREST), (x, y))
            paper.paste(picture, (x + cell - sides[i], y + cell + LITTLE))
            said = f"{distance:g} radii"
            if what != Sitting.TRUTH:
                truth = sitting.pictures("standard", Sitting.TRUTH, i)
                said = f"FLIP {each(truth, pictures)[VIEW, 0]:.3f}"
            pen.text((x, y + cell + 3), said, fill=INK, font=text)
            told = f"{pictures.triangles:,} triangles"
            pen.text((x, y + cell + 3 + LINE), told, fill=FAINT, font=text)
            y += cell + strips[i]
    return paper


def _frame(near: Pictures) -> tuple[int, FloatArray]:
    """A square around the plant in the nearest picture: its side, which all of ZOOM divide as
    enlarged, and (2,) how far right and down of the picture's middle its own lies, in pixels."""
    y, x = np.nonzero(near.coverage[VIEW])
    corners = np.array([[x.min(), y.min()], [x.max() + 1, y.max() + 1]])
    step = ZOOM[-1] // ZOOM[0]
    side = int(np.ceil((np.ptp(corners, axis=0).max() + 2 * FRAME) / step)) * step
    return side, corners.mean(axis=0) - SIZE / 2


def _cropped(pictures: Pictures, offset: FloatArray, side: int) -> Image.Image:
    """A square over the background, so far off the middle."""
    shown = (np.clip(over_background(pictures, VIEW), 0, 1) * 255 + 0.5).astype(np.uint8)
    x, y = (round(float(SIZE / 2 + o - side / 2)) for o in offset)
    return Image.fromarray(shown).crop((x, y, x + side, y + side))


def means(name: str, sitting: Sitting) -> list[str]:
    """Rows of the page's table: mean FLIP over all views of quality.py."""
    rows = []
    for i, distance in enumerate(DISTANCES):
        truth = sitting.pictures("standard", Sitting.TRUTH, i)
        cells = [name, f"{distance:g}"]
        for what in list(NAMES)[1:]:
            if what in sitting.files:
                pictures = sitting.pictures("standard", what, i)
                flip = f"{score(truth, pictures).flip:.3f}"
                bold = "**" if what == Sitting.OURS else ""
                cells.append(f"{bold}{flip}{bold} ({pictures.triangles:,})")
            else:
                cells.append("")
        rows.append(f"| {' | '.join(cells)} |")
    return rows


HYBRIDS = """## Hybrids

`vegtool convert figure.glb --method hybrid --weights polygons=0.03`, then 0.3, 3 and 30: from
nearly a mesh to nearly a cloud of billboards ([how](../methods/hybrid.md)). Drawn by
`python benchmarks/hybrid.py`.

![A cartoon figure: the original, and hybrids of four weights](hybrid_dial.png)
"""
"""What benchmarks/hybrid.py draws."""


def page(rows: Sequence[str], options: dict[str, str]) -> str:
    """docs/gallery/README.md; options: of vegtool convert, plant by plant."""
    table, columns = "\n".join(rows), ", ".join(NAMES.values())
    sections = "\n\n".join(
        f"## {name}\n\n`vegtool convert {how}`\n\n![{name}: {columns}]({name}.jpg)"
        for name, how in options.items()
    )
    return f"""# Gallery

Written by `python benchmarks/gallery.py`, version {__version__}. Everything is drawn by three.js as
it comes, in a browser, 40 degrees and 256 pixels high; the truth at 8 x 8 samples per pixel. Rows
are 2.9, 5.8 and 11.6 bounding radii away, enlarged twice, four and eight times, with the picture at
its real size below. vegtool's level is the one that the manifest names for the distance; the plain
method's has about as many triangles. FLIP is the error of the picture above it: lower is better.

Mean FLIP of 12 views all around, and triangles:

| plant | radii | {" | ".join(list(NAMES.values())[1:])} |
{"|---" * (len(NAMES) + 1)}|
{table}

{sections}

{HYBRIDS}"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("plants", nargs="*", help=f"{', '.join(MODELS)}, or files")
    parser.add_argument("--options", default="", help="of vegtool convert")
    parser.add_argument("--out", type=Path, default=OUT, help="folder")
    parser.add_argument("--quick", action="store_true", help=f"the first {QUICK} plants only")
    parser.add_argument("--cache", type=Path, help="folder that keeps photographs of originals")
    known = parser.parse_args()
    known.out.mkdir(parents=True, exist_ok=True)
    rows, options = [], {}
    with TemporaryDirectory() as folder:
        for name, model in wanted(known.plants, known.quick, Path(folder)).items():
            place = Path(folder) / f"{name}_files"
            sitting = sit(model, known.options, ["standard"], place, known.cache)
            file = known.out / f"{name}.jpg"
            sheet(name, sitting).save(file, quality=QUALITY, optimize=True)
            rows += means(name, sitting)
            options[name] = sitting.chain.options
            print(f"{file}: {file.stat().st_size:,} bytes", flush=True)
    (known.out / "README.md").write_text(page(rows, options), encoding="utf-8")


if __name__ == "__main__":
    main()
