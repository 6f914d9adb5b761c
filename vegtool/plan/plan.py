"""What a scene's viewers need of its plants and squares, beside all that there is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, inf
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.errors import UsageError
from vegtool.formats import ReadOptions
from vegtool.lod import Display
from vegtool.needs.levels import levels_needed
from vegtool.needs.need import Need, needs_of
from vegtool.needs.view import view_of
from vegtool.plan.spend import Spent, spent
from vegtool.progress import Progress, part_of, silent
from vegtool.scene import Scene, read_scene
from vegtool.tiles.library import Species
from vegtool.tiles.needed import reached_by
from vegtool.tiles.options import TileOptions
from vegtool.tiles.placement import Placement, placement_of
from vegtool.tiles.pyramid import Pyramid
from vegtool.tiles.quadtree import quadtree_of
from vegtool.tiles.species import species_of
from vegtool.tiles.terrain import terrain_of


@dataclass(frozen=True)
class LevelRow:
    """A level of a species: whether it is needed and why, in words; bytes of its file, triangles,
    calls to draw it, and texels of its textures."""

    species: str
    level: int
    kept: bool
    why: str
    bytes: int
    triangles: int
    draws: int
    texels: int


@dataclass(frozen=True)
class SquareRow:
    """Squares of a side, metres, and how many of them clients can ever be shown."""

    side_m: float
    squares: int
    kept: int


@dataclass(frozen=True, eq=False)
class Plan:
    """needs: of each species. squares: the smallest first. spent: of the scene's budget of bytes,
    if it has one. notes: sentences for the user."""

    scene: Path
    needs: tuple[Need, ...]
    levels: tuple[LevelRow, ...]
    squares: tuple[SquareRow, ...]
    spent: Spent | None
    notes: tuple[str, ...]

    def total(self, what: str, kept: bool = False) -> int:
        """Of `bytes`, `triangles`, `draws` or `texels` of all levels, or of those that are kept."""
        return sum(getattr(row, what) for row in self.levels if row.kept or not kept)


def plan_of(path: Path, library: Path, progress: Progress = silent) -> Plan:
    """What a scene file's viewers need of a library's plants. Nothing is converted or written.

    Raises UsageError, with file and line, for a scene that is broken or contradicts itself;
    InputError for plants that are missing or broken; CapabilityError where nothing can draw and
    the scene has a budget.
    """
    scene = read_scene(path)
    if scene.camera.path is None and not scene.camera.polygon:
        raise UsageError(
            f"{path}: expected where viewers are, path or polygon in [camera]; found neither, so "
            "that everything is needed. docs/scene.md has all keys"
        )
    terrain = terrain_of(scene)
    placement = placement_of(scene, terrain, TileOptions().tile, part_of(progress, 0.0, 0.2))
    if not len(placement.tiles):
        raise UsageError(
            f"{path}: expected plants, found none that stands on the ground of the scene. "
            "Check [placement], and where [[species]] may grow"
        )
    found = species_of(scene, library, ReadOptions(), part_of(progress, 0.2, 0.3))
    needs = needs_of(scene, found.species, placement, terrain, part_of(progress, 0.5, 0.1))
    rows = [row for one, need in zip(found.species, needs, strict=True) for row in _rows(one, need)]
    wanted = scene.budget.get("bytes")
    money = None
    if wanted is not None:
        said = part_of(progress, 0.6, 0.4)
        money = spent(scene, found.species, needs, placement, terrain, wanted, said)
    notes = (*terrain.notes, *placement.notes, *found.notes, *_on_light(scene))
    squares = _squares(path, placement, found.species)
    return Plan(path, needs, tuple(rows), squares, money, tuple(dict.fromkeys(notes)))


def _rows(one: Species, need: Need) -> list[LevelRow]:
    needed, rows = levels_needed(one, need), []
    files = [*one.files, *([] if one.surfels is None else [one.surfels.file])]
    for index, file in enumerate(files):
        triangles = draws = texels = 0
        if index < len(one.levels):
            plant = one.levels[index]
            triangles, draws = len(plant.faces), len(np.unique(plant.face_material))
            textures = {id(t): t for m in plant.materials for t in m.textures}
            texels = sum(t.pixels.shape[0] * t.pixels.shape[1] for t in textures.values())
        else:
            draws = 1
        why = needed.reasons[index].split(": ", 1)[1]
        rows.append(
            LevelRow(
                one.name,
                index,
                bool(needed.kept[index]),
                why,
                file.stat().st_size,
                triangles,
                draws,
                texels,
            )
        )
    return rows


def _squares(path: Path, placement: Placement, species: Sequence[Species]) -> tuple[SquareRow, ...]:
    tree = quadtree_of(placement.tiles, placement.tile_m)
    pyramid = Pyramid(placement, tuple(species), tree, TileOptions(), Display())
    reached = reached_by(pyramid, view_of(path, placement))
    return tuple(
        SquareRow(tree.side_m * 2.0**height, len(tree.nodes(tree.depth - height)), len(kept))
        for height, kept in enumerate(reached)
    )


def _on_light(scene: Scene) -> list[str]:
    light = scene.light
    if light is None:
        return [f"{scene.path}: says nothing of [light]: normal textures stay, for any light"]
    if light.moves:
        return [f"{scene.at('light', 'moves')}: the sun moves: normal textures stay"]
    if light.sun is None:
        return [
            f"{scene.at('light', 'moves')}: the sun does not move; with sun = [azimuth, elevation] "
            "vegtool convert --prelit --scene leaves out normal textures"
        ]
    return [
        f"{scene.at('light', 'sun')}: the sun does not move: vegtool convert --prelit --scene "
        "leaves out normal textures"
    ]


def as_dict(plan: Plan) -> dict[str, Any]:
    """Plain values, for machines; what is infinite is null."""

    def finite(value: float) -> float | None:
        return value if abs(value) < inf else None

    return {
        "scene": str(plan.scene),
        "species": [
            {
                "name": need.name,
                "plants": need.plants,
                "nearest_m": finite(need.nearest),
                "farthest_m": finite(need.farthest),
                "azimuth_deg": [degrees(a) for a in need.azimuth],
                "elevation_deg": [degrees(a) for a in need.elevation],
                "largest_px": finite(need.largest_px),
                "light": need.lit,
            }
            for need in plan.needs
        ],
        "levels": [row.__dict__ for row in plan.levels],
        "squares": [row.__dict__ for row in plan.squares],
        "before": {what: plan.total(what) for what in TOLD},
        "after": {what: plan.total(what, kept=True) for what in TOLD},
        "budget": None if plan.spent is None else plan.spent.as_dict(),
        "notes": list(plan.notes),
    }


TOLD = ("bytes", "triangles", "draws", "texels")
"""What is added up."""
