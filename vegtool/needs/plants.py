"""What the eyes of a scene need of the plants that are converted for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path

import numpy as np

from vegtool.errors import InputError
from vegtool.formats import ReadOptions
from vegtool.limits import Limits, between
from vegtool.needs.need import Need, ball_of, needs_of
from vegtool.needs.viewers import viewers_of
from vegtool.progress import Progress, silent
from vegtool.scene import Scene, SpeciesTable
from vegtool.tiles.library import Species, read_library
from vegtool.tiles.limits import digest_of
from vegtool.tiles.named import Source, library_at, same
from vegtool.tiles.placement import placement_of
from vegtool.tiles.species import check_height, folder_of, placed, shift_of, source_of
from vegtool.tiles.terrain import terrain_of


@dataclass(frozen=True)
class Limited:
    """limits: of each plant that has some, by its file. notes: sentences for the user."""

    limits: Mapping[Path, Limits]
    notes: tuple[str, ...] = ()


def says_so(scene: Scene) -> bool:
    """Whether a scene says from where which plants are seen."""
    seen = scene.camera.path is not None or bool(scene.camera.polygon)
    there = scene.placement.inventory is not None or scene.placement.spacing_m is not None
    return seen and there and bool(scene.species)


def limits_of(
    scene: Scene, sources: Sequence[Path], read: ReadOptions, progress: Progress = silent
) -> Limited:
    """The eyes that each plant is for that is one of the scene's species, by file or by name.

    None where the scene does not say from where it is seen, and where some species of it is not to
    be found. Raises UsageError and InputError, with file and line, for a scene that contradicts
    itself or names what is missing or broken.
    """
    if not says_so(scene):
        return Limited({})
    own = [_source(scene, table, sources) for table in scene.species]
    unknown = [f"{path}: is no species of {scene.path}: it is converted whole"
               for path in sources if path not in own]  # fmt: skip
    if not any(own):
        return Limited({}, tuple(unknown))
    try:
        models = [_model(scene, index, path, read, sources) for index, path in enumerate(own)]
    except InputError as error:
        return Limited({}, (f"{error}; until then, plants are converted whole",))
    species = [placed(one)[0] for one in models]
    ground = terrain_of(scene)
    placement = placement_of(scene, ground, progress=lambda s, f: progress(s, f / 2))
    needs = needs_of(scene, species, placement, ground, lambda s, f: progress(s, (1 + f) / 2))
    digest, limits = digest_of(scene), dict[Path, Limits]()
    notes = list(viewers_of(scene, ground, placement).notes)
    for path in dict.fromkeys(one for one in own if one is not None):
        kinds = [index for index, one in enumerate(own) if one == path]
        found = [needs[index] for index in kinds if needs[index].plants]
        if not found:
            notes.append(f"{path}: no plant of it stands in {scene.path}: it is converted whole")
            continue
        limits[path] = _limits(found, models[kinds[0]], digest)
        notes.append(f"{path}: is made for {_said(found, limits[path])}")
    return Limited(limits, (*notes, *unknown))


def _source(scene: Scene, table: SpeciesTable, sources: Sequence[Path]) -> Path | None:
    """The file that a table's species is, if it is among those that are converted: by its file,
    else by its name."""
    if table.model is not None:
        model = (scene.path.parent / table.model).resolve()
        for path in sources:
            if path.resolve() == model:
                return path
    names = {same(name) for name in (table.name, *table.aliases) if name}
    found = [path for path in sources if same(path.stem) in names]
    return found[0] if len(found) == 1 else None


def _model(
    scene: Scene, index: int, own: Path | None, read: ReadOptions, sources: Sequence[Path]
) -> Species:
    """The model of a species: among what is converted, or beside it."""
    if own is not None:
        source = Source(own, read)
    else:
        source = source_of(library_at(folder_of(sources[0].parent)), scene, index)
    (one,) = read_library(source.path, source.read)
    check_height(source.path, placed(one)[0].original_bounds)
    return one


def _limits(needs: Sequence[Need], one: Species, digest: str) -> Limits:
    """Of all that a plant stands for."""
    azimuth, first = (0.0, 360.0), needs[0]
    if all(need.azimuth == first.azimuth for need in needs):
        azimuth = (degrees(first.azimuth[0]), degrees(first.azimuth[1]))
    low = min(need.elevation[0] for need in needs)
    high = max(need.elevation[1] for need in needs)
    x, y, z = shift_of(one.original_bounds).tolist()
    return Limits(
        digest,
        min(need.nearest for need in needs),
        max(need.farthest for need in needs),
        azimuth,
        (degrees(low), degrees(high)),
        first.display,
        (-x, ball_of(placed(one)[0])[0] - y, -z),
    )


def _said(needs: Sequence[Need], limits: Limits) -> str:
    count = sum(need.plants for need in needs)
    low, high = limits.elevation_deg
    largest = max(need.largest_px for need in needs)
    size = "" if np.isinf(largest) else f", at most {largest:,.0f} pixels large"
    away = between(limits.nearest_m, limits.farthest_m)
    return (
        f"the eyes that see its {count:,} plants {away} away (at its own size), from {round(low)} "
        f"to {round(high)} degrees above the horizon{size}"
    )
