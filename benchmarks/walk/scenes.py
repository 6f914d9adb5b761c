"""The landscapes that are walked through, and the plants in them: made by script, and kept.

All are flat, and their plants are placed procedurally, at the spacing at which all that stand are
as many as wanted (WITHIN). A trail leads through them. Plants are samples of vegtool, converted as
`vegtool convert` does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import numpy as np

from vegtool import __version__
from vegtool.baselines.crossed import crossed
from vegtool.batch import Job, Task, convert_file
from vegtool.convert import ConvertOptions
from vegtool.formats import ReadOptions
from vegtool.formats.gltf import plant_glb
from vegtool.formats.png import encode
from vegtool.growth import sample
from vegtool.measure.pictures import client_plant
from vegtool.preview.world import World, read_world
from vegtool.scene import read_scene
from vegtool.tiles.blue_noise import COUNT
from vegtool.tiles.library import Species
from vegtool.tiles.pattern import least_distance
from vegtool.tiles.placement import Placement, placement_of
from vegtool.tiles.terrain import terrain_of
from walk.trail import density

OPAQUE = ConvertOptions(refine="opaque", levels=8, billboards=1024)
"""What the plants of landscapes are converted with: for viewers that can fill little."""
TEXTURED = ConvertOptions()
WITHIN = 0.002
"""Of the number of plants that is wanted."""
SEED = 1
TREES = ("broadleaf", "conifer")

Say = Callable[[str], None]


@dataclass(frozen=True)
class Kind:
    """share: of all plants. height_m: smallest and tallest."""

    share: float
    height_m: tuple[float, float]


@dataclass(frozen=True)
class Setting:
    """A landscape, and what is asked of a walk through it without a GPU: frames per second, and
    plants displayed at that rate. beside_trail: what does not grow on the trail."""

    name: str
    side_m: float
    plants: int
    kinds: Mapping[str, Kind]
    fps: float
    displayed: int
    beside_trail: tuple[str, ...] = (*TREES, "bush")


SETTINGS = {
    "meadow": Setting(
        "meadow",
        300.0,
        365_000,
        {
            "grass-clump": Kind(0.84, (0.25, 0.55)),
            "herb": Kind(0.14, (0.3, 0.7)),
            "bush": Kind(0.015, (1.0, 2.2)),
            "broadleaf": Kind(0.004, (6.0, 12.0)),
            "conifer": Kind(0.001, (8.0, 16.0)),
        },
        4.0,
        20_000,
    ),
    "forest": Setting(
        "forest",
        1000.0,
        390_000,
        {
            "broadleaf": Kind(0.06, (6.0, 14.0)),
            "conifer": Kind(0.05, (8.0, 18.0)),
            "bush": Kind(0.20, (1.0, 2.2)),
            "herb": Kind(0.30, (0.3, 0.7)),
            "grass-clump": Kind(0.39, (0.25, 0.55)),
        },
        2.0,
        5_000,
    ),
    "undergrowth": Setting(
        "undergrowth",
        130.0,
        47_000,
        {
            "bush": Kind(0.35, (0.7, 1.3)),
            "herb": Kind(0.35, (0.3, 0.8)),
            "grass-clump": Kind(0.30, (0.3, 0.6)),
        },
        4.0,
        0,
        (),
    ),
}
"""Undergrowth reaches to the eye's chest wherever it stands: 2.8 plants to the square metre."""
TRAIL = "trail.png"
PLANTS = tuple(SETTINGS["forest"].kinds)


def key_of(*parts: object) -> str:
    """What names kept files by what they were made from."""
    return sha256(repr((__version__, *parts)).encode()).hexdigest()[:12]


def library(cache: Path, names: Sequence[str], options: ConvertOptions, say: Say) -> Path:
    """The folder of these samples, converted where that was not done before."""
    folder = cache / f"library_{options.refine}_{key_of(asdict(options))}"
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as place:
        for name in names:
            if (folder / f"{name}.lod.json").exists():
                continue
            say(f"converting {name}, --refine {options.refine}")
            source = Path(place) / f"{name}.glb"
            source.write_bytes(plant_glb(sample(name)))
            convert_file(Job(source, name), Task(folder, convert=options))
    return folder


def scene_of(setting: Setting, cache: Path, say: Say) -> Path:
    """The scene file of a landscape, written where that was not done before."""
    where = density(setting.side_m)
    folder = cache / f"{setting.name}_{key_of(setting, SEED, WITHIN, crc32(where))}"
    path = folder / "scene.toml"
    if path.exists():
        return path
    folder.mkdir(parents=True, exist_ok=True)
    draft = folder / "draft.toml"
    (folder / TRAIL).write_bytes(encode(where))
    period = setting.side_m * (COUNT / setting.plants) ** 0.5
    spacing, found = period * least_distance(), 0
    while not abs(found - setting.plants) <= WITHIN * setting.plants:
        spacing *= (found / setting.plants) ** 0.5 if found else 1.0
        draft.write_text(_written(setting, spacing), encoding="utf-8")
        read = read_scene(draft)
        found = plants_in(placement_of(read, terrain_of(read)))
    say(f"{setting.name}: {found:,} plants, {spacing:.4f} m between them at least")
    draft.rename(path)
    return path


def plants_in(placement: Placement) -> int:
    """How many plants stand there: all tiles are asked."""
    return sum(len(placement.plants(tile)) for tile in range(len(placement.tiles)))


def world_of(setting: Setting, cache: Path, say: Say) -> World:
    """The landscape with its plants' levels."""
    plants = library(cache, PLANTS, OPAQUE, say)
    return read_world(plants, scene_of(setting, cache, say), ReadOptions())


def with_originals(world: World) -> World:
    """The same without levels."""
    return replace(world, species=tuple(first_levels(one, 1) for one in world.species))


def with_crossed(world: World) -> World:
    """The same with two crossed billboards in place of every plant, however near."""
    species = []
    for one in world.species:
        level = client_plant(crossed(one.levels[0]))
        species.append(replace(first_levels(one, 1), levels=(level,)))
    return replace(world, species=tuple(species))


def first_levels(species: Species, levels: int) -> Species:
    """A species of its first levels alone."""
    return replace(
        species,
        levels=species.levels[:levels],
        switch_m=np.array(species.switch_m[:levels]),
        fade=np.array(species.fade[:levels]),
        files=species.files[:levels],
        error_m=species.error_m[:levels],
    )


def _written(setting: Setting, spacing_m: float) -> str:
    lines = [
        "[terrain]",
        'kind = "plane"',
        f"extent_m = [{setting.side_m:g}, {setting.side_m:g}]",
        "",
        "[placement]",
        f"seed = {SEED}",
        f"spacing_m = {spacing_m:.9g}",
    ]
    for name, kind in setting.kinds.items():
        low, high = kind.height_m
        lines += ["", "[[species]]", f'name = "{name}"', f"share = {kind.share:g}"]
        lines += [f"height_m = [{low:g}, {high:g}]"]
        lines += [f'density = "{TRAIL}"'] * (name in setting.beside_trail)
    return "\n".join(lines) + "\n"
