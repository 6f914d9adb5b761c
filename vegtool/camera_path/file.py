"""The path of an eye through a scene: a TOML file of stations, read and written.

Its keys are those of KEYS and STATION, described in docs/camera_path.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vegtool.errors import UsageError
from vegtool.lod import Display
from vegtool.scene import Key, Place, check_value, file_and_line, read_toml

FPS = 30.0
"""Frames per second of a path that does not say."""
HEIGHT_M = 1.7
"""Height of the eye above the ground where nobody says: that of a person who stands."""
SPEED_M_S = 1.4
"""Speed where nobody says: that of a person who walks."""

_SPEED = Key("number", "speed from the station before, metres per second", 1e-3, 1e6)
_HEIGHT = Key("number", "height of the eye above the ground, of a position [x, z]", -1e6, 1e6)
KEYS: dict[str, Key] = {
    "fps": Key("number", "frames per second", 0.01, 1000),
    "loop": Key("boolean", "whether the path leads back to its first station"),
    "fov_y_deg": Key("number", "vertical field of view", 1, 170),
    "height_m": _HEIGHT,
    "speed_m_s": _SPEED,
}
"""Keys of the file, before the first station: what goes for all stations."""
STATION: dict[str, Key] = {
    "position": Key("place", "where the eye is, metres", -1e9, 1e9),
    "height_m": _HEIGHT,
    "yaw_deg": Key("number", "0 looks along -z; to the left", -1e6, 1e6),
    "pitch_deg": Key("number", "above the horizon", -90, 90),
    "look_at": Key("point", "what the eye looks at, metres, in place of yaw and pitch", -1e9, 1e9),
    "time_s": Key("number", "when the eye is there", 0, 1e9),
    "speed_m_s": _SPEED,
}
"""Keys of a [[station]]."""
NOT_BOTH = (
    ("look_at", "yaw_deg"),
    ("look_at", "pitch_deg"),
    ("time_s", "speed_m_s"),
)
"""Keys of a station that say the same, and may contradict each other."""


@dataclass(frozen=True)
class Station:
    """Where an eye passes, and how.

    position: x, y, z in metres; y is the height above the ground where `above_ground`.
    yaw_deg, pitch_deg, look_at: as Eye; where none is given, along the path and level.
    time_s: when it is reached; or speed_m_s: how fast, from the one before.
    """

    position: tuple[float, float, float]
    above_ground: bool = False
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    look_at: tuple[float, float, float] | None = None
    time_s: float | None = None
    speed_m_s: float | None = None


@dataclass(frozen=True)
class CameraPath:
    """A path file: at least one station, and what goes for all of them.

    source, lines: the file and where in it things stand, for messages.
    """

    stations: tuple[Station, ...]
    fps: float = FPS
    loop: bool = False
    fov_y_deg: float = Display.fov_y_deg
    speed_m_s: float = SPEED_M_S
    source: Path | None = field(default=None, compare=False)
    lines: Mapping[Place, int] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        if not self.stations:
            raise ValueError("CameraPath.stations: expected one at least; got none")

    def at(self, station: int, key: str) -> str:
        """File and line of a station's key, or which station it is."""
        if self.source is None:
            return f"station {station + 1}"
        return file_and_line(self.source, self.lines, ("station", station, key))


