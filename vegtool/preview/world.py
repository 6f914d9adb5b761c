"""What is walked through: species, where they stand, the ground, and where the eye begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import radians, tan
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError, UsageError
from vegtool.formats import ReadOptions
from vegtool.gl.landscape import GroundMesh
from vegtool.lighting.light import Sun
from vegtool.preview.eye import FAR_M, FOV_Y_DEG, NEAR_M, Eye, towards
from vegtool.preview.forest import Forest
from vegtool.preview.options import FadeMode
from vegtool.preview.scenery import Scenery
from vegtool.progress import Progress, silent
from vegtool.scene import Scene, read_scene
from vegtool.tiles.library import MANIFEST, Species, read_library
from vegtool.tiles.placement import BoolArray, Placement, Plants, Tiles, placement_of
from vegtool.tiles.species import check_reading, notes_on, placed, species_of
from vegtool.tiles.terrain import Terrain, terrain_of

SPACE = 1.25
"""Between plants in a row, in widths of theirs."""
CELLS = 256
"""Squares along the longer side of the ground that is drawn."""
TILE_M = 32.0
"""Side of a tile: plants outside of the view are left out a tile at a time."""
EYE_M = 1.7
"""Height of a walker's eye above the ground."""
AROUND = 60.0
"""Of plants in a row, sizes of the ground around them: its edge is hardly told from a horizon."""
SUNK = 1e-3
"""Of its size, how far the ground is below plants in a row: what lies flat on it is seen."""
FILLED = 0.85
"""Of the picture, by what is looked at as a whole: a row, or a stand."""
ASPECT = 4 / 3
"""Of pictures that the eye's first place is chosen for."""
STAND_M = 60.0
"""A landscape of less is looked at from outside."""
MARGIN_M = 1000.0
"""Of flat ground, around its extent and all plants: whoever goes there still stands on it."""
CLEAR_M = 6.0
"""Between the eye's first place, with what is before it, and the nearest crown: enough."""
SEARCHED_M = 24.0
"""Around the wanted place, where a clear one is looked for, a step of CLEAR_M / 3 at a time."""


@dataclass(frozen=True, eq=False)
class World:
    """species: those that the placement counts through. target: (3,) metres, what is orbited about.
    sun: of the scene, or None. way: the file of the scene's camera path, or None. notes: sentences
    for the user."""

    species: tuple[Species, ...]
    placement: Placement
    terrain: Terrain
    ground: GroundMesh | None
    start: Eye
    target: FloatArray
    sun: Sun | None = None
    way: Path | None = None
    notes: tuple[str, ...] = ()

    def height_at(self, x: float, z: float) -> float:
        """Metres: of the ground."""
        return float(self.terrain.height(np.array([[x, z]]))[0])

    @property
    def orbited(self) -> bool:
        """Whether it is a row of plants."""
        return isinstance(self.placement, Row)

    @property
    def progressive(self) -> bool:
        """Whether there are surfels among the levels."""
        return any(one.surfels is not None for one in self.species)

    def scenery(self, fade: FadeMode) -> Scenery:
        """What draws it; nothing is uploaded yet."""
        return Forest(self.species, self.placement, self.ground, fade)

    def details(self, focal_px: float) -> list[str]:
        """What the levels of each species are."""
        found = []
        for one in self.species:
            away_m = one.switch_m * focal_px / one.focal_px
            levels = [
                f"{len(level.faces):,} triangles" + (f" from {away:.3g} m" if away else "")
                for level, away in zip(one.levels, away_m, strict=True)
            ]
            if one.surfels is not None:
                from_m = one.surfels.switch_m * focal_px / one.focal_px
                levels.append(f"surfels from {from_m:.3g} m")
            found.append(f"{one.name}: {', '.join(levels)} ({one.files[0]})")
        return found


@dataclass(frozen=True, eq=False)
class Row:
    """A plant of each species, side by side: a placement of one tile. foot: (n, 3) metres."""

    foot: FloatArray
    tile_m: float
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    crs: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def tiles(self) -> Tiles:
        low, high = self.foot.min(axis=0), self.foot.max(axis=0)
        return Tiles(low[None], high[None], np.array([len(self.foot)]))

    def tallest(self, count: int) -> FloatArray:
        """(count,) metres that no plant of each species is taller than; NaN: the model's own."""
        return np.full(count, np.nan)

    def measured(self, count: int) -> BoolArray:
        """(count,) bool, whether all plants of each species have a height of their own."""
        return np.zeros(count, bool)

    def plants(self, tile: int, most: int | None = None) -> Plants:
        count, origin = len(self.foot), self.foot.mean(axis=0)
        offset = (self.foot - origin).astype(np.float32)
        return Plants(
            origin, offset, np.arange(count, dtype=np.int32), np.zeros(count, np.float32),
            np.full(count, np.nan, np.float32), np.ones((count, 3), np.float32),
            np.arange(1, count + 1),
        )  # fmt: skip


