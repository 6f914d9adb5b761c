"""How close levels come to the truth in a stock client, beside the original and mesh reduction.

    python benchmarks/quality.py                     # the standard plants
    python benchmarks/quality.py oak.glb --options "--method kmeans" --record

three.js draws everything in headless Chromium (packages and browser as for tests/clients): the
truth at 8 x 8 samples per pixel, the rest as a client does, with 4x multisampling and mip-maps;
256 x 256 pixels, 40 degrees, 12 views all around, at 2.9, 5.8 and 11.6 bounding radii, where a tree
is about 150, 75 and 38 pixels high and levels 1, 2 and 3 are shown. gltfpack is asked for as many
triangles (-si, -sa) where it is on the PATH. Scores are means over the views, on the crop around
the plant: FLIP (Andersson et al. 2020), signed coverage, silhouette (difference of coverage over
the truth's). `--record` appends rows to benchmarks/results/quality.csv.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import flip_evaluator
import numpy as np
from PIL import Image
from recorded import record

from vegtool import __version__
from vegtool.formats import read_plant
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample

ROOT = Path(__file__).resolve().parent.parent
CLIENTS = ROOT / "tests" / "clients"
SIZE, FOV, TRUTH = 256, 40, 8
DISTANCES = (2.9, 5.8, 11.6)  # bounding radii
VIEWS = 12
BACKGROUND = np.array([0.47, 0.55, 0.63])  # sRGB
HEAD = (
    "version", "plant", "drawn", "options", "distance", "triangles", "texels", "flip", "coverage",
    "silhouette",
)  # fmt: skip


def directions() -> np.ndarray:
    """(VIEWS, 3) unit vectors, Fibonacci, up to 53 degrees above and below the horizon."""
    i = np.arange(VIEWS)
    y = 0.8 * (1 - (2 * i + 1) / VIEWS)
    around = i * np.pi * (3 - 5**0.5)
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(around), y, r * np.sin(around)], axis=1)


def photographs(jobs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Run tests/clients/photograph.mjs."""
    names = ("chromium", "chromium-browser", "google-chrome")
    browser = os.environ.get("VEGTOOL_CHROMIUM") or next(filter(None, map(shutil.which, names)))
    done = subprocess.run(
        ["node", CLIENTS / "photograph.mjs"],
        input=json.dumps({"size": SIZE, "fov": FOV, "jobs": jobs}),
        capture_output=True, text=True, check=True,
        env={**os.environ, "VEGTOOL_CHROMIUM": str(browser)},
    )  # fmt: skip
    return [json.loads(line) for line in done.stdout.splitlines()]


def picture(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """sRGB (SIZE, SIZE, 3) over the background and coverage (SIZE, SIZE), averaged to SIZE."""
    rgba = np.asarray(Image.open(path).convert("RGBA"), np.float64) / 255
    k = rgba.shape[0] // SIZE
    rgba[..., :3] *= rgba[..., 3:]
    rgba = rgba.reshape(SIZE, k, SIZE, k, 4).mean(axis=(1, 3))
    return rgba[..., :3] + BACKGROUND * (1 - rgba[..., 3:]), rgba[..., 3]


def score(truth: list[Path], test: list[Path]) -> np.ndarray:
    """(3,) FLIP, coverage, silhouette: means over the views."""
    rows = []
    for one, other in zip(truth, test, strict=True):
        (a, cover_a), (b, cover_b) = picture(one), picture(other)
        y, x = np.nonzero((cover_a > 0) | (cover_b > 0))
        crop = np.s_[max(y.min() - 4, 0) : y.max() + 5, max(x.min() - 4, 0) : x.max() + 5]
        flip = flip_evaluator.evaluate(a[crop].astype("f4"), b[crop].astype("f4"), "LDR")[1]
        area = cover_a.sum()
        rows.append((flip, cover_b.sum() / area - 1, np.abs(cover_a - cover_b)[crop].sum() / area))
    return np.mean(rows, axis=0)


def compare(model: Path, folder: Path, options: list[str]) -> list[dict[str, Any]]:
    """All rows of one plant."""
    plant = read_plant(model)
    original = folder / "original.glb"
    original.write_bytes(plant_glb(plant))
    command = [sys.executable, "-m", "vegtool", "convert", str(original), "-q", *options]
    command += ["--measure", "off"]  # all three levels, at the distances above
    subprocess.run([*command, "-o", str(folder / "out")], check=True)
    manifest = json.loads((folder / "out" / "original.lod.json").read_text())
    drawn: dict[str, list[Path]] = {
        "truth": [original] * 3,
        "original, live": [original] * 3,
        "vegtool": [folder / "out" / level["file"] for level in manifest["levels"][1:4]],
    }
    if shutil.which("gltfpack"):
        reduced = []
        for level in manifest["levels"][1:4]:
            reduced.append(folder / f"reduced_{level['triangles']}.glb")
            ratio = f"{level['triangles'] / len(plant.faces):.6f}"
            pack = ["gltfpack", "-i", original, "-o", reduced[-1], "-si", ratio, "-sa", "-noq"]
            subprocess.run(pack, check=True, capture_output=True)
        drawn["gltfpack -si -sa"] = reduced
    jobs, pictures = [], {}
    for name, files in drawn.items():
        for file, distance in zip(files, DISTANCES, strict=True):
            made = [folder / f"{len(jobs)}_{i}.png" for i in range(VIEWS)]
            pictures[name, distance] = made
            views = [{"direction": d.tolist(), "distance": distance} for d in directions()]
            jobs.append({
                "file": str(file), "center": plant.center.tolist(), "radius": plant.radius,
                "supersample": TRUTH if name == "truth" else 1,
                "views": views, "out": list(map(str, made)),
            })  # fmt: skip
    facts = photographs(jobs)
    rows = []
    for (name, distance), fact in zip(pictures, facts, strict=True):
        if name == "truth":
            continue
        flip, coverage, outline = score(pictures["truth", distance], pictures[name, distance])
        values = (
            __version__, model.stem, name, " ".join(options) if name == "vegtool" else "", distance,
            fact["triangles"], fact["texels"], f"{flip:.4f}", f"{coverage:+.3f}", f"{outline:.3f}",
        )  # fmt: skip
        rows.append(dict(zip(HEAD, values, strict=True)))
    return rows


def standard(folder: Path) -> list[Path]:
    """The real plants there are, and a sample."""
    models = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    found = [models / n / f"{n}.glb" for n in ("eztree_ash_small", "eztree_pine_medium")]
    broadleaf = folder / "broadleaf.glb"
    broadleaf.write_bytes(plant_glb(sample("broadleaf")))
    return [*(p for p in found if p.exists()), broadleaf]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--options", default="--billboards 553", help="of vegtool convert")
    parser.add_argument("--record", action="store_true")
    known = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for model in known.models or standard(Path(name)):
            folder = Path(tempfile.mkdtemp(dir=name))
            for row in compare(model, folder, shlex.split(known.options)):
                rows.append(row)
                print("  ".join(f"{row[k]!s:>10}" for k in HEAD[1:]), flush=True)
    if known.record:
        record("quality", rows)


if __name__ == "__main__":
    main()
