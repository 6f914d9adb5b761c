"""What a command takes before its work begins, and which modules a run loads.

    python benchmarks/startup.py                        # four minutes
    python benchmarks/startup.py --record --markdown

Every figure is a median of seven runs with least and most, each in a process of its own and one
command after the other, so that what else the machine does meets them all. Seconds begin with the
process. Work begins where the first file that was named is opened. What is missed of what is asked
is told at the end, and the exit status is then 1.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from recorded import markdown, record, written

from vegtool import __version__

PAGE = Path(__file__).resolve().parent.parent / "docs" / "benchmarks.md"
MARK = "<!-- made by benchmarks/startup.py -->"
RUNS = 7
TRIANGLES = 4_000
"""Of the plant: enough for levels, few enough that starting counts."""
HELP_S, HELP_MB = 0.25, 60
"""Asked of `vegtool --help`."""
PACKAGES = (
    "numpy", "scipy", "PIL", "trimesh", "moderngl", "pyrender", "pyglet", "OpenGL", "skimage",
    "fast_simplification", "numba", "DracoPy", "distributed", "rasterio", "laspy", "matplotlib",
    "av",
)  # fmt: skip
"""That vegtool may load, beside typer and rich, which every command line loads."""
READING = frozenset({"numpy", "PIL"})
DRAWING = READING | {"scipy", "moderngl"}
MAKING = DRAWING | {"skimage", "fast_simplification"}
NORMALS = {"normals", "balance"}
"""Stages of levels that are drawn with normals."""

MEASURED = """
import atexit, json, pathlib, resource, sys, time
report, named = pathlib.Path(sys.argv.pop(1)), sys.argv.pop(1)
begun = []
def heard(event, given):
    if event == "open" and not begun and named and str(given[0]).startswith(named):
        begun.append(time.process_time())
def told():
    status = pathlib.Path("/proc/self/status")
    if status.exists():  # Linux counts the parent's memory in ru_maxrss
        peak = int(status.read_text().split("VmHWM:")[1].split()[0]) // 1024
    else:
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024**2
    found = {"begun": begun, "peak_mb": peak, "modules": sorted(sys.modules)}
    report.write_text(json.dumps(found))
atexit.register(told)
sys.addaudithook(heard)
if len(sys.argv) > 1:
    from vegtool.__main__ import main
    main()
"""


@dataclass(frozen=True)
class Case:
    """A command, the file or folder that it reads, and the packages that it may load."""

    name: str
    arguments: Sequence[str | Path] = ()
    reads: Path | None = None
    may_load: frozenset[str] = frozenset()


@dataclass
class Runs:
    """What the runs of a case took; what the last one loaded, and printed."""

    cpu_s: list[float] = field(default_factory=list)
    wall_s: list[float] = field(default_factory=list)
    begun_s: list[float] = field(default_factory=list)
    peak_mb: list[int] = field(default_factory=list)
    modules: list[str] = field(default_factory=list)
    text: str = ""

    @property
    def packages(self) -> list[str]:
        """Of PACKAGES, those that were loaded."""
        roots = {name.split(".")[0] for name in self.modules}
        return [name for name in PACKAGES if name in roots]


def cases(folder: Path) -> list[Case]:
    """What is run, on a plant that is made for it."""
    plant, levels, made = folder / "plant.glb", folder / "levels", folder / "made"
    _vegtool("sample", "broadleaf", "-t", TRIANGLES, "-o", plant, "-q")
    _vegtool("convert", plant, "-o", levels, "-q")
    shot = ("--screenshot", made / "shot.png", "-f")
    lit = ("--prelit", "--sun", "135,40", "--levels", "2", "--json", "-o", made, "-f")
    return [
        Case("python"),
        Case("--help", ("--help",)),
        Case("convert --help", ("convert", "--help")),
        Case("inspect", ("inspect", plant), plant, READING),
        Case("convert --prelit", ("convert", plant, *lit), plant, MAKING),
        Case("preview, a model", ("preview", plant, *shot), plant, DRAWING),
        Case("preview, its levels", ("preview", levels, *shot), levels, DRAWING),
    ]


def _vegtool(*arguments: object) -> None:
    subprocess.run([sys.executable, "-m", "vegtool", *map(str, arguments)], check=True)


def run(case: Case, runs: Runs, report: Path) -> None:
    """Run once more."""
    named = "" if case.reads is None else str(case.reads)
    command = [sys.executable, "-c", MEASURED, str(report), named, *map(str, case.arguments)]
    before, start = _children_s(), perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    runs.wall_s.append(perf_counter() - start)
    runs.cpu_s.append(_children_s() - before)
    found = json.loads(report.read_text())
    runs.begun_s += found["begun"]
    runs.peak_mb.append(found["peak_mb"])
    runs.modules, runs.text = found["modules"], done.stdout


def _children_s() -> float:
    """Processor seconds of all processes that were begun and have ended."""
    spent = getrusage(RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def row(case: Case, runs: Runs) -> dict[str, Any]:
    """Of the table."""
    return {
        "command": case.name,
        "cpu_s": _spread(runs.cpu_s),
        "wall_s": _spread(runs.wall_s),
        "cpu_s_until_it_begins": f"{median(runs.begun_s):.2f}" if runs.begun_s else "",
        "peak_mb": max(runs.peak_mb),
        "modules": len(runs.modules),
        "of_vegtool": sum(name.split(".")[0] == "vegtool" for name in runs.modules),
        "packages": " ".join(runs.packages),
    }


def _spread(seconds: Sequence[float]) -> str:
    return f"{median(seconds):.3f} ({min(seconds):.3f} to {max(seconds):.3f})"


def missed(found: Sequence[tuple[Case, Runs]]) -> list[str]:
    """Sentences on what was asked and is not so."""
    sentences = []
    for case, runs in found:
        more = [name for name in runs.packages if name not in case.may_load]
        if more:
            sentences.append(f"{case.name}: loads {', '.join(more)}, which it does not use")
        if case.name == "--help":
            if median(runs.wall_s) > HELP_S:
                sentences.append(f"{case.name}: {median(runs.wall_s):.3f} s of {HELP_S}")
            if max(runs.peak_mb) > HELP_MB:
                sentences.append(f"{case.name}: {max(runs.peak_mb)} MB of {HELP_MB}")
        if case.name == "convert --prelit":
            (outcome,) = json.loads(runs.text)
            stages = {stage for level in outcome["levels"] for stage in level["seconds"]}
            if stages & NORMALS:
                sentences.append(f"{case.name}: has {', '.join(sorted(stages & NORMALS))}")
    return sentences


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    given = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        found = [(case, Runs()) for case in cases(folder)]
        for _ in range(RUNS):
            for case, runs in found:
                run(case, runs, folder / "report.json")
    rows = [row(case, runs) for case, runs in found]
    for each in rows:
        print("  ".join(f"{key} {value}" for key, value in each.items()))
    if given.record:
        about = {"version": __version__, "date": date.today().isoformat(), "cores": os.cpu_count()}
        record("startup", [{**about, **each} for each in rows])
    if given.markdown:
        written(PAGE, MARK, markdown(rows))
    sentences = missed(found)
    for sentence in sentences:
        print(f"missed: {sentence}")
    return 1 if sentences else 0


if __name__ == "__main__":
    sys.exit(main())
