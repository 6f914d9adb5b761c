"""The species of a scene as they stand in it: found in a library, their feet at the origin."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import InputError, UsageError
from vegtool.formats import ReadOptions
from vegtool.progress import Progress, silent
from vegtool.scene import Scene
from vegtool.tiles.library import MANIFEST, Species, read_library
from vegtool.tiles.named import TABLES, Library, Source, library_at, plant_at

ROOTED, BESIDE = 0.1, 1.0
"""Of its size, how far below or above the origin of its file a plant that stands there may begin,
and how far beside it its middle may be."""
FLAT = 1e-3
"""Of its size: a plant of no more height cannot be made as high as it is to be."""


@dataclass(frozen=True, eq=False)
class Found:
    """The species that a scene's placement counts through, and sentences for the user."""

    species: tuple[Species, ...]
    notes: tuple[str, ...]


def species_of(scene: Scene, folder: Path, read: ReadOptions, progress: Progress = silent) -> Found:
    """The plants of all [[species]], from a folder of plants (or a manifest in it), or as the scene
    names their models. Nothing is converted: a model has no levels but itself.

    Raises InputError and UsageError for what is missing or broken.
    """
    library = library_at(folder_of(folder))
    sources = [source_of(library, scene, index) for index in range(len(scene.species))]
    if all(source.converted for source in sources):
        check_reading(read, folder)
    species: list[Species] = []
    notes: list[str] = []
    for source, table in zip(sources, scene.species, strict=True):
        path, usual = source.path, source.read == ReadOptions()
        progress(f"plants: {table.name or path.name}", len(species) / len(sources))
        (one,) = read_library(path, read if usual else source.read)
        stands, away = placed(one)
        check_height(path, stands.original_bounds)
        species.append(stands)
        if not source.converted:
            notes.append(f"{path}: has no levels of detail; vegtool convert makes them")
            notes += notes_on(one)
        if away:
            notes.append(note_on_place(path, away))
    return Found(tuple(species), tuple(notes))


def folder_of(path: Path) -> Path:
    """The folder of plants that is meant by itself, or by a manifest in it."""
    return path.parent if path.name.endswith(MANIFEST) and not path.is_dir() else path


def check_reading(read: ReadOptions, path: Path) -> None:
    """Raise UsageError where options say how to read what is converted already."""
    if read != ReadOptions():
        raise UsageError(
            f"--unit, --up and --leaf-material say how a model is read; {path} is converted "
            "already, in metres and y up. Leave them out"
        )


def check_height(path: Path, bounds: FloatArray) -> None:
    """Raise InputError for a plant, of bounds (2, 3), that no height can be given to."""
    low, high = bounds
    if not high[1] > FLAT * (high - low).max():
        raise InputError(
            f"{path}: expected a plant that has a height, y up, found one that is flat: "
            f"{high[1]:.3g} m high. Where another axis is up, convert it with --up"
        )


def source_of(library: Library, scene: Scene, index: int) -> Source:
    """The plant of a table's species: what the library has under its name or its model's, unless
    the table names a manifest or a folder; else its model.

    Raises InputError where there is none, UsageError where there are several.
    """
    table, at = scene.species[index], scene.at("species", index)
    place = None if table.model is None else scene.path.parent / table.model
    if place is not None and (place.name.endswith(MANIFEST) or place.is_dir()):
        return Source(plant_at(place, table.name, scene.at("species", index, "model")))
    names = [name for name in (table.name, None if place is None else place.stem) if name]
    ways = [library.told, library.converted if place is not None else library.lying]
    for way, name in ((way, name) for way in ways for name in names):
        if (found := way(name)) is not None:
            return found
    if place is None:
        wanted = f"{names[0]!r}" if names else "as the species"
        raise InputError(
            f"{at}: expected a model, or a plant called {wanted} in {library.folder}: a table of "
            f"{TABLES}, NAME{MANIFEST}, a model or a folder; found none. Convert it, or say "
            "model = ..."
        )
    if not place.exists():
        raise InputError(
            f"{scene.at('species', index, 'model')}: expected the model {place}, or the plant "
            f"converted, {library.folder / names[0]}{MANIFEST}; found neither. Check the names"
        )
    return Source(place)


def notes_on(one: Species) -> list[str]:
    """What was guessed when a model was read."""
    return [f"{one.files[0]}: {note}" for note in one.levels[0].notes]


def note_on_place(path: Path, away: float) -> str:
    """What is said of a plant that many metres from the origin of its file."""
    return (
        f"{path}: is {away:,.1f} m away from the origin of its file; what is placed is its middle, "
        "on the ground"
    )


def placed(one: Species) -> tuple[Species, float]:
    """The plant with its foot at the origin, as it is to stand; and how many metres it was off.

    One that is about there already is as it was: a crown may lean, and roots go into the ground.
    """
    shift = shift_of(one.original_bounds)
    if not shift.any():
        return one, 0.0
    return one.moved(shift), float(np.linalg.norm(shift))


def shift_of(bounds: FloatArray) -> FloatArray:
    """(3,) metres by which a plant of bounds (2, 3) is moved to its place."""
    low, high = bounds
    size = high - low
    shift = np.zeros(3)
    if np.abs(low + high)[[0, 2]].max() / 2 > BESIDE * size.max():
        shift[[0, 2]] = -(low + high)[[0, 2]] / 2
    if abs(low[1]) > ROOTED * size.max():
        shift[1] = -low[1]
    return shift
