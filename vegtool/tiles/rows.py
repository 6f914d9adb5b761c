"""The rows of an inventory as numbers: positions, species, heights and turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib import import_module

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.errors import InputError, UsageError
from vegtool.scene import Scene
from vegtool.tiles.columns import Columns, columns_of
from vegtool.tiles.table import Table, Value

READERS = {
    ".csv": "vegtool.tiles.read_csv",
    ".tsv": "vegtool.tiles.read_csv",
    ".txt": "vegtool.tiles.read_csv",
    ".geojson": "vegtool.tiles.read_geojson",
    ".json": "vegtool.tiles.read_geojson",
    ".gpkg": "vegtool.tiles.read_gpkg",
    ".las": "vegtool.tiles.read_las",
    ".laz": "vegtool.tiles.read_las",
}
"""File name extension -> module whose `read(path)` gives a Table."""

TALLEST_M = 150.0
"""Metres; the tallest trees known have 116."""
LOWEST_M = 0.001
"""Metres: a plant that is lower has no height that anybody measured."""
FARTHEST_M = 1e9
"""Metres from the map's origin: beyond, float64 is not a millimetre any more."""


@dataclass(frozen=True, eq=False)
class Rows:
    """What a file says of its n rows.

    x, y, z: (n,) float64 metres east, north and up on the map; degrees of longitude and latitude
    if geographic. species: (n,) int32 index into the scene's. height: (n,) metres, yaw: (n,)
    radians; they and z are NaN where the file does not say. row: (n,) int64, from 1.
    table: whose rows they are. columns: what they were read from.
    notes: sentences on what was guessed or left out; to be shown to the user.
    """

    x: FloatArray
    y: FloatArray
    z: FloatArray
    species: IntArray
    height: FloatArray
    yaw: FloatArray
    row: np.ndarray
    table: Table
    columns: Columns
    notes: tuple[str, ...]

    def at(self, index: int) -> str:
        """File and row."""
        return f"{self.table.path}, {self.table.place(int(self.row[index]))}"

    def only(self, kept: np.ndarray) -> Rows:
        """Those of them for which `kept`, (n,) bool, is true."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        parts = {n: v[kept] if isinstance(v, np.ndarray) else v for n, v in values.items()}
        return Rows(**parts)


def read_rows(scene: Scene) -> Rows:
    """The rows of a scene's inventory.

    Raises InputError, with row and column, for a file that is missing, broken or empty, for values
    that cannot be and for species that the scene does not have; UsageError for a [placement] or
    [[species]] that makes no sense.
    """
    table = _table(scene)
    columns = columns_of(table, scene)
    kinds = _Kinds(scene, table, columns)
    wanted = list(columns.number.values())
    meanings = list(columns.number)
    parts: list[dict[str, np.ndarray]] = []
    first = 1
    for values in table.parts(wanted):
        part = dict(zip(meanings, values, strict=True))
        parts.append(_part(table, columns, kinds, part, first))
        first += len(values[0])
    if first == 1:
        raise InputError(f"{table.path}: expected a row for each plant, found none; add some")
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    notes = [*table.notes, *columns.notes]
    nothing = whole["height"] < LOWEST_M
    if nothing.any():
        whole["height"][nothing] = np.nan
        count = int(np.count_nonzero(nothing))
        notes.append(f"{table.path}: plants of height 0, taken as not known: {count:,}")
    if columns.ignored:
        notes.append(f"{table.path}: columns that are not used: {', '.join(columns.ignored)}")
    return Rows(**whole, row=np.arange(1, first), table=table, columns=columns, notes=tuple(notes))


def _table(scene: Scene) -> Table:
    path = scene.path.parent / str(scene.placement.inventory)
    named = f"inventory in {scene.at('placement', 'inventory')}"
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"{path}: expected an inventory ({', '.join(READERS)}), found "
            f"{path.suffix or 'no file name extension'}; export it as one of these, for example "
            f"with ogr2ogr ({named})"
        )
    try:
        table: Table = import_module(reader).read(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check {named}") from error
    return table


def _part(
    table: Table, columns: Columns, kinds: _Kinds, values: dict[str, Sequence[Value]], first: int
) -> dict[str, np.ndarray]:
    """Some of the rows."""
    count = len(values["x"])
    found: dict[str, np.ndarray] = {"species": kinds.indices(values.get("species"), count, first)}
    for meaning in ("x", "y", "z", "height", "yaw"):
        if meaning not in values:
            found[meaning] = np.full(count, np.nan)
            continue
        name, needed = table.names[columns.number[meaning]], meaning in ("x", "y")
        numbers = table.numbers(values[meaning], name, first, needed)
        if not (needed and columns.geographic):
            numbers *= columns.factor[meaning]
        found[meaning] = numbers
    limit = (180.0, 90.0) if columns.geographic else (FARTHEST_M, FARTHEST_M)
    unit = "degrees" if columns.geographic else "m"
    for meaning, least, most, remedy in (
        ("x", -limit[0], limit[0], ""),
        ("y", -limit[1], limit[1], ""),
        ("height", 0.0, TALLEST_M, "say the column's unit with units in [placement]"),
    ):
        wrong = np.flatnonzero((found[meaning] < least) | (found[meaning] > most))
        if wrong.size:
            index, unit = int(wrong[0]), "m" if meaning == "height" else unit
            raise table.error(
                first + index,
                table.names[columns.number[meaning]],
                f"{least:g} to {most:g} {unit}",
                values[meaning][index],
                remedy,
            )
    return found


class _Kinds:
    """Which of the scene's species a name is."""

    def __init__(self, scene: Scene, table: Table, columns: Columns) -> None:
        self.table, self.known, self.names = table, dict[str, int](), list[str]()
        self.met: dict[Value, int] = {}
        self.column = columns.number.get("species")
        if self.column is None:
            if len(scene.species) > 1:
                raise InputError(
                    f"{table.path}: expected a column with species, as the scene has "
                    f"{len(scene.species)}, found {', '.join(map(repr, table.names))}; choose one "
                    'with columns = { species = "..." } in [placement]'
                )
            return
        for index, kind in enumerate(scene.species):
            at = scene.at("species", index, "name")
            if kind.name is None:
                raise UsageError(
                    f"{at}: expected a name, by which {table.path} can call it; got none"
                )
            for plain, name in {_plain(name): name for name in (kind.name, *kind.aliases)}.items():
                if plain in self.known:
                    raise UsageError(f"{at}: name: two species are called {name}; rename one")
                self.known[plain] = index
            self.names.append(kind.name)
        self.remedy = "correct it, or add a [[species]] of that name to the scene"
        if scene.path == table.path:
            self.remedy = (
                "correct it, or put a plant of that name, or with it as an alias, into the library"
            )

    def indices(self, values: Sequence[Value] | None, count: int, first: int) -> IntArray:
        """(n,) int32 of the species of rows, `first` being the number of the first."""
        if values is None or self.column is None:
            return np.zeros(count, dtype=np.int32)
        for value in dict.fromkeys(values):
            if value not in self.met:
                index = self.known.get(_plain(value))
                if index is None:
                    raise self.table.error(
                        first + list(values).index(value),
                        self.table.names[self.column],
                        f"one of {', '.join(self.names)}",
                        value,
                        self.remedy,
                    )
                self.met[value] = index
        return np.fromiter(map(self.met.__getitem__, values), np.int32, count)


def _plain(name: Value) -> str:
    return "" if name is None else str(name).strip().casefold()
