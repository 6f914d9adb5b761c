"""The scene that a command is given: a scene file, or an inventory and a library of its species."""

from __future__ import annotations

from pathlib import Path

from vegtool.errors import InputError, UsageError
from vegtool.scene import PlacementTable, Scene, SpeciesTable, read_scene
from vegtool.tiles.library import MANIFEST

INVENTORIES = (".csv", ".tsv", ".txt", ".json", ".geojson", ".gpkg", ".las", ".laz")
"""Extensions of files with a row per plant."""


def scene_at(path: Path, library: Path) -> Scene:
    """The scene of a file. Of an inventory: one whose species are those of the library.

    Raises UsageError and InputError for what is missing or broken.
    """
    if path.suffix.lower() == ".toml":
        return read_scene(path)
    if path.suffix.lower() not in INVENTORIES:
        raise UsageError(
            f"{path}: expected a scene (.toml) or an inventory ({', '.join(INVENTORIES)})"
        )
    if not path.exists():
        raise InputError(f"{path}: expected an inventory, found nothing there. Check the path.")
    names = sorted(file.name.removesuffix(MANIFEST) for file in library.glob(f"*{MANIFEST}"))
    if not names:
        raise InputError(
            f"{library}: expected a folder of converted plants (NAME{MANIFEST}), one for each "
            "species, found no manifest in it. Convert plants into it"
        )
    species = tuple(SpeciesTable(name=name) for name in names)
    return Scene(path, species=species, placement=PlacementTable(inventory=path.name))
