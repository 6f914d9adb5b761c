"""A folder of plants, and by what names they are found in it.

A species is, in this order: a table of `species.toml`, which may name any file or folder and may
have other names; a converted plant, NAME.lod.json; a model of that name; a folder of that name
with one plant in it. Capitals do not matter. Described in docs/species.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vegtool.batch import models_in
from vegtool.errors import InputError, UsageError
from vegtool.formats import UP_AXES, ReadOptions
from vegtool.scene import Key, Pair, SpeciesTable, check_value, file_and_line, read_toml
from vegtool.tiles.library import MANIFEST

TABLES = "species.toml"
"""In the folder, where there is one."""
KEYS = {
    "model": Key("text", "file or folder of the plant; by default what has the species' name"),
    "aliases": Key("names", "other names that inventories and scenes call it"),
    "height_m": Key(
        "range", "of plants whose height the inventory does not say", least=0.001, most=1000
    ),
    "unit": Key("text", "of the model, as --unit of convert"),
    "up": Key("text", "its upward axis, as --up", choices=UP_AXES),
    "leaf_material": Key("names", "its materials that are leaves, as --leaf-material"),
}
"""Of a table of species.toml."""


@dataclass(frozen=True)
class Source:
    """Where a plant is. path: of a manifest or a model. read: how a model is to be understood."""

    path: Path
    read: ReadOptions = field(default_factory=ReadOptions)

    @property
    def converted(self) -> bool:
        """Whether it has levels already."""
        return self.path.name.endswith(MANIFEST)


@dataclass(frozen=True)
class Entry:
    """A table of species.toml. model: where its plant is; None where that has its name. at: file
    and line."""

    name: str
    at: str
    model: Path | None = None
    aliases: tuple[str, ...] = ()
    height_m: Pair | None = None
    read: ReadOptions = field(default_factory=ReadOptions)


@dataclass(frozen=True)
class Library:
    """A folder of plants. entries: by all their names. The others: what else is in it, sorted."""

    folder: Path
    entries: Mapping[str, Entry]
    manifests: tuple[Path, ...]
    models: tuple[Path, ...]
    folders: tuple[Path, ...]

    def told(self, name: str) -> Source | None:
        """What species.toml has under a name.

        Raises UsageError where there is more than one such plant, or a reason to doubt that it is
        meant, InputError where there is none.
        """
        entry = self.entries.get(same(name))
        if entry is None:
            return None
        if entry.model is None:
            source = self.lying(entry.name)
            if source is None:
                raise InputError(
                    f"{entry.at}: expected a plant called {entry.name!r} in {self.folder}, found "
                    "none. Put it there, or say model = ..."
                )
        else:
            source = Source(plant_at(entry.model, entry.name, entry.at))
        if source.converted and entry.read != ReadOptions():
            raise UsageError(
                f"{entry.at}: unit, up and leaf_material say how a model is read; {source.path} is "
                "converted already, in metres and y up. Leave them out"
            )
        return Source(source.path, entry.read)

    def converted(self, name: str) -> Source | None:
        """The manifest of that name. Raises UsageError where there is more than one."""
        found = [one for one in self.manifests if same(stem(one)) == same(name)]
        return Source(self._only(name, found)) if found else None

    def lying(self, name: str) -> Source | None:
        """What lies in the folder under a name. Raises UsageError for more than one such plant."""
        if source := self.converted(name):
            return source
        if models := [one for one in self.models if same(stem(one)) == same(name)]:
            return Source(self._only(name, models))
        if folders := [one for one in self.folders if same(one.name) == same(name)]:
            folder = self._only(name, folders)
            return Source(plant_at(folder, name, str(self.folder)))
        return None

    def find(self, name: str) -> Source | None:
        """The plant of a species, if there is one. Raises as `told` does."""
        return self.told(name) or self.lying(name)

    def species(self) -> tuple[SpeciesTable, ...]:
        """All that plants of an inventory may be, by name.

        Raises UsageError where an alias is the name of another plant.
        """
        entries = list(dict.fromkeys(self.entries.values()))
        named = [entry.model.resolve() for entry in entries if entry.model is not None]
        taken = {*named, *(one.parent for one in named)}
        names = {same(entry.name): entry.name for entry in entries}
        converted = {same(stem(one)) for one in self.manifests}
        models = [one for one in self.models if same(stem(one)) not in converted]
        there = [*self.manifests, *models, *filter(_holds_plants, self.folders)]
        for path in there:
            name = path.name if path in self.folders else stem(path)
            if path.resolve() in taken or same(name) in names:
                continue
            if same(name) in self.entries:
                raise UsageError(
                    f"{self.entries[same(name)].at}: aliases: expected names that no other plant "
                    f"has; {path} is called {name} too. Leave it out, or say model = ..."
                )
            names[same(name)] = name
        found = {
            entry.name: SpeciesTable(entry.name, height_m=entry.height_m, aliases=entry.aliases)
            for entry in entries
        }
        return tuple(found.get(name, SpeciesTable(name)) for name in sorted(names.values()))

    def _only(self, name: str, found: Sequence[Path]) -> Path:
        if len(found) > 1:
            listed = ", ".join(one.name for one in found)
            raise UsageError(
                f"{self.folder}: expected one plant called {name!r}, found {listed}. Say which in "
                f"{TABLES}: model = ..., or rename one"
            )
        return found[0]


def library_at(path: Path) -> Library:
    """The plants of a folder.

    Raises InputError where there is no folder or it cannot be read, UsageError for a file in its
    place and, with file and line, for a species.toml that makes no sense.
    """
    if not path.exists():
        raise InputError(
            f"{path}: expected a folder of plants, found nothing there. Check the path."
        )
    if not path.is_dir():
        raise UsageError(
            f"{path}: expected a folder of plants, one for each species; got a file. Name the "
            "folder that it is in"
        )
    models = tuple(models_in(path))  # says so where the folder cannot be read
    inside = sorted(path.iterdir())
    manifests = tuple(one for one in inside if one.name.endswith(MANIFEST))
    folders = tuple(one for one in inside if one.is_dir() and not one.name.startswith("."))
    tables = path / TABLES
    entries = _entries(tables) if tables.exists() else {}
    return Library(path, entries, manifests, models, folders)


def plant_at(place: Path, name: str | None, at: str) -> Path:
    """The manifest or model of a plant at a place: that itself, or in a folder the only one, or the
    one of that name; manifests before models. at: who says so.

    Raises UsageError where a folder has none, or several.
    """
    if not place.is_dir():
        return place
    found = sorted(place.glob(f"*{MANIFEST}")) or models_in(place)
    named = [one for one in found if name is not None and same(stem(one)) == same(name)]
    if len(named or found) != 1:
        names = ", ".join(one.name for one in found) or "no plant"
        raise UsageError(
            f"{at}: expected one plant in {place}, or one of the species' name; found {names}. "
            f"Name a manifest, NAME{MANIFEST}, or a model"
        )
    return (named or found)[0]


def same(name: str) -> str:
    """What two names have in common that mean the same."""
    return name.strip().casefold()


def stem(path: Path) -> str:
    """The name of the plant of a manifest or a model."""
    return path.name.removesuffix(MANIFEST) if path.name.endswith(MANIFEST) else path.stem


def _holds_plants(folder: Path) -> bool:
    return any(folder.glob(f"*{MANIFEST}")) or bool(models_in(folder))


def _entries(path: Path) -> dict[str, Entry]:
    """The tables of a species.toml, by all their names."""
    values, lines = read_toml(path, "list of species")
    found: dict[str, Entry] = {}
    for name, table in values.items():
        at = file_and_line(path, lines, (name,))
        if not isinstance(table, dict):
            raise UsageError(f"{at}: expected a table [NAME] for each species; got {name} = ...")
        for key, value in table.items():
            place = file_and_line(path, lines, (name, key))
            if key not in KEYS:
                raise UsageError(
                    f"{place}: no key of a species is called {key!r}; known: {', '.join(KEYS)}"
                )
            check_value(place, key, KEYS[key], value)
        entry = _entry(path, name, at, table)
        if entry.model is not None and not entry.model.exists():
            raise InputError(
                f"{file_and_line(path, lines, (name, 'model'))}: expected a file or a folder, "
                f"{entry.model}, found nothing there. Check the name"
            )
        for other in (name, *entry.aliases):
            if found.setdefault(same(other), entry) is not entry:
                raise UsageError(
                    f"{file_and_line(path, lines, (name, 'aliases'))}: two species are called "
                    f"{other}: [{found[same(other)].name}] and [{name}]; leave out one"
                )
    return found


def _entry(path: Path, name: str, at: str, table: Mapping[str, Any]) -> Entry:
    model = path.parent / table["model"] if "model" in table else None
    height_m = tuple(table["height_m"]) if "height_m" in table else None
    try:
        read = ReadOptions(
            table.get("unit", "m"), table.get("up", "auto"), tuple(table.get("leaf_material", ()))
        )
    except UsageError as error:
        raise UsageError(f"{at}: {str(error).removeprefix('--')}") from error
    aliases = tuple(one for one in table.get("aliases", ()) if same(one) != same(name))
    return Entry(
        name, at, model, tuple({same(one): one for one in aliases}.values()), height_m, read
    )
