"""Where a path leads over the ground: positions on a curve through its stations (curve.py)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.camera_path.curve import Curve, Legs, through
from vegtool.camera_path.file import CameraPath

Ground = Callable[[float, float], float]
"""The height of the ground in metres at x, z in metres."""
Heights = Callable[[FloatArray], FloatArray]
"""(n,) heights of the ground in metres at (n, 2) x, z in metres."""


@dataclass(frozen=True, eq=False)
class Course:
    """A path with the ground under it. ground: (n, 1) metres, at each station."""

    path: CameraPath
    curve: Curve
    ground: FloatArray

    def share(self, leg: Legs, fraction: FloatArray) -> FloatArray:
        """(k,) 0 to 1, how far an eye keeps above the ground after a fraction of a leg's length:
        wholly between two stations above it."""
        above = np.array([float(station.above_ground) for station in self.path.stations])
        start, end = above[self.curve.start[leg]], above[self.curve.end[leg]]
        return np.asarray((1 - fraction) * start + fraction * end)

    def at(
        self, leg: Legs, parameter: FloatArray, fraction: FloatArray, ground: Heights | None
    ) -> FloatArray:
        """(k, 3) metres, on legs (k,) at parameters (k,) of their curves, which are reached after
        fractions (k,) of their lengths. ground: what heights are above; level at 0 without."""
        position = self.curve.at(leg, parameter, self.curve.points)
        if ground is not None:
            share = self.share(leg, fraction)
            smooth = self.curve.at(leg, parameter, self.ground)[:, 0]
            on = share > 0
            position[on, 1] += share[on] * (ground(position[on][:, [0, 2]]) - smooth[on])
        return position


def heights(ground: Ground) -> Heights:
    """The heights of ground that is asked place by place."""
    return lambda xz: np.array([ground(float(x), float(z)) for x, z in xz], np.float64)


def course_of(path: CameraPath, ground: Heights | None = None) -> Course:
    """The course of a path over the ground; level at 0 without."""
    points = np.array([station.position for station in path.stations], np.float64)
    above = np.array([station.above_ground for station in path.stations])
    under = np.zeros((len(points), 1))
    if ground is not None:
        under[:, 0] = ground(points[:, [0, 2]])
    points[above, 1] += under[above, 0]
    return Course(path, through(points, path.loop and len(points) > 1), under)
