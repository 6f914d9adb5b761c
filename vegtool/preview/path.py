"""The path of an eye through a scene, walked and recorded.

Positions lie on its course (camera_path/course.py); directions turn the shortest way, by cubics
that stay between the stations' angles: Fritsch, Carlson: Monotone piecewise cubic interpolation
(1980), with slopes as in Fritsch, Butland: A method for constructing local monotone piecewise cubic
interpolants (1984).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isfinite

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.camera_path.course import Course, Ground, course_of, heights
from vegtool.camera_path.curve import Curve, Legs
from vegtool.camera_path.file import FPS, CameraPath, Station
from vegtool.errors import UsageError
from vegtool.preview.eye import FAR_M, NEAR_M, Eye, towards

TURN_DEG_S = 180.0
"""No leg turns faster than that on average, unless its time is given: it takes longer then."""
MOST_FRAMES = 1_000_000
"""Of a path: nine hours at 30 a second."""
EVERY_S = 0.5
"""Time between two stations of a path that is recorded."""

NO_TIME, NO_TIME_S = 1e-12, 1e-100
"""Of a whole way, and seconds: a leg that takes less is as one that takes none, for what turns in
it turns faster than numbers can say."""


@dataclass(frozen=True, eq=False)
class _Walk:
    """A path over the ground. Of each station, and of the first again where the path leads back:
    time_s (m,), yaw_deg (m,) without jumps, pitch_deg (m,)."""

    course: Course
    time_s: FloatArray
    yaw_deg: FloatArray
    pitch_deg: FloatArray


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
    lens = walk.course.path.fov_y_deg, near_m, far_m
    return [Eye(p, float(y), float(t), *lens) for p, y, t in zip(position, yaw, pitch, strict=True)]


def _walked(path: CameraPath, ground: Ground | None) -> _Walk:
    """The path with the ground under it, and its times and directions as they follow from both."""
    course = course_of(path, None if ground is None else heights(ground))
    curve = course.curve
    yaw, pitch = _angles(path, curve)
    again = [*range(len(yaw)), 0] if curve.closed else list(range(len(yaw)))
    yaw, pitch = _unwound(yaw[again]), pitch[again]
    turned = np.maximum(np.abs(np.diff(yaw)), np.abs(np.diff(pitch)))
    return _Walk(course, _times(path, curve, turned), yaw, pitch)


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
    curve = walk.course.curve
    if len(walk.time_s) == 1:
        return np.repeat(curve.points, len(time_s), axis=0)
    leg: Legs = np.searchsorted(walk.time_s, time_s, side="right") - 1
    leg = np.clip(leg, 0, len(walk.time_s) - 2)
    begins, ends = walk.time_s[leg], walk.time_s[leg + 1]
    spent = np.divide(time_s - begins, ends - begins, out=np.ones_like(begins), where=ends > begins)
    fraction = np.clip(spent, 0.0, 1.0)
    real = None if ground is None else heights(ground)
    return walk.course.at(leg, curve.parameter(leg, fraction), fraction, real)


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
        if walk.course.curve.closed:  # as smooth at the first station as at any other one
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
