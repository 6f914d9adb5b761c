"""Which boxes the ground hides from every eye of a scene.

What lies behind ground is below the horizon (L. De Floriani and P. Magillo, "Visibility algorithms
on triangulated digital terrain models", 1994, section 2). Here all lines of sight from a column of
eyes to a box are taken together: they cross an upright plane between both along a line, no higher
than known. Where the ground along all of it is higher, none of them goes on. What is not hidden as
a whole may be by its quarters. Least heights of the ground are taken from a pyramid of them, so
that wide lines cost no more than narrow ones.

Nothing is promised of what is not found: a box may be hidden by one hill from some eyes, by another
from others, or behind a crest between two planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.needs.cells import Cells
from vegtool.needs.planar import BoolArray
from vegtool.needs.viewers import Viewers
from vegtool.tiles.grid import Grid
from vegtool.tiles.terrain import Terrain

PLANES = 32
"""Upright planes between a column of eyes and a box."""
ACROSS = 16
"""Parts of the line in which lines of sight cross one."""
OVER_M = 0.1
"""How much higher than a line of sight ground is to be that hides it, for what is rounded."""
SPLITS = 1
"""Times that a box which seems to be hidden is cut into quarters, each of which may be by another
crest. Of 400 squares of 32 m among hills of 50 m, 58 seem to be, from a lawn; with 0, 1 and 2 times
30, 36 and 38 are found, in 0.5, 1.4 and 3.7 s."""
FEW = 12
"""Columns from which it is looked at whether a box seems to be."""
SIDE = 16
"""Of the squares that columns are put together in, along each side of all of them."""
TURNS = 16
"""In which columns are looked at, each from all over: what some see is not looked at again."""
PAIRS = 2**9
"""Columns times boxes that are looked at at a time."""


@dataclass(frozen=True, eq=False)
class _Least:
    """Least heights, metres, of all that is no farther than a block from a block's own, in blocks
    of 1, 2, 4, ... cells of a grid, one level after the other; nothing beyond the grid is high.

    first, rows, columns: (l,) int64 of each level. step, half: (2,) metres, as of the grid.
    """

    values: FloatArray
    first: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    step: FloatArray
    half: FloatArray

    def around(self, points: FloatArray, block_m: FloatArray) -> FloatArray:
        """(n,) metres that no ground within (n,) metres of points (n, 2) is lower than."""
        level = np.ceil(np.log2(np.maximum(block_m / self.step.min(), 1.0))).astype(np.int64)
        known = level < len(self.first)
        level = np.where(known, level, 0)
        inside = known & (np.abs(points) <= self.half).all(axis=1)
        block = np.floor((points + self.half) / self.step).astype(np.int64)
        column, row = block.T >> level
        column = np.clip(column, 0, self.columns[level] - 1)
        row = np.clip(row, 0, self.rows[level] - 1)
        found = self.values[self.first[level] + row * self.columns[level] + column]
        return np.where(inside, found, -np.inf)


def hidden(boxes: FloatArray, viewers: Viewers) -> BoolArray:
    """(n,) whether the ground is before all of boxes (n, 2, 3), least and greatest corners in
    metres, as seen from wherever an eye may be; of none where it is no heightmap."""
    grid, cells = viewers.floor.terrain.grid, viewers.cells
    if grid is None or not np.isfinite(cells.high).all():
        return np.zeros(len(boxes), np.bool_)
    least, cells = _least_of(grid), _fewer(cells)
    may_be = _seems_hidden(boxes, cells, viewers.floor.terrain)
    of, pieces = np.flatnonzero(may_be), boxes[may_be]
    for _ in range(SPLITS):
        seen = ~_all_hidden(pieces, cells, least)
        of, pieces = np.repeat(of[seen], 4), _quarters(pieces[seen])
    may_be[of[~_all_hidden(pieces, cells, least)]] = False
    return may_be


def _seems_hidden(boxes: FloatArray, cells: Cells, ground: Terrain) -> BoolArray:
    """(n,) whether the ground is before the top of boxes, in its middle and in its corners, as seen
    from the middles of some columns: else the rest need not be looked at."""
    some = np.unique(np.linspace(0, len(cells) - 1, FEW).astype(np.int64))
    middle = (cells.start[some] + cells.end[some]) / 2
    eyes = np.stack([middle[:, 0], cells.high[some], middle[:, 1]], axis=1)
    share = np.linspace(0, 1, PLANES)[:, None, None]
    found = np.ones(len(boxes), np.bool_)
    for x, z in ((0.5, 0.5), (0, 0), (0, 1), (1, 0), (1, 1)):
        left = np.flatnonzero(found)
        low, high = boxes[left, 0], boxes[left, 1]
        place = np.where([False, True, False], high, low + (high - low) * [x, 1, z])
        for eye in eyes:
            line = eye + share * (place - eye)
            height = ground.height(line[..., [0, 2]].reshape(-1, 2)).reshape(line.shape[:2])
            found[left[~(height > line[..., 1]).any(axis=0)]] = False
    return found


def _quarters(boxes: FloatArray) -> FloatArray:
    """(4 n, 2, 3) each box's quarters, as high as it is."""
    low, high = boxes[:, 0], boxes[:, 1]
    middle = (low + high) / 2
    found = []
    for x in (False, True):
        for z in (False, True):
            upper = np.array([x, False, z])
            ends = (
                np.where(upper, middle, low),
                np.where(upper | [False, True, False], high, middle),
            )
            found.append(np.stack(ends, axis=1))
    return np.stack(found, axis=1).reshape(-1, 2, 3)


