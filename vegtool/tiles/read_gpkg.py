"""Inventories as GeoPackage: an SQLite database with a table of points, each with attributes.

Source: OGC 12-128r18, GeoPackage 1.3: sections 1.1 (tables that describe others) and 2.1.3 (points
as well-known binary behind a header of their own).
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from vegtool.errors import InputError, UsageError
from vegtool.tiles.projection import is_world
from vegtool.tiles.table import Part, Table, Value
from vegtool.tiles.wkt import described

ROWS = 8192
"""Of a part."""
ENVELOPE = (0, 32, 48, 48, 64)
"""Bytes of the box in a header, by its kind."""
EMPTY = 0x10
"""Flag in a header: the geometry has no coordinates."""
KINDS = ("unknown", "Point", "LineString", "Polygon", "MultiPoint", "MultiLineString",
         "MultiPolygon", "GeometryCollection")  # fmt: skip
"""By their numbers, of which 1000 are added for z, and 2000 for a measure."""
POINT, WITH_Z = 1, (1, 3)
UNDEFINED = {-1: False, 0: True}
"""Reference systems that are not known: whether they are of longitude and latitude."""
FEATURES = """
    SELECT table_name, column_name, z, g.srs_id, organization, organization_coordsys_id, definition
    FROM gpkg_geometry_columns AS g JOIN gpkg_contents USING (table_name)
    LEFT JOIN gpkg_spatial_ref_sys AS s ON s.srs_id = g.srs_id
    WHERE data_type = 'features' ORDER BY table_name
"""


@dataclass(frozen=True)
class _Features:
    """A table of features, and its column of geometries. axes: of their coordinates."""

    table: str
    column: str
    axes: str
    crs: str | None
    geographic: bool

    def select(self, columns: Sequence[str]) -> str:
        """SQL for some columns of all rows."""
        return f"SELECT {', '.join(map(_quoted, columns))} FROM {_quoted(self.table)}"


def read(path: Path) -> Table:
    """The table in a file: its points' coordinates, then all attributes.

    Raises InputError for a file that is broken, for features that are no points and for a map that
    is not in metres; UsageError where several tables have features.
    """
    path.stat()  # SQLite does not say why it cannot open a file
    with _opened(path) as file:
        found = _features(path, file)
        columns = file.execute(f"PRAGMA table_info({_quoted(found.table)})")
        named = [name for _, name, *_ in columns if name != found.column]
    given = {axis: index for index, axis in enumerate(found.axes)}
    names = (*(f"{found.column} {axis}" for axis in given), *named)

    def parts(wanted: Sequence[int]) -> Iterator[Part]:
        others = {index: named[index - len(given)] for index in wanted if index >= len(given)}
        with _opened(path) as file:
            rows = file.execute(found.select([found.column, *others.values()]))
            first = 1
            while part := rows.fetchmany(ROWS):
                geometries, *values = zip(*part, strict=True)
                points = [_point(path, row, each) for row, each in enumerate(geometries, first)]
                column: dict[int, Sequence[Value]] = dict(zip(others, values, strict=True))
                column.update(enumerate(zip(*points, strict=True)))
                yield tuple(column[index] for index in wanted)
                first += len(part)

    return Table(
        path, names, parts, lambda row: f"feature {row:,}", given, found.geographic, crs=found.crs
    )


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """The database, which is left as it is, without files beside it. Raises InputError where it is
    broken."""
    log = path.with_name(f"{path.name}-wal")
    mode = "mode=ro" if log.is_file() and log.stat().st_size else "immutable=1"
    try:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?{mode}", uri=True)) as file:
            yield file
    except (sqlite3.Error, UnicodeDecodeError) as error:  # the latter, of names
        raise InputError(f"{path}: expected a GeoPackage; {error}; export it again") from None


def _features(path: Path, file: sqlite3.Connection) -> _Features:
    """The only table of features."""
    tables = file.execute(FEATURES).fetchall()
    if not tables:
        raise InputError(
            f"{path}: expected a table of features, found none; export the points as one"
        )
    if len(tables) > 1:
        listed = ", ".join(row[0] for row in tables)
        raise UsageError(
            f"{path}: expected one table of features, found {len(tables)}: {listed}; put that of "
            f"the plants into a file of its own, for example with ogr2ogr plants.gpkg {path.name} "
            f"{tables[0][0]}"
        )
    table, column, z, number, organization, code, definition = tables[0]
    axes = "xyz" if z else "xy"
    if number in UNDEFINED:
        return _Features(table, column, axes, None, UNDEFINED[number])
    crs = f"EPSG:{code}" if str(organization).upper() == "EPSG" else None
    said = described(str(definition))
    if said is None:
        return _Features(table, column, axes, crs, is_world(crs))
    if said.unit is not None:
        raise InputError(
            f"{path}: expected coordinates in metres or degrees, found those of {crs or 'a map'} "
            f"in {said.unit}; reproject it, for example with ogr2ogr -t_srs EPSG:32618"
        )
    return _Features(table, column, axes, crs or said.crs, said.geographic)


def _quoted(name: str) -> str:
    """A name as SQL has it."""
    return '"' + name.replace('"', '""') + '"'


def _point(path: Path, row: int, data: object) -> tuple[float, float, float | None]:
    """The coordinates of a geometry."""
    try:
        if not isinstance(data, bytes):
            kind = "no geometry" if data is None else "no binary one"
        elif data[:2] != b"GP":
            kind = "something else"
        elif data[3] & EMPTY:
            kind = "an empty one"
        else:
            start = 8 + ENVELOPE[data[3] >> 1 & 7]
            order = "<" if data[start] else ">"
            (number,) = struct.unpack_from(f"{order}I", data, start + 1)
            more, number = divmod(number, 1000)
            if number == POINT:
                x, y = struct.unpack_from(f"{order}2d", data, start + 5)
                if more not in WITH_Z:
                    return x, y, None
                return x, y, struct.unpack_from(f"{order}d", data, start + 21)[0]
            kind = KINDS[number] if number < len(KINDS) else f"a geometry of type {number}"
    except (struct.error, IndexError):
        kind = "a broken one"
    raise InputError(
        f"{path}, feature {row:,}: expected a Point, found {kind}; remove it, or export points"
    )
