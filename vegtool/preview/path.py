"""The path of an eye through a scene: a TOML file of stations, read, walked and written.

Its keys are those of KEYS and STATION, described in docs/camera_path.md. Positions lie on a curve
through the stations (curve.py); directions turn the shortest way, by cubics that stay between the
stations' angles: Fritsch, Carlson: Monotone piecewise cubic interpolation (1980), with slopes as in
Fritsch, Butland: A method for constructing local monotone piecewise cubic interpolants (1984).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import ceil, isfinite
from pathlib import Path
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.preview.controls import Ground
from vegtool.preview.curve import Curve, Legs, through
from vegtool.preview.eye import FAR_M, FOV_Y_DEG, NEAR_M, Eye, towards
from vegtool.scene import Key, Place, check_value, file_and_line, read_toml

FPS = 30.0
"""Frames per second of a path that does not say."""
HEIGHT_M = 1.7
"""Height of the eye above the ground where nobody says: that of a person who stands."""
SPEED_M_S = 1.4
"""Speed where nobody says: that of a person who walks."""
TURN_DEG_S = 180.0
"""No leg turns faster than that on average, unless its time is given: it takes longer then."""
MOST_FRAMES = 1_000_000
"""Of a path: nine hours at 30 a second."""
EVERY_S = 0.5
"""Time between two stations of a path that is recorded."""

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
    fov_y_deg: float = FOV_Y_DEG
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


NO_TIME, NO_TIME_S = 1e-12, 1e-100
"""Of a whole way, and seconds: a leg that takes less is as one that takes none, for what turns in
it turns faster than numbers can say."""


@dataclass(frozen=True, eq=False)
class _Walk:
    """A path with the ground under it. Of each station, and of the first again where the path leads
    back: time_s (m,), yaw_deg (m,) without jumps, pitch_deg (m,). ground: (n, 1) metres."""

    path: CameraPath
    curve: Curve
    ground: FloatArray
    time_s: FloatArray
    yaw_deg: FloatArray
    pitch_deg: FloatArray


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
        float(values.get("fov_y_deg", FOV_Y_DEG)),
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


def recorded(
    eyes: Sequence[Eye], time_s: Sequence[float], fps: float = FPS, every_s: float = EVERY_S
) -> CameraPath:
    """The path of an eye that was watched while it walked: a station every so often, and at both
    ends. time_s: when each eye was there, seconds, ascending from anywhere.

    Raises ValueError for no eyes, and for times that do not ascend.
    """
    if not eyes or len(eyes) != len(time_s):
        raise ValueError(
            f"recorded: expected as many times as eyes; got {len(time_s)}, {len(eyes)}"
        )
    times = np.asarray(time_s, np.float64) - time_s[0]
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise ValueError("recorded: expected times that ascend")
    kept = [0]
    for index in range(1, len(eyes) - 1):
        # the last one comes anyway: none just before it
        if every_s <= times[index] - times[kept[-1]] and every_s <= times[-1] - times[index]:
            kept.append(index)
    if len(eyes) > 1:
        kept.append(len(eyes) - 1)
    stations = []
    for index in kept:
        x, y, z = eyes[index].position.tolist()
        yaw, pitch = float(eyes[index].yaw_deg), float(eyes[index].pitch_deg)
        stations.append(Station((x, y, z), False, yaw, pitch, time_s=float(times[index])))
    return CameraPath(tuple(stations), fps, fov_y_deg=eyes[0].fov_y_deg)


def duration_s(path: CameraPath, ground: Ground | None = None) -> float:
    """Seconds from the first station to the last, or until the eye is back at the first.

    Raises UsageError as `eyes`.
    """
    walk = _walked(path, ground)
    return float(walk.time_s[-1] - walk.time_s[0])


def eyes(
    path: CameraPath,
    fps: float | None = None,
    ground: Ground | None = None,
    near_m: float = NEAR_M,
    far_m: float = FAR_M,
) -> list[Eye]:
    """The eye at each frame: the first and the last station among them, the first once in a loop.

    fps: frames per second, in place of the path's. ground: what heights are above; level at 0
    where there is none. Between two stations above the ground, the eye keeps above it; between
    such a one and another, it does so less and less.
    Raises UsageError, with file and line, for a time too early to be there, a station that looks
    at itself, and more than MOST_FRAMES frames; ValueError for frames per second that are none.
    """
    rate = path.fps if fps is None else fps
    if not (isfinite(rate) and rate > 0):
        raise ValueError(f"eyes: expected frames per second of more than 0; got {rate}")
    walk = _walked(path, ground)
    duration = float(walk.time_s[-1] - walk.time_s[0])
    frames = duration * rate
    if frames > MOST_FRAMES:
        named = "the path" if path.source is None else str(path.source)
        raise UsageError(
            f"{named}: expected at most {MOST_FRAMES:,} frames; {duration:,.6g} s at {rate:g} "
            f"frames per second are {frames:,.0f}; move faster, or ask for fewer frames per second"
        )
    # a frame too many by rounding alone would be a second last station
    whole = max(ceil(frames - 1e-6), 0)
    count = max(whole, 1) if path.loop else whole + 1
    time_s = np.minimum(np.arange(count) / rate, duration)
    return _seen(walk, walk.time_s[0] + time_s, ground, near_m, far_m)


def _seen(
    walk: _Walk, time_s: FloatArray, ground: Ground | None, near_m: float, far_m: float
) -> list[Eye]:
    """The eye at those times, (k,) ascending seconds."""
    position = _positions(walk, time_s, ground)
    yaw, pitch = _directions(walk, time_s)
    lens = walk.path.fov_y_deg, near_m, far_m
    return [Eye(p, float(y), float(t), *lens) for p, y, t in zip(position, yaw, pitch, strict=True)]


def _walked(path: CameraPath, ground: Ground | None) -> _Walk:
    """The path with the ground under it, and its times and directions as they follow from both."""
    points = np.array([station.position for station in path.stations], np.float64)
    above = np.array([station.above_ground for station in path.stations])
    heights = np.zeros((len(points), 1))
    if ground is not None:
        heights[:, 0] = [ground(float(x), float(z)) for x, _, z in points]
    points[above, 1] += heights[above, 0]
    curve = through(points, path.loop and len(points) > 1)
    yaw, pitch = _angles(path, curve)
    again = [*range(len(points)), 0] if curve.closed else list(range(len(points)))
    yaw, pitch = _unwound(yaw[again]), pitch[again]
    turned = np.maximum(np.abs(np.diff(yaw)), np.abs(np.diff(pitch)))
    return _Walk(path, curve, heights, _times(path, curve, turned), yaw, pitch)


def _angles(path: CameraPath, curve: Curve) -> tuple[FloatArray, FloatArray]:
    """(n,) yaw and pitch of each station in degrees, as they are given or as the path goes."""
    yaw, pitch = np.zeros(len(path.stations)), np.zeros(len(path.stations))
    before = 0.0
    for i, (station, tangent) in enumerate(zip(path.stations, curve.tangents, strict=True)):
        if station.look_at is not None:
            gaze = np.array(station.look_at) - curve.points[i]
            if not gaze.any():
                raise UsageError(
                    f"{path.at(i, 'look_at')}: look_at: expected a point away from the eye; got "
                    "the station's own position"
                )
            before, pitch[i] = towards(gaze, before)
        else:
            level = tangent * [1, 0, 1]
            if station.yaw_deg is not None:
                before = station.yaw_deg
            elif level.any():
                before, _ = towards(level)
            pitch[i] = station.pitch_deg or 0.0
        yaw[i] = before
    return yaw, pitch


def _times(path: CameraPath, curve: Curve, turned_deg: FloatArray) -> FloatArray:
    """(m,) seconds at which stations are reached; turned_deg: (m - 1,) by each leg."""
    times = [path.stations[0].time_s or 0.0]
    for leg, (length, turn) in enumerate(zip(curve.length, turned_deg, strict=True)):
        back = leg + 1 == len(path.stations)
        station = path.stations[0 if back else leg + 1]
        if station.time_s is not None and not back:
            if not station.time_s > times[-1]:
                raise UsageError(
                    f"{path.at(leg + 1, 'time_s')}: time_s: expected more than {times[-1]:.6g}, "
                    f"when the station before is reached; got {station.time_s:g}"
                )
            times.append(station.time_s)
        else:
            speed = path.speed_m_s if station.speed_m_s is None else station.speed_m_s
            times.append(times[-1] + float(max(length / speed, turn / TURN_DEG_S)))
    return np.array(times, np.float64)


def _positions(walk: _Walk, time_s: FloatArray, ground: Ground | None) -> FloatArray:
    """(k, 3) metres."""
    curve = walk.curve
    if len(walk.time_s) == 1:
        return np.repeat(curve.points, len(time_s), axis=0)
    leg: Legs = np.searchsorted(walk.time_s, time_s, side="right") - 1
    leg = np.clip(leg, 0, len(walk.time_s) - 2)
    begins, ends = walk.time_s[leg], walk.time_s[leg + 1]
    spent = np.divide(time_s - begins, ends - begins, out=np.ones_like(begins), where=ends > begins)
    fraction = np.clip(spent, 0.0, 1.0)
    parameter = curve.parameter(leg, fraction)
    position = curve.at(leg, parameter, curve.points)
    if ground is not None:
        above = np.array([float(station.above_ground) for station in walk.path.stations])
        share = (1 - fraction) * above[curve.start[leg]] + fraction * above[curve.end[leg]]
        smooth = curve.at(leg, parameter, walk.ground)[:, 0]
        for k in np.flatnonzero(share > 0):
            real = ground(float(position[k, 0]), float(position[k, 2]))
            position[k, 1] += share[k] * (real - smooth[k])
    return position


def _directions(walk: _Walk, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(k,) yaw and pitch in degrees."""
    from scipy.interpolate import PchipInterpolator

    angles = np.stack([walk.yaw_deg, walk.pitch_deg], axis=1)
    least = max(NO_TIME * float(walk.time_s[-1] - walk.time_s[0]), NO_TIME_S)
    later = np.concatenate([[True], np.diff(walk.time_s) > least])  # a leg may take no time
    times, angles = walk.time_s[later], angles[later]
    if len(times) == 1:
        found = np.repeat(angles[-1:], len(time_s), axis=0)
    else:
        if walk.curve.closed:  # as smooth at the first station as at any other one
            around = angles[-1] - angles[0]
            duration = times[-1] - times[0]
            times = np.concatenate([[times[-2] - duration], times, [times[1] + duration]])
            angles = np.stack([angles[-2] - around, *angles, angles[1] + around])
        with np.errstate(over="ignore"):  # a slope of next to nothing, whose inverse is taken
            found = np.asarray(PchipInterpolator(times, angles)(time_s), np.float64)
    return found[:, 0], np.clip(found[:, 1], -90.0, 90.0)


def _unwound(yaw_deg: FloatArray) -> FloatArray:
    """(m,) degrees, each the shortest way from the one before; of two, the one to the left."""
    turns = 180.0 - (180.0 - np.diff(yaw_deg)) % 360.0
    return np.asarray(yaw_deg[0] + np.concatenate([[0.0], np.cumsum(turns)]))


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
