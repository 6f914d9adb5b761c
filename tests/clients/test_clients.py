"""What vegtool writes, as other people's programs read it.

Every model is converted once, by the command line; then Khronos's validator reads every file, and
three.js draws every file in headless Chromium. tests/clients/run installs what this needs.
"""

from __future__ import annotations

import base64
import json
import struct
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hybrids import hybrid_of
from programs import MARKS, MODELS, node

from vegtool.convert import ConvertOptions, convert
from vegtool.formats import READERS
from vegtool.formats.gltf import write_chain
from vegtool.growth import SAMPLES, sample
from vegtool.lod import Display, Level, LodChain
from vegtool.measure.options import MeasureOptions

# A silhouette is a grid of cells, of which those count that are covered by a quarter at least: the
# outline of a crown, not of each leaf. Four pixels to a cell make a plant about 250 pixels high,
# for which the first billboard level is made. The original has twice as many, because three.js
# would lose half of its leaves to mip-mapping.
CELLS = 112
COVER = 0.25
PIXELS_OF_LEVEL, PIXELS_OF_ORIGINAL = 4, 8
VIEWS = [[1, 0.2, 0], [0, 0.2, 1], [-1, 0.2, 0], [0, 0.2, -1], [1, 1, 1], [0, 1, 0.01]]
LEAST_AREA = 20  # cells of the original: a card seen from its edge has no silhouette to compare
LEAST_OVERLAP = 0.5  # intersection over union of the silhouettes of original and level 1
LEAST_COVER = 0.25  # of the area of the original's silhouette, mean over the views, for any level
SAME_MODEL = 0.95  # intersection over union of the user's own file and level 0


pytestmark = MARKS


def sources() -> dict[str, Path | None]:
    """The real plants where their folder is here, else our samples, still to be grown (None)."""
    models = sorted(p for p in MODELS.rglob("*") if p.suffix.lower() in READERS)
    if models:
        return {str(path.relative_to(MODELS)): path for path in models}
    return {f"sample {name}": None for name in SAMPLES}


SOURCES = sources()


def stands_for_itself(path: Path | None) -> bool:
    """Whether three.js draws a user's file as vegtool reads it: no blending, no extensions."""
    if path is None or path.suffix != ".glb":
        return False
    gltf = gltf_json(path)
    blended = any(m.get("alphaMode") == "BLEND" for m in gltf.get("materials", []))
    return not blended and not gltf.get("extensionsUsed")


def gltf_json(file: Path) -> dict[str, Any]:
    """The JSON chunk of a .glb file."""
    data = file.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    result: dict[str, Any] = json.loads(data[20 : 20 + length])
    return result


@dataclass(frozen=True)
class Written:
    """What one conversion wrote."""

    source: Path
    combined: Path
    levels: list[Path]  # without the original

    @property
    def files(self) -> list[Path]:
        return [self.combined, *self.levels]


def vegtool(*arguments: str | Path) -> str:
    """Run the command line; return what it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "vegtool.cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=3600,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


HYBRIDS = {f"hybrid {sides}": sides == "double" for sides in ("double", "opposite")}
"""Chains with a level of mesh and billboards, by whether it is double-sided."""
SURFELS = {f"surfels {bits}": bits == "quantized" for bits in ("plain", "quantized")}
"""Chains of points, by whether they are quantized."""
POINTS = 60_000
"""Of a level that is to have a silhouette: three.js draws each as one pixel."""
FILES = [*SOURCES, *HYBRIDS, *SURFELS]


@pytest.fixture(scope="session")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Written]:
    """Every model, converted with all defaults by one command, and the hybrids."""
    folder = tmp_path_factory.mktemp("clients")
    paths: dict[str, Path] = {}
    for name, path in SOURCES.items():
        sample = name.removeprefix("sample ")
        paths[name] = path or folder / "samples" / f"{sample}.glb"
        if path is None:
            vegtool("sample", sample, "-o", paths[name], "-q")
    printed = vegtool("convert", *paths.values(), "-o", folder / "out", "-j", "2", "--json", "-q")
    outcomes = {Path(outcome["source"]): outcome for outcome in json.loads(printed)}
    found = {name: _written(path, outcomes[path]) for name, path in paths.items()}
    for name, double_sided in HYBRIDS.items():
        found[name] = _hybrid(folder / name, double_sided)
    for name, quantized in SURFELS.items():
        found[name] = _surfels(folder / name, quantized)
    return found


def _surfels(folder: Path, quantized: bool) -> Written:
    """A sample whose level is surfels."""
    options = ConvertOptions(method="surfels", points=POINTS, levels=1)
    chain = convert(sample("broadleaf", 4000), options, MeasureOptions(measure="off"))
    first, combined, _ = write_chain(chain, folder, quantized=quantized)
    return Written(combined, combined, [first])


def _hybrid(folder: Path, double_sided: bool) -> Written:
    """A sample whose level has its wood as a mesh, as a chain of two."""
    plant = sample("broadleaf", 4000)
    level = replace(hybrid_of(plant, 256, 250 / plant.extent), double_sided=double_sided)
    level = replace(level, near_distance_m=5 * plant.extent)
    chain = LodChain(plant.name, (Level("mesh", mesh=plant), level), Display(), 0)
    first, combined, _ = write_chain(chain, folder)
    return Written(combined, combined, [first])


def _written(source: Path, outcome: dict[str, Any]) -> Written:
    manifest = next(Path(f) for f in outcome["files"] if f.endswith(".lod.json"))
    values = json.loads(manifest.read_bytes())
    combined, *levels = [manifest.parent / level["file"] for level in values["levels"]]
    return Written(source, combined, levels)


@pytest.fixture(scope="session")
def validated(written: dict[str, Written]) -> dict[Path, dict[str, Any]]:
    """The validator's word on every file."""
    files = [str(file) for each in written.values() for file in each.files]
    answers = node("validate.mjs", {"files": files, "alone": True})
    return {Path(answer["file"]): answer for answer in answers}


