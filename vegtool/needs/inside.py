"""Eyes at random inside a description: for tests, and to show that nothing was lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.needs.planar import gaps, within
from vegtool.needs.viewers import Viewers
from vegtool.seeding import generator

ANY_M = (0.1, 1000.0)
"""Least and greatest height above the ground of eyes that may be at any: as many in each octave."""
TRIES = 64
"""Places that are looked at for each eye at least, until one is in the area."""


@dataclass(frozen=True, eq=False)
class Eyes:
    """position: (n, 3) metres in the scene's frame. yaw_deg: (n,), 0 looks along -z, and grows to
    the left. pitch_deg: (n,) above the horizon."""

    position: FloatArray
    yaw_deg: FloatArray
    pitch_deg: FloatArray

    def __len__(self) -> int:
        return len(self.position)


def inside(viewers: Viewers, count: int, seed: int) -> Eyes:
    """Random eyes of a description: anywhere in its area, or along its path, at any of its heights,
    looking anywhere. The same for the same seed."""
    random = generator(seed, "eyes")
    find = _in_area if viewers.course is None else _along_path
    position = find(viewers, count, random)
    pitch = np.degrees(np.arcsin(random.uniform(-1, 1, count)))  # as many on each part of a sphere
    return Eyes(position, random.uniform(0, 360, count), pitch)


def _in_area(viewers: Viewers, count: int, random: np.random.Generator) -> FloatArray:
    corners, margin = viewers.outline, viewers.margin_m
    ends = np.roll(corners, -1, axis=0)
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    found = np.empty((0, 2))
    while len(found) < count:
        tried = random.uniform(low, high, (max(count, TRIES), 2))
        on = within(tried, corners) | (gaps(tried, tried, corners, ends) <= margin).any(axis=1)
        found = np.concatenate([found, tried[on]])
    found = found[:count]
    y = _ground(viewers, found, random) + _height(viewers, count, random)
    return np.stack([found[:, 0], y, found[:, 1]], axis=1)


def _along_path(viewers: Viewers, count: int, random: np.random.Generator) -> FloatArray:
    course = viewers.course
    assert course is not None
    legs = course.curve.length
    if len(legs):
        weight = legs / legs.sum() if legs.sum() > 0 else np.full(len(legs), 1 / len(legs))
        leg = random.choice(len(legs), count, p=weight)
        fraction = random.random(count)
        parameter = course.curve.parameter(leg, fraction)
        at = course.at(leg, parameter, fraction, viewers.floor.terrain.height)
        share = course.share(leg, fraction)
    else:
        at = np.repeat(course.curve.points, count, axis=0)
        share = np.full(count, float(course.path.stations[0].above_ground))
    angle = random.uniform(0, 2 * np.pi, count)
    away = viewers.margin_m * np.sqrt(random.random(count))
    xz = at[:, [0, 2]] + away[:, None] * np.stack([np.sin(angle), np.cos(angle)], axis=1)
    terrain = viewers.floor.terrain
    rise = terrain.height(xz) - terrain.height(at[:, [0, 2]])
    kept = np.where(random.random(count) < 0.5, share, 1.0)  # as the path does, or above the ground
    y = at[:, 1] + kept * rise
    if viewers.height_m is not None:
        own = _ground(viewers, xz, random) + _height(viewers, count, random)
        y = np.where(random.random(count) < 0.5, own, y)
    return np.stack([xz[:, 0], y, xz[:, 1]], axis=1)


def _ground(viewers: Viewers, xz: FloatArray, random: np.random.Generator) -> FloatArray:
    """(n,) metres; anywhere between the lowest and the highest foot where there is none."""
    if viewers.floor.feet is not None:
        return random.uniform(*viewers.floor.feet, len(xz))
    return viewers.floor.terrain.height(xz)


def _height(viewers: Viewers, count: int, random: np.random.Generator) -> FloatArray:
    """(n,) metres above the ground."""
    if viewers.height_m is None:
        low, high = np.log(ANY_M)
        return np.asarray(np.exp(random.uniform(low, high, count)))
    return random.uniform(*viewers.height_m, count)
