"""What leaving out saved, and whether anybody can tell.

A library is converted and tiles are made twice: for the scene, and without it. Bytes of both count.
From random eyes inside the description the landscape is drawn with both libraries, and each plant
that is in sight is looked at by itself: FLIP of one picture beside the other.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
from blue.landscape import crops_of, loaded
from landscape.making import tiles

from needed.places import MODELS, Place
from vegtool.cli import run
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample
from vegtool.measure.background import over
from vegtool.measure.flip import difference, perceived
from vegtool.needs.inside import inside
from vegtool.needs.viewers import viewers_of
from vegtool.preview.eye import Eye
from vegtool.preview.forest import Forest
from vegtool.preview.world import read_world
from vegtool.scene import read_scene
from vegtool.tiles.placement import placement_of
from vegtool.tiles.terrain import terrain_of

EYES, SIZE = 50, (960, 540)
"""Random eyes, and pixels of their pictures."""
LEVEL_DEG = 20.0
"""Above and below the horizon, eyes look."""
BYTES = (".glb", ".png", ".gltf", ".bin", ".json")
"""Endings of files that count: not pictures of them for people."""
Say = Callable[[str], None]


@dataclass(frozen=True)
class Lost:
    """A scene. bytes: of the library and the tiles, whole and for it. cpu_s: of converting. flips:
    (n,) of plants in sight, beside each other."""

    name: str
    asked: float
    library: tuple[int, int]
    tiles: tuple[int, int]
    cpu_s: tuple[float, float]
    flips: tuple[float, ...]

    @property
    def share(self) -> float:
        """Of all bytes, that the scene's are."""
        return (self.library[1] + self.tiles[1]) / (self.library[0] + self.tiles[0])


def measured(place: Place, cache: Path, say: Say) -> Lost:
    folder = cache / place.name
    scene = place.write(folder)
    models = _models(cache, place, scene)
    whole, part = folder / "whole", folder / "part"
    seconds, size = [], []
    for out, limited in ((whole, False), (part, True)):
        say(f"{place.name}: {'for the scene' if limited else 'whole'}")
        shutil.rmtree(out, ignore_errors=True)
        since = process_time()
        words = ["convert", *map(str, models), "-o", str(out), "-q"]
        words += ["--prelit"] if place.prelit else []
        words += ["--scene", str(scene)] if limited else _sun(place, scene)
        if run(words):
            raise SystemExit(1)
        seconds.append(process_time() - since)
        size.append(_bytes(out))
    made = []
    for library, limited in ((whole, False), (part, True)):
        out = folder / f"tiles_{library.name}"
        more = ("--scene", str(scene)) if limited else ()
        tiles(scene, library, out, 1, *more)
        made.append(_bytes(out))
    flips = _beside(scene, whole, part, say)
    return Lost(
        place.name, place.share, (size[0], size[1]), (made[0], made[1]),
        (seconds[0], seconds[1]), tuple(flips),
    )  # fmt: skip


def _sun(place: Place, scene: Path) -> list[str]:
    light = read_scene(scene).light
    if not place.prelit or light is None or light.sun is None:
        return []
    return ["--sun", f"{light.sun.azimuth_deg:g},{light.sun.elevation_deg:g}"]


def _models(cache: Path, place: Place, scene: Path) -> list[Path]:
    """The plants of a scene as they are."""
    found = []
    (cache / "models").mkdir(parents=True, exist_ok=True)
    for table in read_scene(scene).species:
        name = str(table.name)
        file = cache / "models" / f"{name}.glb"
        if not file.exists():
            file.write_bytes(plant_glb(sample(name, MODELS[name][0])))
        found.append(file)
    return found


def _bytes(folder: Path) -> int:
    """Of all that a client reads."""
    files = [file for file in folder.rglob("*") if file.is_file()]
    sheets = {f"{file.name[: -len('.lod.json')]}.png" for file in folder.glob("*.lod.json")}
    return sum(
        file.stat().st_size for file in files
        if file.suffix in BYTES and file.name not in sheets and ".vegtool" not in file.parts
    )  # fmt: skip


def _beside(scene: Path, whole: Path, part: Path, say: Say) -> list[float]:
    """FLIP of each plant in sight from random eyes, of the two libraries beside each other."""
    described = read_scene(scene)
    ground = terrain_of(described)
    viewers = viewers_of(described, ground, placement_of(described, ground, 32.0, lambda *_: None))
    eyes = inside(viewers, EYES, 0)
    pitch = np.clip(eyes.pitch_deg, -LEVEL_DEG, LEVEL_DEG)
    if described.camera.height_m is not None and described.camera.height_m[0] > 20:
        pitch = np.clip(eyes.pitch_deg, -60.0, -10.0)  # those above look down
    places = [
        Eye(at, float(yaw), float(tilt))
        for at, yaw, tilt in zip(eyes.position, eyes.yaw_deg, pitch, strict=True)
    ]
    pictures, parts = [], []
    for library in (whole, part):
        world = read_world(library, scene, ReadOptions())
        forest = Forest(world.species, world.placement, world.ground)
        with loaded(forest):
            pictures.append([over(forest.picture(eye, SIZE)) for eye in places])
            parts = parts or [crops_of(forest, eye, SIZE) for eye in places]
        say(f"{library.name}: {len(places)} pictures")
    found = []
    for one, other, crops in zip(*pictures, parts, strict=True):
        for rows, columns in crops:
            a, b = (perceived(p[rows, columns]) for p in (one, other))
            found.append(float(difference(a, b).mean()))
    return found
