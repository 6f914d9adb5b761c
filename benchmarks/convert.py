"""Whole-process seconds and peak memory of `vegtool convert`, and how they grow with triangles.

    python benchmarks/convert.py             # the models folder and the growth from 10 k to 1 M
    python benchmarks/convert.py --record    # and a row per case in benchmarks/results/convert.csv

Every figure is the median of three runs of the command line in a fresh process, everything
included: starting Python, reading, writing, the contact sheet.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
import tempfile
from datetime import date
from pathlib import Path
from statistics import median

import numpy as np
from recorded import record

from vegtool import __version__
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample
from vegtool.measure.pictures import renderer

ROOT = Path(__file__).resolve().parent.parent
PLOT = ROOT / "docs" / "convert_growth.png"
RUNS = 3
GROWTH = (10_000, 30_000, 100_000, 300_000, 1_000_000)
HEAD = (
    "version", "date", "case", "triangles", "seconds", "least", "most", "peak_mb", "cores",
    "renderer",
)  # fmt: skip

MEASURED = """
import pathlib, resource, sys
from vegtool.cli import run
code = run(sys.argv[1:])
status = pathlib.Path("/proc/self/status")
if status.exists():  # Linux counts the parent's memory in ru_maxrss
    peak = int(status.read_text().split("VmHWM:")[1].split()[0]) // 1024
else:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024**2
print("PEAK", peak)
sys.exit(code)
"""


def measured(model: Path) -> tuple[list[float], int]:
    """Seconds of each run, and the most megabytes that one took."""
    from time import perf_counter

    seconds, peaks = [], []
    for _ in range(RUNS):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-c", MEASURED, "convert", str(model), "-o", folder, "-q"]
            start = perf_counter()
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            seconds.append(perf_counter() - start)
            peaks.append(int(done.stdout.split("PEAK")[1]))
    return seconds, max(peaks)


def cases(folder: Path) -> list[tuple[str, int, Path]]:
    """Name, triangles, file: the real plants there are, then broadleaf trees of growing detail."""
    models = Path(os.environ.get("VEGTOOL_MODELS") or ROOT.parent / "shared" / "models")
    found = []
    for name, triangles in (("eztree_ash_small", 11_072), ("eztree_oak_heavy", 300_480)):
        path = models / name / f"{name}.glb"
        if path.exists():
            found.append((name, triangles, path))
    for triangles in GROWTH:
        path = folder / f"broadleaf_{triangles}.glb"
        plant = sample("broadleaf", triangles)
        path.write_bytes(plant_glb(plant))
        found.append((f"broadleaf {triangles:,}", len(plant.faces), path))
    return found


def plot(rows: list[dict[str, object]]) -> None:
    """Seconds against triangles, both logarithmic, with the slope of linear growth beside them."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    grown = [r for r in rows if str(r["case"]).startswith("broadleaf")]
    x = np.array([float(str(r["triangles"])) for r in grown])
    y = np.array([float(str(r["seconds"])) for r in grown])
    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    axes.loglog(x, y, "o-", label="vegtool convert")
    axes.loglog(x, y[0] * x / x[0], ":", color="grey", label="linear growth from the first")
    axes.set(xlabel="triangles", ylabel="seconds, whole process", title="vegtool convert, defaults")
    axes.legend()
    figure.savefig(PLOT, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--record", action="store_true")
    recording = parser.parse_args().record
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, triangles, path in cases(Path(folder)):
            seconds, peak = measured(path)
            values = (
                __version__, date.today().isoformat(), name, triangles, f"{median(seconds):.2f}",
                f"{min(seconds):.2f}", f"{max(seconds):.2f}", peak, os.cpu_count(),
                renderer()["renderer"],
            )  # fmt: skip
            rows.append(dict(zip(HEAD, values, strict=True)))
            print(
                f"{name:22s} {triangles:9,d} triangles  {median(seconds):6.2f} s"
                f" ({min(seconds):.2f} to {max(seconds):.2f})  {peak:5d} MB", flush=True,
            )  # fmt: skip
    print(platform.platform(), f"{os.cpu_count()} cores", renderer()["renderer"])
    if recording:
        record("convert", rows)
        plot(rows)


if __name__ == "__main__":
    main()
