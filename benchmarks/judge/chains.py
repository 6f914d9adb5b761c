"""Chains of levels as a user gets them from the command line, and which level is shown where."""

from __future__ import annotations

import json
import shlex
import shutil
import struct
import subprocess
import sys
from dataclasses import dataclass
from math import radians, tan
from pathlib import Path
from time import perf_counter
from typing import Any

from judge.photographs import FOV_DEG, SIZE
from vegtool.convert import LEVEL_RATIO
from vegtool.formats.manifest import read_manifest
from vegtool.lod import Display
from vegtool.plant import Plant

DISTANCES = (2.9, 5.8, 11.6)
"""Bounding radii: a tree is about 150, 75 and 38 pixels high."""
SHARES = (10, 20, 40)
"""At most such a part of the original's triangles is shown at each distance."""
LEAST = 256
"""Triangles: to fewer no level is forced."""
MOST_BILLBOARDS = 2048
"""Of the first level: in a picture of 256 pixels, more would be smaller than leaves."""
ATTEMPTS = 4
PLAIN = "--refine none"


@dataclass(frozen=True, eq=False)
class Chain:
    """What `vegtool convert` wrote: folder and manifest, the options, and seconds it took."""

    folder: Path
    manifest: dict[str, Any]
    options: str
    seconds: float

    @property
    def levels(self) -> list[dict[str, Any]]:
        """Those made of the plant, finest first, without the original."""
        return list(self.manifest["levels"][1:])

    @property
    def texels(self) -> int:
        """Of all textures of all levels made."""
        return sum(level["texels"] for level in self.levels)

    def file(self, level: dict[str, Any]) -> Path:
        return self.folder / str(level["file"])


def converted(model: Path, folder: Path, options: str) -> Chain:
    """Run `vegtool convert` in a process of its own."""
    command = [
        sys.executable,
        "-m",
        "vegtool",
        "convert",
        str(model),
        "-q",
        "-f",
        "-o",
        str(folder),
    ]
    start = perf_counter()
    done = subprocess.run([*command, *shlex.split(options)], capture_output=True, text=True)
    seconds = perf_counter() - start
    if done.returncode:
        raise SystemExit(f"vegtool convert {model} {options}: {done.stderr.strip()}")
    return Chain(folder, read_manifest(folder / f"{model.stem}.lod.json"), options, seconds)


def limits(triangles: int) -> list[int]:
    """The most triangles at each of DISTANCES, for an original of so many."""
    return [max(triangles // share, LEAST) for share in SHARES]


def within(model: Path, folder: Path, options: str, plant: Plant) -> Chain:
    """A chain whose levels keep to `limits` where they are shown.

    Its first level is made for the first of DISTANCES, with as many billboards as are allowed
    there; with fewer again wherever a level is shown farther away than its triangles allow.
    --pixels and --billboards are left as they are where they stand among the options.
    """
    allowed = limits(len(plant.faces))
    each = [most // 2 * LEVEL_RATIO**i for i, most in enumerate(allowed)]
    billboards = min(*each, MOST_BILLBOARDS)
    # a little larger: distances are rounded up
    near = Display(FOV_DEG, SIZE).pixels_per_metre(DISTANCES[0] * plant.radius)
    pixels = "" if "--pixels" in options else f"--pixels {1.02 * near * plant.extent:.4g}"
    chosen = bool({"--billboards", "-b"} & set(shlex.split(options)))
    for _ in range(ATTEMPTS):
        count = "" if chosen else f"--billboards {billboards}"
        chain = converted(model, folder, " ".join(filter(None, (count, pixels, options))))
        shown = [level_at(chain, distance * plant.radius) for distance in DISTANCES]
        shares = [
            most / level["triangles"]
            for level, most in zip(shown, allowed, strict=True)
            if level in chain.levels  # and not the original
        ]
        room = min(shares, default=1.0)
        if chosen or room >= 1:
            break
        billboards = int(room * billboards)
    return chain


def level_at(chain: Chain, metres: float) -> dict[str, Any]:
    """The level that the manifest says to show so far from the plant in a photograph.

    Its distances are for another display: what counts is pixels per metre.
    """
    of_manifest = chain.manifest["image_height_px"] / tan(radians(chain.manifest["fov_y_deg"]) / 2)
    of_photograph = SIZE / tan(radians(FOV_DEG) / 2)
    scaled = metres * of_manifest / of_photograph
    return [x for x in chain.manifest["levels"] if x["switch_distance_m"] <= scaled][-1]


def like(chain: Chain, triangles: int) -> dict[str, Any]:
    """The level, the original aside, whose number of triangles is nearest."""

    def ratio(level: dict[str, Any]) -> float:
        return max(level["triangles"] / triangles, triangles / level["triangles"])

    return min(chain.levels, key=ratio)


def gltfpacked(original: Path, folder: Path, least: int) -> Path | None:
    """The original as gltfpack -si -sa reduces it to at least so many triangles; None without it.

    It may stop short of what it is asked for, or leave more: the least of a series of attempts.
    """
    if not shutil.which("gltfpack"):
        return None
    whole = triangles_of(original)
    asked = least
    made = folder / f"reduced_{least}.glb"
    while True:
        ratio = f"{min(asked / whole, 1.0):.6f}"
        command = ["gltfpack", "-i", original, "-o", made, "-si", ratio, "-sa", "-noq"]
        subprocess.run(command, check=True, capture_output=True)
        if triangles_of(made) >= least or asked >= whole:
            return made
        asked = int(1.1 * asked) + 1


def triangles_of(glb: Path) -> int:
    """Triangles that stand in a file, by its accessors."""
    data = glb.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    told = json.loads(data[20 : 20 + length])
    parts = [part for mesh in told["meshes"] for part in mesh["primitives"]]
    return sum(told["accessors"][part["indices"]]["count"] for part in parts) // 3
