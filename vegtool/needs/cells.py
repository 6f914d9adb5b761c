"""Parts of space that hold all eyes: upright columns over the segments of a path or over squares.

An area is covered by squares, a path by segments of its course. Each is split until the ground
rises so little in it that distances hold to TIGHT of what an eye is above the ground, or to RISE_M;
but an area no further than into SIDE x SIDE squares, and a leg of a path into as many pieces as its
curve is measured by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, checked
from vegtool.camera_path.course import Course
from vegtool.camera_path.curve import PIECES
from vegtool.needs.floor import Floor
from vegtool.needs.planar import gaps, within

TIGHT = 0.05
"""Of an eye's height above the ground, how much the ground may rise in a cell."""
RISE_M = 0.25
"""How much it may rise anyway."""
FLAT_M = 0.1
"""How far a path may be from the segments that stand for it."""
LEVELS = 6
SIDE = 2**LEVELS
"""Most squares along a side of an area."""

Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Cells:
    """c columns: all within `radius` of a segment in the plane, between two heights.

    start, end: (c, 2) metres x and z. radius: (c,) metres. low, high: (c,) metres, heights in the
    scene's frame; high may be infinite.
    """

    start: FloatArray
    end: FloatArray
    radius: FloatArray
    low: FloatArray
    high: FloatArray

    def __post_init__(self) -> None:
        start = checked("Cells.start", self.start, (None, 2), np.float64)
        count = len(start)
        if not count or np.isnan(self.high).any() or (self.low > self.high).any():
            raise ValueError("Cells: expected one at least, none whose low is above its high")
        values = {
            "start": start,
            "end": checked("Cells.end", self.end, (count, 2), np.float64),
            "radius": checked("Cells.radius", self.radius, (count,), np.float64),
            "low": checked("Cells.low", self.low, (count,), np.float64),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.start)

    def only(self, kept: np.ndarray) -> Cells:
        """Those of a mask (c,)."""
        return Cells(
            self.start[kept], self.end[kept], self.radius[kept], self.low[kept], self.high[kept]
        )


def cells_of_area(corners: FloatArray, margin: float, floor: Floor, height: Range) -> Cells:
    """The columns over a polygon (v, 2) and what is within a margin of it, metres; eyes are so
    high above the ground."""
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    ends = np.roll(corners, -1, axis=0)
    allowed = max(RISE_M, TIGHT * height[0])
    cell = np.zeros((1, 2), np.int64)
    parts = []
    for level in range(LEVELS + 1):
        size = (high - low) / 2**level
        first = low + cell * size
        meets = within(first, corners) | (gaps(first, first + size, corners, ends) <= margin).any(1)
        cell, first = cell[meets], first[meets]
        least, greatest = floor.within(first, first + size)
        done = (greatest - least <= allowed) | (level == LEVELS)
        middle = first[done] + size / 2
        radius = np.full(len(middle), np.hypot(*size) / 2)
        parts.append((middle, radius, least[done] + height[0], greatest[done] + height[1]))
        quarters = [[0, 0], [1, 0], [0, 1], [1, 1]]
        cell = (2 * cell[~done][:, None] + quarters).reshape(-1, 2)
    middle, radius, bottom, top = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Cells(middle, middle, radius, bottom, top)


@dataclass(frozen=True, eq=False)
class Pieces:
    """A course cut up, p pieces. node: (p + 1, 2) metres x and z, where they meet. bend: (p,)
    metres, no more than which the course is off the straight piece. low, high: (p,) metres, heights
    of all eyes. above: (p, 2) metres, least and greatest height of the course itself above the
    ground. station: (p,) the one before."""

    node: FloatArray
    bend: FloatArray
    low: FloatArray
    high: FloatArray
    above: FloatArray
    station: np.ndarray