@pytest.fixture(scope="session")
def drawn(written: dict[str, Written]) -> dict[Path, dict[str, Any]]:
    """Every file as three.js draws it, seen like its original.

    Silhouettes are bool (views, CELLS, CELLS).
    """
    jobs = []
    for name, each in written.items():
        center, radius = frame(each.combined)
        own = stands_for_itself(SOURCES.get(name))
        originals = [each.combined, *([each.source] if own else [])]
        for file in (*originals, *each.levels):
            pixels = PIXELS_OF_ORIGINAL if file in originals else PIXELS_OF_LEVEL
            jobs.append({"file": str(file), "center": center, "radius": radius, "pixels": pixels})
    answers = node(
        "open_in_three.mjs", {"cells": CELLS, "cover": COVER, "views": VIEWS, "jobs": jobs}
    )
    for answer in answers:
        packed = [base64.b64decode(s) for s in answer.get("silhouettes", [])]
        bits = np.unpackbits(np.frombuffer(b"".join(packed), np.uint8)).astype(bool)
        answer["silhouettes"] = bits.reshape(-1, CELLS, CELLS)
    return {Path(answer["file"]): answer for answer in answers}


def frame(file: Path) -> tuple[list[float], float]:
    """Centre and radius (metres) of what a combined file shows, from its own bounds."""
    gltf = gltf_json(file)
    shown = gltf["nodes"][gltf["scenes"][gltf["scene"]]["nodes"][0]]
    primitives = gltf["meshes"][shown["mesh"]]["primitives"]
    positions = [gltf["accessors"][p["attributes"]["POSITION"]] for p in primitives]
    low = np.min([p["min"] for p in positions], axis=0)
    high = np.max([p["max"] for p in positions], axis=0)
    center = (low + high) / 2 + shown.get("translation", [0, 0, 0])
    return center.tolist(), float(np.linalg.norm(high - low) / 2)


def overlap(original: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Intersection over union of silhouettes, for the views in which the original has one."""
    seen = original.sum(axis=(1, 2)) >= LEAST_AREA
    original, other = original[seen], other[seen]
    return (original & other).sum(axis=(1, 2)) / (original | other).sum(axis=(1, 2))


@pytest.mark.parametrize("source", FILES)
def test_the_validator_finds_no_error_and_no_warning(source, written, validated):
    for file in written[source].files:
        answer = validated[file]
        bad = [m for m in answer["messages"] if m["severity"] < 2]  # 0 error, 1 warning
        assert not bad, (file.name, bad[:5])
        assert answer["errors"] == answer["warnings"] == 0


@pytest.mark.parametrize("source", FILES)
def test_three_opens_and_draws_every_file(source, written, drawn):
    area = drawn[written[source].combined]["silhouettes"].sum(axis=(1, 2))
    seen = area >= LEAST_AREA
    assert seen.any()
    for file in written[source].files:
        answer = drawn[file]
        assert "error" not in answer, (file.name, answer["error"])
        assert answer["complaints"] == [], file.name
        cover = answer["silhouettes"].sum(axis=(1, 2))[seen] / area[seen]
        assert cover.mean() >= LEAST_COVER, (file.name, cover)


@pytest.mark.parametrize("source", FILES)
def test_level_1_has_the_silhouette_of_the_original(source, written, drawn):
    original, first = written[source].combined, written[source].levels[0]
    shares = overlap(drawn[original]["silhouettes"], drawn[first]["silhouettes"])
    assert shares.min() >= LEAST_OVERLAP, shares


@pytest.mark.parametrize("source", [n for n, path in SOURCES.items() if stands_for_itself(path)])
def test_the_combined_file_shows_what_the_users_own_file_shows(source, written, drawn):
    own, combined = written[source].source, written[source].combined
    shares = overlap(drawn[own]["silhouettes"], drawn[combined]["silhouettes"])
    assert shares.min() >= SAME_MODEL, shares
