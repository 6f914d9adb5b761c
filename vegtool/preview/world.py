"""What is walked through: species, where they stand, the ground, and where the eye begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError, UsageError
from vegtool.formats import ReadOptions
from vegtool.gl.landscape import GroundMesh
from vegtool.preview.eye import FOV_Y_DEG, Eye, towards
from vegtool.preview.library import MANIFEST, Species, read_library
from vegtool.progress import Progress, silent
from vegtool.scene import Scene, read_scene
from vegtool.tiles.placement import Placement, Plants, Tiles, placement_of
from vegtool.tiles.terrain import Terrain, terrain_of

SPACE = 1.25
"""Between plants in a row, in widths of theirs."""
CELLS = 256
"""Squares along the longer side of the ground that is drawn."""
EYE_M = 1.7
"""Height of a walker's eye above the ground."""
AROUND = 6.0
"""Of plants in a row, sizes of the ground around them."""


@dataclass(frozen=True, eq=False)
class World:
    """species: those that the placement counts through. target: (3,) metres, what is orbited about.
    notes: sentences for the user."""

    species: tuple[Species, ...]
    placement: Placement
    terrain: Terrain
    ground: GroundMesh | None
    start: Eye
    target: FloatArray
    notes: tuple[str, ...] = ()

    def height_at(self, x: float, z: float) -> float:
        """Metres: of the ground."""
        return float(self.terrain.height(np.array([[x, z]]))[0])


@dataclass(frozen=True, eq=False)
class Row:
    """A plant of each species, side by side along x: a placement of one tile."""

    x: FloatArray
    tile_m: float
    origin: FloatArray = field(default_factory=lambda: np.zeros(3))
    notes: tuple[str, ...] = ()

    @property
    def tiles(self) -> Tiles:
        low = np.array([[self.x.min(), 0.0, 0.0]])
        high = np.array([[self.x.max(), 0.0, 0.0]])
        return Tiles(low, high, np.array([len(self.x)]))

    def plants(self, tile: int, most: int | None = None) -> Plants:
        count = len(self.x)
        offset = np.zeros((count, 3), np.float32)
        offset[:, 0] = self.x
        return Plants(
            np.zeros(3), offset, np.arange(count, dtype=np.int32), np.zeros(count, np.float32),
            np.full(count, np.nan, np.float32), np.ones((count, 3), np.float32),
            np.arange(1, count + 1),
        )  # fmt: skip


def read_world(
    path: Path, scene: Path | None, read: ReadOptions, progress: Progress = silent
) -> World:
    """The world of a model, of a folder of converted plants or a manifest, or of a scene with the
    plants of that folder.

    Raises InputError and UsageError for what is missing or broken.
    """
    if scene is None and path.suffix.lower() == ".toml":
        path, scene = path.parent, path
    if scene is None:
        return _row(read_library(path, read, progress))
    return _landscape(path, read_scene(scene), read, progress)


def _row(species: Sequence[Species]) -> World:
    widths = np.array([np.ptp(one.levels[0].bounds[:, [0, 2]], axis=0).max() for one in species])
    ends = np.cumsum(SPACE * widths)
    x = ends - SPACE * widths / 2
    x = x - (x[0] + x[-1]) / 2 if len(x) > 1 else np.zeros(1)
    heights = [one.levels[0].bounds[:, 1] for one in species]
    low, high = min(h[0] for h in heights), max(h[1] for h in heights)
    size = max(float(ends[-1]), high - low)
    target = np.array([0.0, (low + high) / 2, 0.0])
    eye = target + np.array([0.25, 0.12, 1.1]) * size
    yaw, pitch = towards(target - eye)
    near = min(0.1, size / 100)
    terrain = Terrain("plane", extent=np.full(2, AROUND * size), base=min(float(low), 0.0))
    start = Eye(eye, yaw, pitch, FOV_Y_DEG, near_m=near)
    return World(
        tuple(species), Row(x, float(ends[-1])), terrain, _ground(terrain, 1), start, target
    )  # fmt: skip


def _landscape(path: Path, scene: Scene, read: ReadOptions, progress: Progress) -> World:
    terrain = terrain_of(scene)
    placement = placement_of(scene, terrain, progress=lambda s, f: progress(s, f / 2))
    species = []
    for index, table in enumerate(scene.species):
        species.append(_species_of(path, scene, index, read))
        progress(f"plants: {table.name or table.model}", (1 + (index + 1) / len(scene.species)) / 2)
    tiles = placement.tiles
    low, high = tiles.low.min(axis=0), tiles.high.max(axis=0)
    middle = (low + high) / 2
    xz = np.array([[middle[0], middle[2] + 0.4 * (high - low)[2]]])
    height = float(terrain.height(xz)[0])
    eye = np.array([xz[0, 0], height + EYE_M, xz[0, 1]])
    fov = scene.camera.fov_y_deg or FOV_Y_DEG
    extent = np.maximum(2 * np.maximum(np.abs(low), np.abs(high))[[0, 2]], 1.0)
    ground = None if terrain.kind == "none" else _ground(terrain, CELLS, extent)
    notes = (*terrain.notes, *placement.notes)
    target = np.array([middle[0], float(terrain.height(middle[None, [0, 2]])[0]), middle[2]])
    return World(tuple(species), placement, terrain, ground, Eye(eye, fov_y_deg=fov), target, notes)


def _species_of(path: Path, scene: Scene, index: int, read: ReadOptions) -> Species:
    """The species of a table: its model, or what was converted under its name."""
    table = scene.species[index]
    if table.model is not None:
        place = scene.path.parent / table.model
        found = read_library(place, read)
        if len(found) == 1:
            return found[0]
        named = [one for one in found if one.name == table.name]
        if len(named) != 1:
            names = ", ".join(one.name for one in found)
            raise UsageError(
                f"{scene.at('species', index, 'model')}: {place} holds {len(found)} plants "
                f"({names}); name one's manifest, NAME{MANIFEST}"
            )
        return named[0]
    folder = path if path.is_dir() else path.parent
    manifest = folder / f"{table.name}{MANIFEST}"
    if table.name is None or not manifest.exists():
        raise InputError(
            f"{scene.at('species', index)}: expected a model, or a plant converted under the name "
            f"of the species, {manifest}; found none. Convert it, or say model = ..."
        )
    return read_library(manifest, read)[0]


def _ground(terrain: Terrain, cells: int, extent: FloatArray | None = None) -> GroundMesh:
    positions, normals, faces = terrain.mesh(
        1 if terrain.grid is None else cells, terrain.extent if extent is None else extent
    )
    return GroundMesh(np.zeros(3), positions, normals, faces)
