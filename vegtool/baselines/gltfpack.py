"""Reduction by gltfpack, the tool that ships with meshoptimizer, where it is on the PATH.

`-si` aims at a ratio of triangles, `-sa` gets there whatever it does to the surface, `-noq` writes
plain floats that every reader knows. https://meshoptimizer.org/gltf
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from vegtool.errors import CapabilityError
from vegtool.formats import read_plant
from vegtool.formats.gltf import plant_glb
from vegtool.lod import Level
from vegtool.plant import Plant
from vegtool.timing import timed

PATIENCE = 120
"""Seconds after which it is taken to have got stuck."""


def gltfpack(plant: Plant, triangles: int) -> Level:
    """The plant as gltfpack reduces it when asked for that many triangles; it may leave more.

    Raises CapabilityError, with a reason to show, where it is missing or fails.
    """
    program = shutil.which("gltfpack")
    if program is None:
        raise CapabilityError(
            "gltfpack was not found on the PATH; to have it in the comparison, get it from "
            "https://github.com/zeux/meshoptimizer/releases"
        )
    ratio = min(1.0, triangles / len(plant.faces))
    seconds: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "plant.glb", Path(folder) / "reduced.glb"
        with timed(seconds, "write"):
            given.write_bytes(plant_glb(plant))
        with timed(seconds, "gltfpack"):
            _run([program, "-i", str(given), "-o", str(made), "-si", f"{ratio:.9f}", "-sa", "-noq"])
        if not made.is_file():
            raise CapabilityError("gltfpack ended without an error and wrote no file")
        with timed(seconds, "read"):
            mesh = read_plant(made)
    return Level("mesh", mesh=mesh, seconds=seconds)


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=PATIENCE
        )
    except subprocess.TimeoutExpired:
        raise CapabilityError(f"gltfpack was stopped after {PATIENCE} seconds") from None
    except OSError as error:
        raise CapabilityError(f"gltfpack could not be started: {error}") from error
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines() or ["it said nothing"]
        raise CapabilityError(f"gltfpack failed with exit code {done.returncode}: {said[-1]}")
