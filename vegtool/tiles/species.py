"""The species of a scene as they stand in it: found in a library, their feet at the origin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vegtool.errors import InputError, UsageError
from vegtool.formats import ReadOptions
from vegtool.progress import Progress, silent
from vegtool.scene import Scene
from vegtool.tiles.library import MANIFEST, Species, read_library

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
    """The plants of all [[species]], from a folder of converted plants (or a manifest in it), or as
    the scene names their models.

    Raises InputError and UsageError for what is missing or broken.
    """
    sources = [source_of(folder, scene, index) for index in range(len(scene.species))]
    if all(source.name.endswith(MANIFEST) for source in sources):
        check_reading(read, folder)
    species: list[Species] = []
    notes: list[str] = []
    for source, table in zip(sources, scene.species, strict=True):
        progress(f"plants: {table.name or source.name}", len(species) / len(sources))
        (one,) = read_library(source, read)
        stands, away = placed(one)
        low, high = stands.levels[0].bounds
        if not high[1] > FLAT * (high - low).max():
            raise InputError(
                f"{source}: expected a plant that has a height, y up, found one that is flat: "
                f"{high[1]:.3g} m high. Where another axis is up, convert it with --up"
            )
        species.append(stands)
        if not source.name.endswith(MANIFEST):
            notes.append(f"{source}: has no levels of detail; vegtool convert makes them")
            notes += notes_on(one)
        if away:
            notes.append(
                f"{source}: is {away:,.1f} m away from the origin of its file; what is placed is "
                "its middle, on the ground"
            )
    return Found(tuple(species), tuple(notes))


def check_reading(read: ReadOptions, path: Path) -> None:
    """Raise UsageError where options say how to read what is converted already."""
    if read != ReadOptions():
        raise UsageError(
            f"--unit, --up and --leaf-material say how a model is read; {path} is converted "
            "already, in metres and y up. Leave them out"
        )


def source_of(path: Path, scene: Scene, index: int) -> Path:
    """The file of a table's species: what was converted under its name or its model's, else its
    model."""
    table = scene.species[index]
    folder = path if path.is_dir() else path.parent
    place = None if table.model is None else scene.path.parent / table.model
    if place is not None and place.name.endswith(MANIFEST):
        return place
    if place is not None and place.is_dir():
        return _manifest_in(place, scene, index)
    names = [table.name, None if place is None else place.stem]
    converted = [folder / f"{name}{MANIFEST}" for name in names if name is not None]
    for manifest in converted:
        if manifest.exists():
            return manifest
    if place is None:
        wanted = converted[0] if converted else folder / f"NAME{MANIFEST}"
        raise InputError(
            f"{scene.at('species', index)}: expected a model, or a plant converted under the name "
            f"of the species, {wanted}; found none. Convert it, or say model = ..."
        )
    if not place.exists():
        raise InputError(
            f"{scene.at('species', index, 'model')}: expected the model {place}, or the plant "
            f"converted, {converted[0]}; found neither. Check the names"
        )
    return place


def _manifest_in(place: Path, scene: Scene, index: int) -> Path:
    """The manifest of a species in a folder that the scene names."""
    found = sorted(place.glob(f"*{MANIFEST}"))
    named = [one for one in found if one.name == f"{scene.species[index].name}{MANIFEST}"]
    if len(named or found) != 1:
        names = ", ".join(one.name for one in found) or "no manifest"
        raise UsageError(
            f"{scene.at('species', index, 'model')}: expected one plant in {place}, or one of the "
            f"species' name; found {names}. Name a manifest, NAME{MANIFEST}"
        )
    return (named or found)[0]


def notes_on(one: Species) -> list[str]:
    """What was guessed when a model was read."""
    return [f"{one.files[0]}: {note}" for note in one.levels[0].notes]


def placed(one: Species) -> tuple[Species, float]:
    """The plant with its foot at the origin, as it is to stand; and how many metres it was off.

    One that is about there already is as it was: a crown may lean, and roots go into the ground.
    """
    low, high = one.levels[0].bounds
    size = high - low
    shift = np.zeros(3)
    if np.abs(low + high)[[0, 2]].max() / 2 > BESIDE * size.max():
        shift[[0, 2]] = -(low + high)[[0, 2]] / 2
    if abs(low[1]) > ROOTED * size.max():
        shift[1] = -low[1]
    if not shift.any():
        return one, 0.0
    levels = tuple(
        replace(level, positions=level.positions + shift, branches=None) for level in one.levels
    )
    return replace(one, levels=levels), float(np.linalg.norm(shift))