def _all_hidden(boxes: FloatArray, cells: Cells, least: _Least) -> BoolArray:
    """(n,) whether no line from any column to a box goes over the ground."""
    found, left = np.zeros(len(boxes), np.bool_), np.arange(len(boxes))
    turns = min(TURNS, len(cells))
    for turn in range(turns):
        kept = np.zeros(len(cells), np.bool_)
        kept[turn::turns] = True
        some = cells.only(kept)
        count = max(PAIRS // len(some), 1)
        is_hidden = [
            _hidden_from(boxes[left[first : first + count]], some, least).all(axis=1)
            for first in range(0, len(left), count)
        ]
        left = left[np.concatenate([*is_hidden, np.zeros(0, np.bool_)])]
    found[left] = True
    return found


def _fewer(cells: Cells) -> Cells:
    """Columns that hold some of these each, those whose middles are on a square."""
    if len(cells) <= SIDE:
        return cells
    middle = (cells.start + cells.end) / 2
    low, size = middle.min(axis=0), np.ptp(middle, axis=0).max()
    square = np.minimum((SIDE * (middle - low) / max(size, 1e-9)).astype(np.int64), SIDE - 1)
    found = []
    for here in np.unique(square, axis=0):
        some = cells.only((square == here).all(axis=1))
        ends = np.stack([some.start, some.end])
        center = (ends.min(axis=(0, 1)) + ends.max(axis=(0, 1))) / 2
        reach = (np.linalg.norm(ends - center, axis=2) + some.radius).max()
        found.append((center, reach, some.low.min(), some.high.max()))
    center, reach, bottom, top = (np.array(part) for part in zip(*found, strict=True))
    return Cells(center, center, reach, bottom, top)


def _hidden_from(boxes: FloatArray, cells: Cells, least: _Least) -> BoolArray:
    """(n, c) whether lines from columns to boxes all end at the ground."""
    flat = boxes[:, :, [0, 2]]
    middle, half = flat.mean(axis=1), (flat[:, 1] - flat[:, 0]) / 2
    from_, span = (cells.start + cells.end) / 2, (cells.end - cells.start) / 2
    way = middle[:, None] - from_
    away = np.hypot(way[..., 0], way[..., 1])
    along = way / np.maximum(away, 1e-9)[..., None]
    aside = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    # half extents of both along the way and beside it
    eye_u = np.abs((span * along).sum(axis=-1)) + cells.radius
    eye_v = np.abs((span * aside).sum(axis=-1)) + cells.radius
    box_u = (half[:, None] * np.abs(along)).sum(axis=-1)
    box_v = (half[:, None] * np.abs(aside)).sum(axis=-1)
    between = away - box_u - eye_u
    share = (np.arange(PLANES) + 0.5) / PLANES
    at = eye_u[..., None] + share * np.maximum(between, 0.0)[..., None]  # (n, c, p) from the middle
    # how wide all lines are there: the hull of both rectangles
    near, far = (
        np.where(eye_v < box_v, -eye_u, eye_u),
        np.where(eye_v < box_v, away - box_u, away + box_u),
    )
    part = (at - near[..., None]) / np.maximum(far - near, 1e-9)[..., None]
    wide = eye_v[..., None] + part * (box_v - eye_v)[..., None]
    # how high: up or down to the top of the box, from the highest eye
    rise = boxes[:, 1, 1, None] - cells.high
    up = (at + eye_u[..., None]) / np.maximum(away - box_u + eye_u, 1e-9)[..., None]
    down = (at - eye_u[..., None]) / np.maximum(away + box_u - eye_u, 1e-9)[..., None]
    high = cells.high[:, None] + rise[..., None] * np.where(rise[..., None] > 0, up, down)
    beside = np.linspace(-1.0, 1.0, ACROSS + 1)
    center = from_[:, None] + at[..., None] * along[:, :, None]  # (n, c, p, 2)
    points = center[:, :, :, None] + (wide[..., None] * beside)[..., None] * aside[:, :, None, None]
    block = np.broadcast_to((wide / ACROSS)[..., None], points.shape[:-1])
    ground = least.around(points.reshape(-1, 2), block.ravel()).reshape(block.shape).min(axis=-1)
    return np.asarray((ground >= high + OVER_M).any(axis=-1) & (between > 0))


def _least_of(grid: Grid) -> _Least:
    """Of a grid's cells, by their four corners, and of blocks of them."""
    values = np.asarray(grid.values, np.float64)
    level = _pairs(_pairs(values, 0), 1)
    found, shapes = list[FloatArray](), list[tuple[int, ...]]()
    while True:
        found.append(_around(level).ravel())
        shapes.append(level.shape)
        if min(level.shape) < 4:
            break
        level = _halved(_halved(level, 0), 1)
    sizes = np.array([one.size for one in found])
    rows, columns = np.array(shapes, np.int64).T
    return _Least(
        np.concatenate(found), np.cumsum(sizes) - sizes, rows, columns, grid.step, grid.extent / 2
    )


def _pairs(values: FloatArray, axis: int) -> FloatArray:
    """The lesser of each two neighbours."""
    count = values.shape[axis]
    return np.minimum(
        np.take(values, np.arange(count - 1), axis), np.take(values, np.arange(1, count), axis)
    )


def _halved(values: FloatArray, axis: int) -> FloatArray:
    """Of each two along an axis the lesser, the last alone where it is."""
    return np.asarray(np.minimum.reduceat(values, np.arange(0, values.shape[axis], 2), axis=axis))


def _around(values: FloatArray) -> FloatArray:
    """Of each with its eight neighbours the least."""
    for axis in (0, 1):
        edged = np.pad(values, [(1, 1) if axis == k else (0, 0) for k in (0, 1)], mode="edge")
        count = values.shape[axis]
        parts = [np.take(edged, np.arange(k, k + count), axis) for k in range(3)]
        values = np.minimum.reduce(parts)
    return values
