"""Photographs of .glb files by stock three.js in headless Chromium, as arrays.

The canvas as it comes: the material that its loader makes, mip-maps by plain averaging, no
anisotropy, alpha tested once per pixel, 4x multisampling averaged in sRGB. Packages and browser as
for tests/clients. A truth is drawn at TRUTH x TRUTH samples per pixel, without mip-maps, and
averaged here.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

from vegtool.arrays import SingleArray
from vegtool.srgb import linear_from_srgb

CLIENTS = Path(__file__).resolve().parents[2] / "tests" / "clients"
SIZE, FOV_DEG, TRUTH = 256, 40.0, 8
"""Pixels a side; degrees; samples per axis and pixel."""
VIEWS = 12
SUN = (0.5, 1.0, 0.7)
OTHER_SUNS = ((-0.8, 0.5, 0.3), (0.1, 1.0, -0.2), (0.6, 0.4, -0.8))
LINEAR = linear_from_srgb(np.arange(256) / 255).astype(np.float32)


@dataclass(frozen=True)
class View:
    """direction: unit, from the plant to the eye. sun: from the plant to the sun, any length."""

    direction: tuple[float, ...]
    sun: tuple[float, ...]


def views(phase: float = 0.0, suns: Sequence[tuple[float, ...]] = (SUN,)) -> tuple[View, ...]:
    """VIEWS Fibonacci directions, up to 53 degrees above and below the horizon, under each sun."""
    i = np.arange(VIEWS) + phase
    y = 0.8 * (1 - (2 * i + 1) / VIEWS)
    around = i * np.pi * (3 - 5**0.5)
    r = np.sqrt(1 - y * y)
    directions = np.stack([r * np.cos(around), y, r * np.sin(around)], axis=1).tolist()
    return tuple(View(tuple(direction), sun) for sun in suns for direction in directions)


STANDARD = views()
HELD_OUT = views(0.4, OTHER_SUNS)


@dataclass(frozen=True)
class Shot:
    """A file seen from all views at one distance (bounding radii) from a centre (metres).

    mipmaps: as a client has them; without, textures are sampled as they are.
    keep: whether the photographs are worth keeping in the cache.
    """

    file: Path
    center: tuple[float, ...]
    radius: float
    distance: float
    views: tuple[View, ...] = STANDARD
    supersample: int = 1
    mipmaps: bool = True
    keep: bool = False


@dataclass(frozen=True, eq=False)
class Pictures:
    """What was photographed from v views, averaged to SIZE a side.

    color: (v, SIZE, SIZE, 3) sRGB as encoded, premultiplied; its average is what a display shows.
    light: (v, SIZE, SIZE, 3) linear, premultiplied: decoded sample by sample.
    coverage: (v, SIZE, SIZE). triangles, texels: that the client holds.
    """

    color: SingleArray
    light: SingleArray
    coverage: SingleArray
    triangles: int
    texels: int


def photograph(shots: Sequence[Shot], folder: Path, cache: Path | None = None) -> dict[Shot, Path]:
    """Take all shots with one browser; what is in the cache already is not taken again.

    Gives the file of each shot, for `load`: what is in memory at once is up to the caller. It lies
    in `cache` where the shot is to be kept and there is one, else in `folder`.
    """
    found, missing = {}, []
    for shot in dict.fromkeys(shots):
        place = cache if cache is not None and shot.keep else folder
        place.mkdir(parents=True, exist_ok=True)
        found[shot] = place / f"{_key(shot)}.npz"
        if not found[shot].exists():
            missing.append(shot)
    if missing:
        _take({shot: found[shot] for shot in missing})
    return found


def load(path: Path) -> Pictures:
    """The pictures of a shot."""
    with np.load(path) as kept:
        values, (triangles, texels) = kept["pictures"], map(int, kept["facts"])
    return Pictures(values[..., :3], values[..., 3:6], values[..., 6], triangles, texels)


def _take(shots: dict[Shot, Path]) -> None:
    """Photograph, and write what is averaged of each shot to its path."""
    with TemporaryDirectory() as name:
        jobs = [_job(shot, Path(name) / str(i)) for i, shot in enumerate(shots)]
        program = subprocess.Popen(
            ["node", CLIENTS / "photograph.mjs"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "VEGTOOL_CHROMIUM": _browser()},
        )
        assert program.stdin is not None
        assert program.stdout is not None
        with program.stdin as stdin:
            json.dump({"size": SIZE, "fov": FOV_DEG, "jobs": jobs}, stdin)
        for line, job, path in zip(program.stdout, jobs, shots.values(), strict=False):
            facts = json.loads(line)
            if facts["complaints"]:
                raise SystemExit(f"three.js, {job['file']}: {'; '.join(facts['complaints'])}")
            pictures = np.stack([_averaged(Path(png)) for png in job["out"]])
            np.savez_compressed(
                path, pictures=pictures, facts=[facts["triangles"], facts["texels"]]
            )
            shutil.rmtree(Path(job["out"][0]).parent)
        if program.wait():
            raise SystemExit("tests/clients/photograph.mjs failed; see above")


def _job(shot: Shot, folder: Path) -> dict[str, Any]:
    """A shot as photograph.mjs takes it, its pictures in a folder of its own."""
    folder.mkdir()
    return {
        "file": str(shot.file),
        "center": shot.center,
        "radius": shot.radius,
        "supersample": shot.supersample,
        "mipmaps": shot.mipmaps,
        "views": [{**asdict(view), "distance": shot.distance} for view in shot.views],
        "out": [str(folder / f"{i}.png") for i in range(len(shot.views))],
    }


def _averaged(png: Path) -> SingleArray:
    """(SIZE, SIZE, 7): colour, light and coverage of a photograph."""
    rgba = np.asarray(Image.open(png).convert("RGBA"))
    alpha = rgba[..., 3:] / np.float32(255)
    samples = np.concatenate(
        [rgba[..., :3] / np.float32(255) * alpha, LINEAR[rgba[..., :3]] * alpha, alpha], axis=2
    )
    k = len(samples) // SIZE
    return np.asarray(samples.reshape(SIZE, k, SIZE, k, 7).mean(axis=(1, 3)))


def _key(shot: Shot) -> str:
    """All that the pictures depend on, hashed."""
    packages = Path(os.environ.get("VEGTOOL_NODE_MODULES") or CLIENTS / "node_modules")
    about = asdict(shot) | {"file": "", "keep": "", "size": SIZE, "fov": FOV_DEG}
    digest = sha256(json.dumps(about, sort_keys=True).encode())
    for path in (
        shot.file,
        CLIENTS / "photograph.mjs",
        packages / "three" / "package.json",
        Path(__file__),
    ):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:32]


def _browser() -> str:
    names = ("chromium", "chromium-browser", "google-chrome")
    found = os.environ.get("VEGTOOL_CHROMIUM") or next(filter(None, map(shutil.which, names)), None)
    if found is None:
        raise SystemExit("needs Chromium: see tests/clients/run")
    return found
