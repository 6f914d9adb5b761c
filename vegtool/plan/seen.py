"""How many pixels of each species are seen, at which distances: what an error counts by.

By the law of Beer and Lambert: of what is behind a crown of opacity a, 1 - a is seen. Plants are
balls, and are looked at from the nearest on, against a grid of the sphere around the eye.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.needs.need import ball_of
from vegtool.tiles.library import Species
from vegtool.tiles.placement import Placement
from vegtool.tiles.stand import stand_on

ACROSS, UP = 256, 128
"""Cells of the sphere around an eye, all of the same solid angle."""
CELL = 4 * pi / (ACROSS * UP)
"""Steradians."""
OPACITY = 0.5
"""Of a plant's ball: of the samples' crowns, half is covered or more."""
STEP = 1.05
"""From one shell of distances to the next: plants within one do not hide each other."""
MOST_PLANTS = 200_000
"""That an eye looks at, the nearest tiles first; what is farther is hidden behind them."""


@dataclass(frozen=True, eq=False)
class Balls:
    """n plants. middle: (n, 3) metres. radius: (n,) metres. scale: (n,). kind: (n,) int32."""

    middle: FloatArray
    radius: FloatArray
    scale: FloatArray
    kind: IntArray


def seen_pixels(
    eyes: FloatArray,
    species: Sequence[Species],
    placement: Placement,
    at_m: FloatArray,
    focal_px: float,
) -> FloatArray:
    """(s, k) pixels of each species, in the mean of the eyes and all around each, of plants whose
    distance, divided by their scale, is nearest by ratio to each of `at_m`, (k,) metres, ascending.

    eyes: (e, 3) metres. focal_px: pixels of a metre at a distance of one.
    """
    total = np.zeros((len(species), len(at_m)))
    edges = np.sqrt(at_m[1:] * at_m[:-1])
    for eye in eyes:
        balls = _around(eye, species, placement)
        away = np.linalg.norm(balls.middle - eye, axis=1)
        pixels = focal_px**2 * in_sight(balls.middle - eye, balls.radius)
        bin_ = np.searchsorted(edges, away / balls.scale)
        np.add.at(total, (balls.kind, bin_), pixels)
    return total / max(len(eyes), 1)


def _around(eye: FloatArray, species: Sequence[Species], placement: Placement) -> Balls:
    """The plants of the nearest tiles."""
    tiles = placement.tiles
    near = np.linalg.norm(np.clip(eye, tiles.low, tiles.high) - eye, axis=1)
    order = np.argsort(near, kind="stable")
    count = int(np.searchsorted(np.cumsum(tiles.count[order]), MOST_PLANTS)) + 1
    stand = stand_on(placement, order[:count], species)
    center, radius = np.array([ball_of(one) for one in species]).T
    middle = stand.foot.copy()
    middle[:, 1] += stand.scale * center[stand.species]
    return Balls(middle, stand.scale * radius[stand.species], stand.scale, stand.species)


def in_sight(middle: FloatArray, radius: FloatArray) -> FloatArray:
    """(n,) steradians of balls about (n, 3), metres from the eye, that are seen: each times what
    those before it let through, and its opacity. Of one that the eye is in, half of the sphere."""
    away = np.linalg.norm(middle, axis=1)
    inside = away <= radius
    sine = np.where(inside, 1.0, radius / np.maximum(away, 1e-12))
    solid = 2 * pi * (1 - np.sqrt(1 - sine**2))
    found = np.zeros(len(middle))
    depth = np.zeros((UP, ACROSS))  # optical, of what was passed in each cell
    row = np.clip((middle[:, 1] / np.maximum(away, 1e-12) + 1) / 2 * UP, 0, UP - 1e-9)
    column = (np.arctan2(middle[:, 0], middle[:, 2]) / (2 * pi) + 0.5) * ACROSS % ACROSS
    thick = -np.log(1 - OPACITY)
    order = np.argsort(away, kind="stable")
    shell = np.floor(np.log(np.maximum(away, 1e-6)) / np.log(STEP)).astype(np.int64)[order]
    starts = np.flatnonzero(np.diff(shell, prepend=shell[:1] - 1))
    for first, end in zip(starts, np.append(starts[1:], len(order)), strict=True):
        here = order[first:end]
        small = here[solid[here] <= CELL]
        cell = row[small].astype(int), column[small].astype(int)
        found[small] = OPACITY * solid[small] * np.exp(-depth[cell])
        windows = []
        for index in here[solid[here] > CELL]:
            rows, columns = _window(row[index], column[index], float(sine[index]))
            seen = float(np.exp(-depth[np.ix_(rows, columns)]).mean())
            found[index] = OPACITY * solid[index] * seen
            share = min(solid[index] / (len(rows) * len(columns) * CELL), 1.0)
            windows.append((rows, columns, share))
        np.add.at(depth, cell, thick * solid[small] / CELL)
        for rows, columns, share in windows:
            depth[np.ix_(rows, columns)] += thick * share
    return found


def _window(row: float, column: float, sine: float) -> tuple[IntArray, IntArray]:
    """Cells of the box around a ball: rows, and columns, which go round."""
    height = 2 * row / UP - 1  # sine of the elevation
    level = np.arcsin(np.clip(height, -1, 1))
    half = np.arcsin(min(sine, 1.0))
    low, high = (np.sin(np.clip(level + s * half, -pi / 2, pi / 2)) for s in (-1, 1))
    over = abs(level) + half >= pi / 2
    turn = pi if over else float(np.arcsin(min(sine / np.cos(level), 1.0)))
    rows = np.arange(int((low + 1) / 2 * UP), min(int((high + 1) / 2 * UP), UP - 1) + 1)
    reach = turn / (2 * pi) * ACROSS
    if 2 * reach + 1 >= ACROSS:
        return rows.astype(np.int32), np.arange(ACROSS, dtype=np.int32)
    columns = np.arange(int(np.floor(column - reach)), int(np.floor(column + reach)) + 1)
    return rows.astype(np.int32), (columns % ACROSS).astype(np.int32)
