"""Inventories as GeoJSON (RFC 7946): a collection of points, each with properties."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from vegtool.errors import InputError
from vegtool.tiles.projection import is_world
from vegtool.tiles.table import Part, Table, Value

COORDINATES = {"x": "coordinates[0]", "y": "coordinates[1]", "z": "coordinates[2]"}
"""What the axes of a position are called in messages."""
STANDARD = "OGC:CRS84"
"""The coordinate system of files that name none."""
CODE = re.compile(r"EPSG:(?:[\w.]*:)?(\d+)", re.IGNORECASE)
"""In the names of others, such as urn:ogc:def:crs:EPSG::25832."""


def read(path: Path) -> Table:
    """The table in a file: coordinates, then all properties that any feature has.

    Coordinates are longitude and latitude, as the standard says, unless the file names another
    coordinate system (`crs`, of the standard's 2008 version) or they cannot be degrees.
    Raises InputError for a file that is broken, for features that are no points, and for
    properties that have no names.
    """
    try:
        document = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: expected GeoJSON; {error}; export it again") from None
    features = document.get("features") if isinstance(document, dict) else None
    if not isinstance(features, list):
        raise InputError(
            f"{path}: expected a GeoJSON FeatureCollection, found none; export the points as one"
        )
    if not features:
        raise InputError(f"{path}: expected a point for each plant, found none; add some")
    points = [_coordinates(path, row, feature) for row, feature in enumerate(features, start=1)]
    axes = min(map(len, points))
    given = {name: index for index, name in enumerate(list(COORDINATES)[: min(axes, 3)])}
    properties = [_properties(path, row, feature) for row, feature in enumerate(features, start=1)]
    named = list(dict.fromkeys(name for each in properties for name in each))
    names = (*(COORDINATES[axis] for axis in given), *named)

    def parts(wanted: Sequence[int]) -> Iterator[Part]:
        columns: list[list[Value]] = []
        for index in wanted:
            if index < len(given):
                columns.append([point[index] for point in points])
            else:
                name = named[index - len(given)]
                columns.append([_value(each.get(name)) for each in properties])
        yield tuple(columns)

    notes: tuple[str, ...] = ()
    crs = _crs(document)
    if is_world(crs) and any(abs(x) > 180 or abs(y) > 90 for x, y, *_ in points):
        crs = None
        notes = (f"{path}: coordinates are no degrees, so they are taken as metres",)
    return Table(
        path, names, parts, lambda row: f"feature {row:,}", given, is_world(crs), False, notes, crs
    )


def _crs(document: dict[str, Any]) -> str | None:
    """The coordinate system of a document; None where its name is not known."""
    said = json.dumps(document.get("crs"))
    if said == "null" or "CRS84" in said.upper():
        return STANDARD
    match = CODE.search(said)
    return f"EPSG:{match[1]}" if match else None


def _value(value: Any) -> Value:
    """What a property may be here: of lists, objects, true and false, the text."""
    return json.dumps(value) if isinstance(value, bool | list | dict) else value


def _coordinates(path: Path, row: int, feature: Any) -> list[float]:
    """The position of a feature."""
    geometry = feature.get("geometry") if isinstance(feature, dict) else None
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    if not isinstance(geometry, dict) or kind != "Point":
        raise InputError(
            f"{path}, feature {row:,}: expected a Point, found {kind or 'no geometry'}; remove it, "
            "or export points"
        )
    position = geometry.get("coordinates")
    if (
        not isinstance(position, list)
        or len(position) < 2
        or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in position)
    ):
        raise InputError(
            f"{path}, feature {row:,}: expected two or three numbers as coordinates, found "
            f"{json.dumps(position):.60}; correct or remove it"
        )
    return position


def _properties(path: Path, row: int, feature: dict[str, Any]) -> dict[str, Any]:
    """What a feature is told to be, by name; nothing where that is null."""
    found = feature.get("properties")
    if found is not None and not isinstance(found, dict):
        raise InputError(
            f"{path}, feature {row:,}: expected properties with names, found "
            f"{json.dumps(found):.60}; correct or remove it"
        )
    return found or {}
