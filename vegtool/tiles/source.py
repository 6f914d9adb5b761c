"""The scene that a command is given: a scene file, or an inventory and a library of its species."""

from __future__ import annotations

from pathlib import Path

from vegtool.errors import InputError, UsageError
from vegtool.formats import READERS
from vegtool.scene import PlacementTable, Scene, read_scene
from vegtool.tiles.library import MANIFEST
from vegtool.tiles.named import TABLES, library_at
from vegtool.tiles.rows import READERS as INVENTORIES
from vegtool.tiles.species import folder_of


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
    species = library_at(folder_of(library)).species()
    if not species:
        raise InputError(
            f"{library}: expected a folder of plants, one for each species: converted "
            f"(NAME{MANIFEST}), models ({', '.join(READERS)}), folders of one, or {TABLES}; found "
            "none in it. Put plants into it"
        )
    return Scene(path, species=species, placement=PlacementTable(inventory=path.name))