def parts_of(path: Path, scene: Path | None) -> tuple[Path, Path | None]:
    """Where the plants are, and the scene file, if any. Raises UsageError, InputError."""
    if path.suffix.lower() == ".toml":
        if scene is not None:
            raise UsageError(
                f"--scene: expected plants, and a scene for them; got two scenes, {path} and "
                f"{scene}; leave out one of the two"
            )
        return path.parent, path
    if scene is not None and not path.is_dir() and not path.name.endswith(MANIFEST):
        if not path.exists():
            raise InputError(
                f"{path}: expected a folder of converted plants for --scene, found nothing there. "
                "Check the path."
            )
        raise UsageError(
            f"{path}: expected a folder of converted plants beside --scene; got a file. Name the "
            "folder that holds the species' plants; a species' own file is its model = in the scene"
        )
    return path, scene


def read_world(
    path: Path, scene: Path | None, read: ReadOptions, progress: Progress = silent
) -> World:
    """The world of a model, of a folder of converted plants or a manifest, or of a scene with the
    plants of that folder.

    Raises InputError and UsageError for what is missing or broken.
    """
    path, scene = parts_of(path, scene)
    if scene is not None:
        return _landscape(path, read_scene(scene), read, progress)
    converted = path.is_dir() or path.name.endswith(MANIFEST)
    if converted:
        check_reading(read, path)
    species = read_library(path, read, progress)
    return replace(_row(species), notes=() if converted else tuple(notes_on(species[0])))


def _row(species: Sequence[Species]) -> World:
    species = [placed(one)[0] for one in species]
    low, high = (np.array([one.original_bounds[i] for one in species]) for i in (0, 1))
    row = in_a_row(low, high)
    return World(
        tuple(species), Row(row.foot, row.width), row.terrain, row.ground, row.start, row.target
    )


@dataclass(frozen=True, eq=False)
class RowPlan:
    """Where plants stand side by side, on what, and from where they are looked at.

    foot: (n, 3) metres, of their origins. width: metres. start: the first eye. target: (3,) metres,
    what is orbited about.
    """

    foot: FloatArray
    width: float
    terrain: Terrain
    ground: GroundMesh
    start: Eye
    target: FloatArray


def in_a_row(low: FloatArray, high: FloatArray) -> RowPlan:
    """Plants with bounds (n, 3) and (n, 3) metres, whose feet are at a height of 0."""
    middle, widths = (low + high) / 2, np.ptp([low, high], axis=0)[:, [0, 2]].max(axis=1)
    ends = np.cumsum(SPACE * widths)
    foot = np.zeros_like(low)
    foot[:, [0, 2]] = -middle[:, [0, 2]]
    foot[:, 0] += ends - SPACE * widths / 2 - ends[-1] / 2
    top = float(high[:, 1].max())
    size = max(float(ends[-1]), top, 1e-6)
    target = np.array([0.0, top / 2, 0.0])
    depth = float((high - low)[:, 2].max())
    away = _fitting(float(ends[-1]), top, FOV_Y_DEG) + depth / 2
    aside = np.array([0.22, 0.11, 0.97])  # of unit length
    eye = target + aside * away
    yaw, pitch = towards(target - eye)
    near, far = max(min(NEAR_M, size / 100), size / 1000), max(FAR_M, 10 * AROUND * size)
    terrain = Terrain("plane", extent=np.full(2, AROUND * size), base=-SUNK * size)
    start = Eye(eye, yaw, pitch, FOV_Y_DEG, near, far)
    return RowPlan(foot, float(ends[-1]), terrain, _ground(terrain, 1), start, target)


def _fitting(width: float, height: float, fov_y_deg: float) -> float:
    """Metres from which so much fills FILLED of a picture."""
    up = tan(radians(fov_y_deg) / 2) * FILLED
    return max(height / 2 / up, width / 2 / (up * ASPECT))


def _landscape(path: Path, scene: Scene, read: ReadOptions, progress: Progress) -> World:
    terrain = terrain_of(scene)
    placement = placement_of(scene, terrain, TILE_M, lambda s, f: progress(s, f / 2))
    found = species_of(scene, path, read, lambda stage, f: progress(stage, (1 + f) / 2))
    species = found.species
    notes = [*terrain.notes, *placement.notes, *found.notes]
    tiles = placement.tiles
    if not len(tiles):
        raise UsageError(
            f"{scene.path}: expected plants, found none that stands on the ground of the scene. "
            "Check [placement], and where [[species]] may grow"
        )
    start, target = _start(scene, terrain, placement, species)
    low, high = tiles.low.min(axis=0), tiles.high.max(axis=0)
    extent = np.zeros(2) if terrain.extent is None else terrain.extent
    if terrain.kind == "plane":
        reach = 2 * np.maximum(np.abs(low), np.abs(high))[[0, 2]]
        extent = np.maximum(reach, extent) + 2 * MARGIN_M
    ground = None if terrain.kind == "none" else _ground(terrain, CELLS, extent)
    sun = None if scene.light is None else scene.light.sun
    return World(
        species, placement, terrain, ground, start, target, sun, way_of(scene), tuple(notes)
    )


