"""The scene file: what plants are made for, in one TOML file that several commands read.

Its tables and keys are those of SCHEMA, described in docs/scene.md. All of them are checked here;
what a command does not use yet stays as it was read.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from math import hypot
from pathlib import Path
from typing import Any, Literal

from vegtool.convert import ConvertOptions
from vegtool.errors import UsageError
from vegtool.lighting.light import Sun
from vegtool.options import default_of, flag_of

Place = tuple[str | int, ...]
"""Where a value stands in a file: keys, and numbers in lists."""
Pair = tuple[float, float]


@dataclass(frozen=True)
class Key:
    """What a key may hold: one of KINDS, within inclusive limits, and greater than `above`; one of
    some words, if any."""

    kind: str
    help: str
    least: float | None = None
    most: float | None = None
    above: float | None = None
    choices: tuple[str, ...] = ()


def _like(option_name: str, kind: str, help: str) -> Key:
    """A key with the limits of an option of `convert`."""
    (item,) = (item for item in fields(ConvertOptions) if item.name == option_name)
    return Key(kind, help, item.metadata["least"], item.metadata["most"])


SCHEMA: dict[str, dict[str, Key]] = {
    "camera": {
        "path": Key("text", "file with the path that the viewer takes"),
        "polygon": Key("points", "corners of the area that the viewer stays in, metres"),
        "height_m": Key("range", "lowest and highest eye above the ground", least=0),
        "fov_y_deg": _like("fov", "number", "vertical field of view, as --fov"),
        "image_height_px": _like("image_height", "integer", "image height, as --image-height"),
        "above": Key("boolean", "whether plants may be seen from above"),
        "margin_m": Key("number", "how far the viewer may leave the path or the area", least=0),
    },
    "light": {
        "moves": Key("boolean", "whether the sun moves"),
        "sun": Key("pair", "azimuth from +z towards +x, and elevation, degrees, as --sun"),
    },
    "terrain": {
        "kind": Key("text", "what plants stand on", choices=("none", "plane", "heightmap")),
        "heightmap": Key("text", "file with heights"),
        "extent_m": Key("pair", "size along x and z", above=0),
        "crs": Key("text", "coordinate reference system, such as EPSG:25832"),
        "origin": Key("pair", "where the middle of the extent is on the map: east and north"),
        "height_m": Key("range", "lowest and highest ground"),
    },
    "species": {
        "name": Key("text", "what it is called"),
        "model": Key("text", "file of the plant"),
        "share": Key("number", "of all plants, beside the others' shares", least=0),
        "height_m": Key("range", "smallest and tallest plant", least=0.001, most=1000),
        "slope_deg": Key("range", "slopes that it grows on", least=0, most=90),
        "elevation_m": Key("range", "heights of the ground that it grows at"),
        "density": Key("text", "file of a map that says where it grows"),
        "aliases": Key("names", "other names that an inventory calls it"),
    },
    "placement": {
        "seed": _like("seed", "integer", "seed of every random choice"),
        "spacing_m": Key("number", "least distance between plants", above=0),
        "inventory": Key("text", "file with a row per plant, in place of a spacing"),
        "columns": Key("words", "which of its columns holds what"),
        "units": Key("words", "in what units, where that is not metres or degrees"),
    },
    "budget": {
        "bytes": Key("integer", "of all files", least=1),
        "triangles": Key("integer", "drawn at a time", least=1),
        "frame_ms": Key("number", "time to draw a frame", above=0),
    },
}  # fmt: skip
"""Tables and their keys."""
LISTED = ("species",)
"""Tables that may stand in a file again and again, as [[species]]."""
NEEDED = {"light": "moves"}
"""A key that a table does not go without."""
NEEDED_BY = {("terrain", "kind", "heightmap"): "heightmap"}
"""A key that a table does not go without where another one has that value."""
USED = {
    ("camera", "fov_y_deg"),
    ("camera", "image_height_px"),
    ("light", "moves"),
    ("light", "sun"),
}
"""Keys that change what `convert` does."""
OF_EYES = ("camera", "terrain", "species", "placement")
"""Tables that do so too, where they say from where plants are seen."""


MOST = 1e18
"""Greatest number that a file may hold: more than whatever can be meant, and what others can read.
"""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= MOST


def _are_numbers(value: Any, *counts: int) -> bool:
    return isinstance(value, list) and len(value) in counts and all(map(_is_number, value))


def _is_pair(value: Any) -> bool:
    return _are_numbers(value, 2)


def _has_area(points: list[list[float]]) -> bool:
    """Whether points do not all lie on one line: to a billionth of their extent."""
    if not points:
        return False
    (x, z), *_ = points
    moved = [(float(a) - x, float(b) - z) for a, b in points]
    farthest = max(moved, key=lambda p: hypot(*p))
    across = max(abs(farthest[0] * b - farthest[1] * a) for a, b in moved)
    return across > 1e-9 * (farthest[0] ** 2 + farthest[1] ** 2)


KINDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "boolean": ("true or false", lambda v: isinstance(v, bool)),
    "integer": ("a whole number", lambda v: _is_number(v) and isinstance(v, int)),
    "number": ("a number", _is_number),
    "text": ("text in quotes", lambda v: isinstance(v, str) and bool(v)),
    "pair": ("two numbers, [a, b]", _is_pair),
    "point": ("three numbers, [x, y, z]", lambda v: _are_numbers(v, 3)),
    "place": ("[x, y, z], or [x, z] above the ground", lambda v: _are_numbers(v, 2, 3)),
    "range": ("two numbers, [low, high]", lambda v: _is_pair(v) and v[0] <= v[1]),
    "points": (
        "three points at least that are not on one line, [[x, z], [x, z], [x, z]]",
        lambda v: isinstance(v, list) and all(map(_is_pair, v)) and _has_area(v),
    ),
    "names": (
        'names in quotes, ["a", "b"]',
        lambda v: isinstance(v, list) and all(isinstance(w, str) and w.strip() for w in v),
    ),
    "words": (
        'names in quotes, { x = "easting" }',
        lambda v: isinstance(v, dict) and all(isinstance(word, str) for word in v.values()),
    ),
}
"""What values a key may have, in words, and whether one is such a value."""


@dataclass(frozen=True)
class Camera:
    """From where a scene is seen; None and () where the file does not say."""

    path: str | None = None
    polygon: tuple[Pair, ...] = ()
    height_m: Pair | None = None
    fov_y_deg: float | None = None
    image_height_px: int | None = None
    above: bool | None = None
    margin_m: float | None = None


@dataclass(frozen=True)
class SunLight:
    """Whether the sun moves, and where it stands, or begins to move; None where the file does not
    say."""

    moves: bool
    sun: Sun | None = None


@dataclass(frozen=True)
class TerrainTable:
    """The ground that plants stand on; None where the file does not say."""

    kind: Literal["none", "plane", "heightmap"] | None = None
    heightmap: str | None = None
    extent_m: Pair | None = None
    crs: str | None = None
    origin: Pair | None = None
    height_m: Pair | None = None


@dataclass(frozen=True)
class SpeciesTable:
    """One kind of plant, and where it grows; None where the file does not say."""

    name: str | None = None
    model: str | None = None
    share: float | None = None
    height_m: Pair | None = None
    slope_deg: Pair | None = None
    elevation_m: Pair | None = None
    density: str | None = None
    aliases: tuple[str, ...] = ()


@dataclass(frozen=True)
class PlacementTable:
    """How plants are placed; None and {} where the file does not say."""

    seed: int | None = None
    spacing_m: float | None = None
    inventory: str | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Scene:
    """A scene file. budget: as it stands there; lines: where everything does."""

    path: Path
    camera: Camera = field(default_factory=Camera)
    light: SunLight | None = None
    terrain: TerrainTable = field(default_factory=TerrainTable)
    species: tuple[SpeciesTable, ...] = ()
    placement: PlacementTable = field(default_factory=PlacementTable)
    budget: Mapping[str, Any] = field(default_factory=dict)
    lines: Mapping[Place, int] = field(default_factory=dict)

    def at(self, *place: str | int) -> str:
        """File and line of a value."""
        return file_and_line(self.path, self.lines, place)


def read_scene(path: Path) -> Scene:
    """Read a scene file.

    Raises UsageError, with file and line, for what cannot be read, for a table or a key that is
    not in SCHEMA, and for a value that its key may not have.
    """
    values, lines = read_toml(path, "scene")
    for name, table in values.items():
        _check_table(path, lines, name, table)
    light = values.get("light")
    return Scene(
        path,
        _camera(values.get("camera", {})),
        None if light is None else _sun_light(light, file_and_line(path, lines, ("light", "sun"))),
        TerrainTable(**_paired(values.get("terrain", {}))),
        tuple(SpeciesTable(**_paired(table)) for table in values.get("species", ())),
        PlacementTable(**values.get("placement", {})),
        values.get("budget", {}),
        lines,
    )


def read_toml(path: Path, what: str) -> tuple[dict[str, Any], dict[Place, int]]:
    """The values of a TOML file, and the line of each; `what` it is, for messages.

    Raises UsageError for what cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        values = tomllib.loads(text)
    except OSError as error:
        raise UsageError(f"{path}: cannot read this {what} ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise UsageError(f"{path}: expected TOML; {error}") from error
    return values, _lines(text)


def with_scene(options: ConvertOptions, scene: Scene) -> ConvertOptions:
    """The options with what the scene says, where they are at their defaults.

    Raises UsageError, with file and line, where the two contradict each other.
    """
    display = {
        name: _agreed(options, scene, name, key)
        for name, key in (("fov", "fov_y_deg"), ("image_height", "image_height_px"))
    }
    return replace(options, **display, sun=_agreed_sun(options, scene))


def unused(scene: Scene, options: ConvertOptions, eyes: bool = False) -> list[str]:
    """Sentences on what `convert` reads and, with these options, does not use. eyes: whether the
    scene says from where plants are seen."""
    notes = []
    if scene.light is not None and scene.light.sun is not None and not options.prelit:
        notes.append(
            f"{scene.at('light', 'sun')}: sun changes nothing without --prelit: levels are lit by "
            "whoever shows them"
        )
    used_tables = {table for table, _ in USED} | set(OF_EYES if eyes else ())
    keys = [place for place in scene.lines if len(place) == 2 and place[0] in used_tables]
    tables = dict.fromkeys(str(place[0]) for place in scene.lines)
    found = [_header(table) for table in tables if table not in used_tables]
    found += [
        f"[{table}] {key}"
        for table, key in keys
        if (table, key) not in USED and not (eyes and table in OF_EYES)
    ]
    if found:
        listed = ", ".join(found)
        notes.append(f"{scene.path}: checked, but of no effect on convert yet: {listed}")
    return notes


def _agreed(options: ConvertOptions, scene: Scene, name: str, key: str) -> Any:
    """An option, or what the camera says of it."""
    (item,) = (item for item in fields(options) if item.name == name)
    given, described = getattr(options, name), getattr(scene.camera, key)
    if described is None or given == described:
        return given
    if given != default_of(item):
        raise UsageError(
            f"{scene.at('camera', key)}: {key} is {described:g}, and {flag_of(item)} is {given:g}; "
            "leave out one of the two"
        )
    return described


def _agreed_sun(options: ConvertOptions, scene: Scene) -> str | None:
    """The sun of the options, or that of the scene; of levels whose light is baked alone."""
    light = scene.light
    if light is None or not options.prelit:
        return options.sun
    if light.moves:
        raise UsageError(
            f"{scene.at('light', 'moves')}: levels with baked light cannot follow a sun that "
            "moves; leave out --prelit or set moves = false"
        )
    if light.sun is None:
        return options.sun
    described = f"{light.sun.azimuth_deg:.15g},{light.sun.elevation_deg:.15g}"
    if options.sun is not None and Sun.read(options.sun) != light.sun:
        raise UsageError(
            f"{scene.at('light', 'sun')}: the sun stands at {described}, and --sun is "
            f"{options.sun}; leave out one of the two"
        )
    return described if options.sun is None else options.sun


def _camera(table: dict[str, Any]) -> Camera:
    corners = tuple((x, z) for x, z in table.get("polygon", ()))
    return Camera(**{**_paired(table), "polygon": corners})


def _paired(table: dict[str, Any]) -> dict[str, Any]:
    """A table whose lists are tuples, as dataclasses hold them."""
    return {key: tuple(v) if isinstance(v, list) else v for key, v in table.items()}


def _sun_light(table: dict[str, Any], at: str) -> SunLight:
    pair = table.get("sun")
    sun = None if pair is None else Sun.read(",".join(map(repr, pair)), f"{at}: sun")
    return SunLight(table["moves"], sun)


def _check_table(path: Path, lines: Mapping[Place, int], name: str, table: Any) -> None:
    if name not in SCHEMA:
        what = f"no table is called {name!r}; known: {', '.join(map(_header, SCHEMA))}"
        raise UsageError(f"{file_and_line(path, lines, (name,))}: {what}")
    listed = name in LISTED
    if not isinstance(table, list if listed else dict):
        raise UsageError(f"{file_and_line(path, lines, (name,))}: expected a table {_header(name)}")
    for place, part in _parts(name, table):
        if not isinstance(part, dict):
            raise UsageError(
                f"{file_and_line(path, lines, place)}: expected a table {_header(name)}"
            )
        for key, value in part.items():
            _check(file_and_line(path, lines, (*place, key)), name, key, value)
        if name in NEEDED and NEEDED[name] not in part:
            raise UsageError(f"{file_and_line(path, lines, place)}: {_lacks(name, NEEDED[name])}")
        for (table, key, value), needed in NEEDED_BY.items():
            if table == name and part.get(key) == value and needed not in part:
                at = file_and_line(path, lines, (*place, key))
                raise UsageError(f'{at}: {key} is "{value}": {_lacks(name, needed)}')


def _lacks(table: str, key: str) -> str:
    expected = KINDS[SCHEMA[table][key].kind][0]
    return f"expected {key} in {_header(table)}, {expected}; got none"


def _parts(name: str, table: Any) -> Iterator[tuple[Place, Any]]:
    """The tables of a name, each with its place."""
    if isinstance(table, list):
        yield from (((name, index), part) for index, part in enumerate(table))
    else:
        yield (name,), table


def _header(name: str) -> str:
    return f"[[{name}]]" if name in LISTED else f"[{name}]"


def _check(at: str, table: str, key: str, value: Any) -> None:
    """Raise UsageError where a key is unknown or may not have its value."""
    known = SCHEMA[table]
    if key not in known:
        what = f"no key of {_header(table)} is called {key!r}"
        raise UsageError(f"{at}: {what}; known: {', '.join(known)}")
    check_value(at, key, known[key], value)


def check_value(at: str, key: str, rule: Key, value: Any) -> None:
    """Raise UsageError, which begins with `at`, where a key may not have its value."""
    expected, fits = KINDS[rule.kind]
    if not fits(value):
        raise UsageError(f"{at}: {key}: expected {expected}; got {_toml(value)}")
    if rule.choices and value not in rule.choices:
        raise UsageError(f"{at}: {key}: expected one of {', '.join(rule.choices)}; got {value}")
    for number in value if isinstance(value, list) else [value]:
        if rule.least is not None and number < rule.least:
            raise UsageError(f"{at}: {key}: expected at least {rule.least:g}; got {number:g}")
        if rule.most is not None and number > rule.most:
            raise UsageError(f"{at}: {key}: expected at most {rule.most:g}; got {number:g}")
        if rule.above is not None and not number > rule.above:
            raise UsageError(f"{at}: {key}: expected more than {rule.above:g}; got {number:g}")


def _toml(value: Any) -> str:
    """A value about as it stands in a file, cut short."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    return f"{value!r:.60}"


def file_and_line(path: Path, lines: Mapping[Place, int], place: Place) -> str:
    """File and line of a value, or of what it stands in."""
    while place and place not in lines:
        place = place[:-1]
    return f"{path}, line {lines[place]}" if place else f"{path}"


_TOKEN = re.compile(
    r'''"""(?:\\.|[^\\])*?"{3,5}|'{3}.*?'{3,5}|"(?:\\.|[^"\\\n])*"|'[^'\n]*'|#[^\n]*|[][{}\n]''',
    re.DOTALL,
)
"""What says where statements of TOML end: strings and comments whole, brackets, ends of lines."""


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """The statements of a TOML file that is known to be right, headers and keys with their values,
    each with the number of its first line: they end where a line does, outside of all brackets."""
    start, depth, number, first = 0, 0, 1, 1
    for token in _TOKEN.finditer(text):
        mark = token[0]
        number += mark.count("\n")
        depth += (mark in "[{") - (mark in "]}")
        if mark == "\n" and depth == 0:
            yield first, text[start : token.end()]
            start, first = token.end(), number


def _lines(text: str) -> dict[Place, int]:
    """The line of every key of a TOML file that is known to be right.

    Each of its statements is a file of its own too.
    """
    found: dict[Place, int] = {}
    counts: dict[Place, int] = {}
    header: Place = ()
    for first, statement in _statements(text.replace("\r\n", "\n") + "\n"):
        values = tomllib.loads(statement)
        if statement.lstrip().startswith("["):
            header = _header_place(values, counts)
            for length in range(1, len(header) + 1):
                found.setdefault(header[:length], first)
        else:
            for place in _places(values):
                found.setdefault((*header, *place), first)
    return found


def _header_place(values: Any, counts: dict[Place, int]) -> Place:
    """The place that a header alone, as read, opens; `counts` of the tables of each list so far."""
    place: Place = ()
    while values:
        ((name, values),) = values.items()
        place = (*place, name)
        if isinstance(values, list):  # [[name]]: one more of them
            counts[place] = counts.get(place, -1) + 1
            values = values[0]
        if place in counts:  # what follows belongs to the last one
            place = (*place, counts[place])
    return place


def _places(values: Any) -> Iterator[Place]:
    """The places of all keys in what was read."""
    pairs = values.items() if isinstance(values, dict) else enumerate(values)
    for key, value in pairs:
        yield (key,)
        if isinstance(value, dict | list):
            yield from ((key, *place) for place in _places(value))
