"""Inventories as LAS or LAZ, by laspy and lazrs, which are an extra: each point is a plant.

Source: ASPRS, LAS specification 1.4 R15: coordinates, extra bytes, which are attributes, and the
records of a coordinate reference system, as well-known text or as GeoTIFF's keys (OGC 19-008r4).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.errors import CapabilityError, InputError
from vegtool.tiles.projection import is_world
from vegtool.tiles.table import Part, Table, Value
from vegtool.tiles.wkt import Described, described

POINTS = 8192
"""Of a part."""
AXES = ("x", "y", "z")
MAGIC = b"LASF"
RECORDS_AT, RECORD = 100, 54
"""Bytes: where a header says how many variable length records there are, and the least of one."""
MAP_KEY, WORLD_KEY, UNIT_KEY = 3072, 2048, 3076
"""GeoTIFF's keys of a map, of longitude and latitude, and of the unit of lengths."""
METRE = 9001
"""The metre among GeoTIFF's units."""
NO_CODE = (0, 32767)
"""Values of GeoTIFF's keys that say that there is none."""


def read(path: Path) -> Table:
    """The table in a file: its points' coordinates, then its extra bytes, but for those that are
    lists.

    Raises CapabilityError where laspy or, for a compressed file, lazrs is not installed, InputError
    for a file that is broken, or on a map that is not in metres.
    """
    with _opened(path) as file:
        header = file.header
        extra = [one.name for one in header.point_format.extra_dimensions if one.num_elements == 1]
        found = _described(header.vlrs)
    if found is not None and found.unit is not None:
        raise InputError(
            f"{path}: expected coordinates in metres or degrees, found those of {found.crs:.60} in "
            f"{found.unit}; reproject it, for example with pdal translate and filters.reprojection"
        )
    names = (*AXES, *extra)

    def parts(wanted: Sequence[int]) -> Iterator[Part]:
        with _opened(path) as file:
            for points in file.chunk_iterator(POINTS):
                yield tuple(_values(points, names[index]) for index in wanted)

    return Table(
        path, names, parts, lambda row: f"point {row:,}", {axis: i for i, axis in enumerate(AXES)},
        geographic=None if found is None else found.geographic,
        crs=None if found is None else found.crs,
    )  # fmt: skip


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """A laspy.LasReader. Raises InputError where the file is broken."""
    try:
        laspy = import_module("laspy")
        if path.suffix.lower() == ".laz":
            import_module("lazrs")
    except ImportError as error:
        raise CapabilityError(
            f"{path}: LAS and LAZ are read by laspy and lazrs, and {error.name} is not installed; "
            "run pip install 'vegtool[geo]', or export the points as .csv or .gpkg"
        ) from None
    _check_records(path)
    try:
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as file:
            header = file.header
            end = header.offset_to_point_data + header.point_count * header.point_format.size
            if not header.are_points_compressed and end > path.stat().st_size:
                raise InputError(
                    f"{path}: expected {header.point_count:,} points, {end:,} bytes, found "
                    f"{path.stat().st_size:,} bytes; copy or export it again"
                )
            yield file
    except (InputError, GeneratorExit, KeyboardInterrupt):
        raise
    except BaseException as error:  # whatever a broken file leads to: lazrs panics, in Rust's words
        raise InputError(
            f"{path}: expected LAS or LAZ; {error or type(error).__name__}; export it again"
        ) from None


def _check_records(path: Path) -> None:
    """Raise InputError for more records than there is room for, which laspy would look for one by
    one."""
    with path.open("rb") as file:
        head = file.read(RECORDS_AT + 4)
    if head[:4] == MAGIC and len(head) == RECORDS_AT + 4:
        (count,) = struct.unpack_from("<I", head, RECORDS_AT)
        if count * RECORD > path.stat().st_size:
            raise InputError(
                f"{path}: expected LAS or LAZ, found {count:,} records in a file of "
                f"{path.stat().st_size:,} bytes; export it again"
            )


def _values(points: Any, name: str) -> Sequence[Value]:
    values: list[Value] = np.asarray(points[name]).tolist()
    return values


def _described(records: Any) -> Described | None:
    """The coordinate reference system, where one is said."""
    for text in (getattr(record, "string", "") for record in records):
        found = described(text)
        if found is not None:
            return found
    for record in records:
        keys = {key.id: key.value_offset for key in getattr(record, "geo_keys", ())}
        for number in (MAP_KEY, WORLD_KEY):
            if keys.get(number, 0) not in NO_CODE:
                crs = f"EPSG:{keys[number]}"
                unit = keys.get(UNIT_KEY, METRE)
                named = None if unit == METRE or number == WORLD_KEY else f"unit {unit}"
                return Described(crs, number == WORLD_KEY or is_world(crs), named)
    return None