def way_of(scene: Scene) -> Path | None:
    """The file of a scene's camera path."""
    return None if scene.camera.path is None else scene.path.parent / scene.camera.path


def _start(
    scene: Scene, terrain: Terrain, placement: Placement, species: Sequence[Species]
) -> tuple[Eye, FloatArray]:
    """The first eye, and what is orbited about: within a wood, or outside of a stand."""
    tiles, camera = placement.tiles, scene.camera
    low, high = tiles.low.min(axis=0), tiles.high.max(axis=0)
    middle, size = (low + high) / 2, high - low
    fov = camera.fov_y_deg or FOV_Y_DEG
    own, radius = _sizes(species)
    tall = placement.tallest(len(species))
    tall = np.fmax(tall, own)  # those without a height are as tall as their model
    tallest, widest = float(tall.max()), 2 * float((radius * tall / own).max())
    stand = bool(max(size[0], size[2]) < STAND_M)
    if stand:
        away = _fitting(size[0] + widest, tallest, fov)
        xz = np.array([middle[0], high[2] + widest / 2 + away])
    else:
        xz = np.array([middle[0], middle[2] + 0.4 * size[2]])
        xz = _clear(placement, species, xz)
    if terrain.kind == "heightmap" and terrain.extent is not None:
        xz = np.clip(xz, -terrain.extent / 2, terrain.extent / 2)
    middle[1], base = terrain.height(np.stack([middle[[0, 2]], xz]))
    if terrain.kind == "none":  # plants stand where the inventory says
        middle[1] = base = low[1]
    above = EYE_M if camera.height_m is None else float(np.mean(camera.height_m))
    eye = np.array([xz[0], base + above, xz[1]])
    pitch = towards(middle + np.array([0.0, tallest / 2, 0.0]) - eye)[1] if stand else 0.0
    return Eye(eye, 0.0, pitch, fov), middle


def _sizes(species: Sequence[Species]) -> tuple[FloatArray, FloatArray]:
    """(s,) metres each: heights, and how far crowns reach to the side."""
    sizes = np.array([np.ptp(one.original_bounds, axis=0) for one in species])
    return np.array([one.height for one in species]), sizes[:, [0, 2]].max(axis=1) / 2


def _clear(placement: Placement, species: Sequence[Species], xz: FloatArray) -> FloatArray:
    """(2,) a place near another that no crown reaches, nor one a few metres ahead."""
    tiles = placement.tiles
    reach = SEARCHED_M + 2 * CLEAR_M
    apart = np.maximum(tiles.low[:, [0, 2]] - xz, xz - tiles.high[:, [0, 2]]).max(axis=1)
    own_height, own_radius = _sizes(species)
    feet, radii = [np.zeros((0, 2))], [np.zeros(0)]
    for tile in np.flatnonzero(apart < reach):
        plants = placement.plants(int(tile))
        height, radius = own_height[plants.species], own_radius[plants.species]
        scale = np.where(np.isfinite(plants.height), plants.height, height) / height
        hides = scale * height > EYE_M / 2
        feet.append((plants.origin + plants.offset)[hides][:, [0, 2]])
        radii.append((scale * radius)[hides])
    foot, radius = np.concatenate(feet), np.concatenate(radii)
    if not len(foot):
        return xz
    steps = np.arange(-SEARCHED_M, SEARCHED_M + 1e-9, CLEAR_M / 3)
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    places = places[np.argsort((places**2).sum(axis=1), kind="stable")]
    room = np.empty(len(places))
    for index, place in enumerate(xz + places):
        ahead = place - [[0.0, 0.0], [0.0, CLEAR_M / 2], [0.0, CLEAR_M]]
        away = np.linalg.norm(foot - ahead[:, None], axis=2) - radius
        room[index] = away.min()
    return np.asarray(xz + places[np.argmax(np.minimum(room, CLEAR_M / 2))])


def _ground(terrain: Terrain, cells: int, extent: FloatArray | None = None) -> GroundMesh:
    positions, normals, faces = terrain.mesh(
        1 if terrain.grid is None else cells, terrain.extent if extent is None else extent
    )
    return GroundMesh(np.zeros(3), positions, normals, faces)
