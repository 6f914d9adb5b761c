"""Which column of an inventory holds what, and in what units."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from vegtool.errors import InputError, UsageError
from vegtool.formats import METRES_PER
from vegtool.scene import Scene
from vegtool.tiles.table import Table

ALIASES = {
    "x": "x east easting e rechtswert ostwert lon long lng longitude"
    " x_coord xcoord coord_x point_x utm_x utm_e",
    "y": "y north northing n hochwert nordwert lat latitude"
    " y_coord ycoord coord_y point_y utm_y utm_n",
    "z": "z elevation elev altitude alt ground z_coord zcoord coord_z point_z utm_z",
    "species": "species kind name type taxon art baumart essence tree_species",
    "height": "height h tree_height total_height hoehe höhe baumhoehe baumhöhe hauteur",
    "yaw": "yaw rotation rot",
    "crown": "crown crown_diameter crown_width krone kronendurchmesser",
}
"""What a column may mean, and the names, in any case, that say so."""
DEGREES = {"lon", "long", "lng", "longitude", "lat", "latitude"}
UNITS = re.compile(r"^(.+?)[\s_]*[\s_(\[](mm|cm|dm|m|in|ft|deg|rad|°)[)\]]?$")
"""A name that ends in its unit, such as height_m or "Height [ft]"."""
ANGLES = {"deg": pi / 180, "°": pi / 180, "rad": 1.0}
"""Radians in a unit."""
NEEDED = ("x", "y")
WITHOUT_UNIT = ("species",)


@dataclass(frozen=True)
class Columns:
    """number: of the column with each meaning. factor: its unit in metres or radians.
    geographic: whether x and y are longitude and latitude. ignored: names of the others. crs: of x
    and y, where the file says it. notes: sentences on what was guessed."""

    number: Mapping[str, int]
    factor: Mapping[str, float]
    geographic: bool
    ignored: tuple[str, ...]
    crs: str | None = None
    notes: tuple[str, ...] = ()


def columns_of(table: Table, scene: Scene) -> Columns:
    """What the columns of a table mean.

    `columns` of [placement] decides, then the format, then the names; `units` decides, then what a
    name ends in, then metres and degrees.
    Raises UsageError, with file and line, for a meaning or a unit that is none, InputError for a
    column that is not there, for two that mean the same, and for want of an x or a y.
    """
    chosen = _chosen(table, scene)
    given, notes = _given(table, chosen)
    number = given | chosen
    for meaning in ALIASES:
        if meaning not in number:
            found = [i for i, name in enumerate(table.names) if _meaning(name) == meaning]
            found = [i for i in found if i not in number.values()]
            if len(found) > 1:
                raise InputError(
                    f"{table.path}: expected one column with {meaning}, found "
                    f"{' and '.join(_numbered(table, i) for i in found)}; choose one with columns "
                    f'= {{ {meaning} = "{table.names[found[0]]}" }} in [placement]'
                )
            if found:
                number[meaning] = found[0]
    for meaning in NEEDED:
        if meaning not in number:
            raise InputError(
                f"{table.path}: expected a column with {meaning}, such as "
                f"{', '.join(ALIASES[meaning].split()[:3])}, found {_listed(table)}; rename one, "
                f'or choose it with columns = {{ {meaning} = "..." }} in [placement]'
            )
    _check_units(scene)
    factor = {meaning: _factor(table, scene, meaning, i) for meaning, i in number.items()}
    of_format = all(number[axis] == table.given.get(axis) for axis in NEEDED)
    geographic = table.geographic if of_format else None
    if geographic is None:
        geographic = all(_plain(table.names[number[axis]])[0] in DEGREES for axis in NEEDED)
    used = {i for meaning, i in number.items() if meaning != "crown"}
    ignored = tuple(name for i, name in enumerate(table.names) if i not in used and name)
    crs = table.crs if of_format else None
    return Columns(number, factor, geographic, ignored, crs, notes)


def _given(table: Table, chosen: Mapping[str, int]) -> tuple[dict[str, int], tuple[str, ...]]:
    """What the format says. Of the tree tops that lidR finds (locate_trees), z is how high they are
    above the ground, and stands in a column Z too."""
    given, tops = dict(table.given), "Z"
    if (
        not {"treeID", tops} <= set(table.names)
        or "z" not in given
        or {"z", "height"} & set(chosen)
    ):
        return given, ()
    del given["z"]
    given["height"] = table.names.index(tops)
    return given, (
        f"{table.path}: treeID and Z are those of tree tops that lidR finds, so Z is the height of "
        "the trees; columns in [placement] may say otherwise",
    )


def _chosen(table: Table, scene: Scene) -> dict[str, int]:
    """What the scene says."""
    chosen = {}
    for meaning, name in scene.placement.columns.items():
        at = scene.at("placement", "columns", meaning)
        if meaning not in ALIASES:
            raise UsageError(
                f"{at}: columns: expected one of {', '.join(ALIASES)}; got {meaning!r}"
            )
        found = [i for i, other in enumerate(table.names) if other == name]
        if len(found) != 1:
            how = "none" if not found else f"{len(found)}"
            raise InputError(
                f"{table.path}: expected one column called {name!r}, as columns in {at} says, "
                f"found {how} among {_listed(table)}; correct it"
            )
        chosen[meaning] = found[0]
    return chosen


def _plain(name: str) -> tuple[str, str | None]:
    """A name in lower case, and the unit that it ends in."""
    name = name.strip().casefold()
    match = UNITS.match(name)
    name, unit = match.groups() if match else (name, None)
    return re.sub(r"[\s\-]+", "_", name), unit


def _meaning(name: str) -> str | None:
    plain, _ = _plain(name)
    return next((meaning for meaning, names in ALIASES.items() if plain in names.split()), None)


def _check_units(scene: Scene) -> None:
    for meaning, unit in scene.placement.units.items():
        at = scene.at("placement", "units", meaning)
        measured = [name for name in ALIASES if name not in WITHOUT_UNIT]
        if meaning not in measured:
            raise UsageError(f"{at}: units: expected one of {', '.join(measured)}; got {meaning!r}")
        if unit not in _units_of(meaning):
            raise UsageError(
                f"{at}: units: expected one of {', '.join(_units_of(meaning))} for {meaning}; got "
                f"{unit!r}"
            )


def _units_of(meaning: str) -> Mapping[str, float]:
    """Metres or radians in each unit that it may have."""
    return ANGLES if meaning == "yaw" else METRES_PER


def _factor(table: Table, scene: Scene, meaning: str, number: int) -> float:
    """Metres or radians in the unit of a column."""
    known = _units_of(meaning)
    said, named = scene.placement.units.get(meaning), _plain(table.names[number])[1]
    usual = "deg" if meaning == "yaw" else "m"
    return known[said or (named if named is not None and named in known else usual)]


def _numbered(table: Table, number: int) -> str:
    return f"{table.names[number]!r} (column {number + 1})"


def _listed(table: Table) -> str:
    return ", ".join(repr(name) for name in table.names[:20])