def pieces_of(course: Course, margin: float, floor: Floor, height: Range | None) -> Pieces:
    """A course cut up, with the heights of eyes within a margin of it.

    An eye that leaves the course keeps its height, or its height above the ground, as the path does
    or as it does not; one of the heights that are given above the ground may be there as well.
    """
    legs, count = len(course.curve.length), PIECES + 1
    if not legs:
        ends = np.repeat(course.curve.points, 2, axis=0)
        share = np.full((1, 2), float(course.path.stations[0].above_ground))
        level = np.repeat(course.ground, 2, axis=0).T
        usual = level[:, :1]
        base = ends[None, :, 1] - share * (level - usual)
        bend, sway = np.zeros(1), np.zeros(1)
        station = np.zeros(1, np.int64)
    else:
        leg = np.repeat(np.arange(legs), count)
        length = course.curve.length[:, None]
        fraction = np.divide(
            course.curve.walked, length, out=np.zeros((legs, count)), where=length > 0
        )
        parameter = np.tile(np.linspace(0.0, 1.0, count), legs)
        at = course.at(leg, parameter, fraction.ravel(), floor.terrain.height).reshape(
            legs, count, 3
        )
        share = course.share(leg, fraction.ravel()).reshape(legs, count)
        level = floor.terrain.height(at[..., [0, 2]].reshape(-1, 2)).reshape(legs, count)
        usual = level.mean(axis=1, keepdims=True)  # heights are small from there on
        base = at[..., 1] - share * (level - usual)
        # a cubic is off its chord by at most an eighth of its second difference, which is linear
        bend = _second(at[..., [0, 2]]).ravel() / 8
        sway = _second(base[..., None]).ravel() / 4  # it is no cubic where the share changes
        ends = np.concatenate([at[:, :-1].reshape(-1, 3), at[-1, -1:]])
        station = np.repeat(course.curve.start, PIECES)
    pairs = np.stack([base[:, :-1], base[:, 1:]]).reshape(2, -1)
    lowest, highest = pairs.min(axis=0) - sway, pairs.max(axis=0) + sway
    shares = np.stack([share[:, :-1], share[:, 1:]]).reshape(2, -1)
    node = ends[:, [0, 2]]
    first, last = np.minimum(node[:-1], node[1:]), np.maximum(node[:-1], node[1:])
    under = floor.within(first - bend[:, None], last + bend[:, None])
    around = floor.within(first - bend[:, None] - margin, last + bend[:, None] + margin)
    if floor.feet is not None:  # paths are walked at heights above 0, then
        base_m = floor.terrain.base
        under, around = (
            (np.minimum(least, base_m), np.maximum(greatest, base_m))
            for least, greatest in (under, around)
        )
    usual = np.repeat(usual[:, 0], base.shape[1] - 1)
    under, around = ((least - usual, greatest - usual) for least, greatest in (under, around))
    most = _products(shares, around)
    low, high = lowest + most.min(axis=0), highest + most.max(axis=0)
    if margin:  # what keeps above the ground though the path does not
        rest = _products(1 - shares, under)
        low = np.minimum(low, lowest + around[0] - rest.max(axis=0))
        high = np.maximum(high, highest + around[1] - rest.min(axis=0))
    if height is not None:
        low = np.minimum(low, usual + around[0] + height[0])
        high = np.maximum(high, usual + around[1] + height[1])
    ground = floor.terrain.height(node) if floor.feet is None else floor.feet[1]
    above = ends[:, 1] - ground
    return Pieces(
        node, bend, low, high,
        np.stack([np.minimum(above[:-1], above[1:]), np.maximum(above[:-1], above[1:])], axis=1),
        station,
    )  # fmt: skip


def cells_of_path(pieces: Pieces, margin: float) -> Cells:
    """The columns around a course, within a margin of it, metres."""
    rise, above = pieces.high - pieces.low, pieces.above[:, 0]

    def whole(i: int, j: int) -> bool:
        allowed = max(RISE_M, TIGHT * float(above[i:j].min()))
        spread = pieces.high[i:j].max() - pieces.low[i:j].min()
        return bool(spread - rise[i:j].max() <= allowed)

    first, last, off = _joined(pieces, whole)
    parts = np.stack([first, last - 1], axis=1)
    low = np.array([pieces.low[i : j + 1].min() for i, j in parts])
    high = np.array([pieces.high[i : j + 1].max() for i, j in parts])
    return Cells(pieces.node[first], pieces.node[last], off + margin, low, high)


def outline_of_path(pieces: Pieces) -> tuple[FloatArray, float]:
    """(v, 2) corners of a line, and how far the course is off it at most, metres."""
    first, last, off = _joined(pieces, lambda i, j: True)
    return pieces.node[np.append(first, last[-1])], float(off.max())


def _joined(
    pieces: Pieces, whole: Callable[[int, int], bool]
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Nodes (s,) where straight segments begin and end that stand for some pieces each, and (s,)
    metres that the course is off them. Split as Ramer (1972) and Douglas and Peucker (1973) do, at
    the node that is farthest off; in the middle where only `whole` asks for it."""
    found = []
    left = [(0, len(pieces.bend))]
    while left:
        i, j = left.pop()
        start, end = pieces.node[i : i + 1], pieces.node[j : j + 1]
        part = pieces.node[i : j + 1]
        away = gaps(part, part, start, end)[:, 0]
        off = float(away.max() + pieces.bend[i:j].max())
        bent = off > FLAT_M
        if j - i == 1 or not (bent or not whole(i, j)):
            found.append((i, j, off))
            continue
        middle = (i + j) // 2
        if bent and away.max() > 0:
            middle = min(max(i + int(away.argmax()), i + 1), j - 1)
        left += [(middle, j), (i, middle)]
    first, last, distance = zip(*found, strict=True)
    return np.array(first), np.array(last), np.array(distance, np.float64)


def _second(values: FloatArray) -> FloatArray:
    """(l, p) the greater second difference, in length, at the ends of each piece of legs whose
    values at p + 1 places are (l, p + 1, c); linear beyond the first and the last."""
    inner = np.diff(values, n=2, axis=1)
    first, last = 2 * inner[:, :1] - inner[:, 1:2], 2 * inner[:, -1:] - inner[:, -2:-1]
    size = np.linalg.norm(np.concatenate([first, inner, last], axis=1), axis=2)
    return np.asarray(np.maximum(size[:, :-1], size[:, 1:]))


def _products(share: FloatArray, ground: tuple[FloatArray, FloatArray]) -> FloatArray:
    """(4, p) of shares (2, p) and bounds of the ground."""
    return np.stack([share[i] * ground[j] for i in (0, 1) for j in (0, 1)])