def read_path(file: Path) -> CameraPath:
    """Read a path file.

    Raises UsageError, with file and line, for what cannot be read, for a key that is not known, a
    value that its key may not have, and keys that contradict each other.
    """
    values, lines = read_toml(file, "path")
    stations = values.pop("station", [])
    _check_keys(file, lines, (), values, KEYS)
    if not isinstance(stations, list) or not all(isinstance(each, dict) for each in stations):
        raise UsageError(f"{file_and_line(file, lines, ('station',))}: expected tables [[station]]")
    if not stations:
        raise UsageError(f"{file}: expected one [[station]] at least; got none")
    latest = -1.0
    for index, station in enumerate(stations):
        _check_keys(file, lines, ("station", index), station, STATION)
        _check_station(file, lines, index, station, bool(values.get("loop", False)))
        if "time_s" in station:
            if not station["time_s"] > latest:
                at = file_and_line(file, lines, ("station", index, "time_s"))
                found = f"got {station['time_s']:g}"
                raise UsageError(f"{at}: time_s: expected more than {latest:g}, as before; {found}")
            latest = station["time_s"]
    height_m = float(values.get("height_m", HEIGHT_M))
    return CameraPath(
        tuple(_station(station, height_m) for station in stations),
        float(values.get("fps", FPS)),
        values.get("loop", False),
        float(values.get("fov_y_deg", Display.fov_y_deg)),
        float(values.get("speed_m_s", SPEED_M_S)),
        file,
        lines,
    )


def written(path: CameraPath) -> str:
    """The text of the file that `read_path` reads as this path, to the last digit."""
    lines = [
        f"fps = {path.fps!r}",
        f"loop = {str(path.loop).lower()}",
        f"fov_y_deg = {path.fov_y_deg!r}",
        f"speed_m_s = {path.speed_m_s!r}",
    ]
    for station in path.stations:
        x, y, z = station.position
        lines += ["", "[[station]]"]
        if station.above_ground:
            lines += [f"position = [{x!r}, {z!r}]", f"height_m = {y!r}"]
        else:
            lines += [f"position = [{x!r}, {y!r}, {z!r}]"]
        for key in ("yaw_deg", "pitch_deg", "look_at", "time_s", "speed_m_s"):
            value = getattr(station, key)
            if value is not None:
                lines.append(f"{key} = {list(value) if key == 'look_at' else value!r}")
    return "\n".join(lines) + "\n"


def _check_keys(
    file: Path,
    lines: Mapping[Place, int],
    place: Place,
    values: Mapping[str, Any],
    known: Mapping[str, Key],
) -> None:
    """Raise UsageError where a key is unknown or may not have its value."""
    for key, value in values.items():
        at = file_and_line(file, lines, (*place, key))
        if key not in known:
            owner = "[[station]]" if place else "a path"
            raise UsageError(
                f"{at}: no key of {owner} is called {key!r}; known: {', '.join(known)}"
            )
        check_value(at, key, known[key], value)


def _check_station(
    file: Path, lines: Mapping[Place, int], index: int, station: Mapping[str, Any], loop: bool
) -> None:
    """Raise UsageError where a station's keys do not go together."""

    def at(key: str) -> str:
        return file_and_line(file, lines, ("station", index, key))

    if "position" not in station:
        raise UsageError(
            f"{at('')}: expected position in [[station]], [x, y, z] or [x, z]; got none"
        )
    if len(station["position"]) == 3 and "height_m" in station:
        raise UsageError(
            f"{at('height_m')}: height_m goes with a position [x, z] alone; got a position with a "
            "height of its own; leave out one of the two"
        )
    for one, other in NOT_BOTH:
        if one in station and other in station:
            raise UsageError(f"{at(other)}: {one} says it already; leave out one of the two")
    if index == 0 and "speed_m_s" in station and not loop:
        raise UsageError(
            f"{at('speed_m_s')}: speed_m_s is that of the way to a station, and none leads to the "
            "first one without loop = true; leave it out, or write it at the next station"
        )


def _station(values: Mapping[str, Any], height_m: float) -> Station:
    given = {key: float(v) for key, v in values.items() if key not in ("position", "look_at")}
    above_ground = len(values["position"]) == 2
    own = given.pop("height_m", height_m)
    first, *rest = (float(v) for v in values["position"])
    y, z = (own, rest[0]) if above_ground else rest
    look_at = None
    if "look_at" in values:
        x, up, back = (float(v) for v in values["look_at"])
        look_at = (x, up, back)
    return Station((first, y, z), above_ground, look_at=look_at, **given)
