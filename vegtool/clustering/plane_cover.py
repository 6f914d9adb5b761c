"""Planes that pass every piece of a surface within a distance: a greedy search in plane space.

Décoret, Durand, Sillion, Dorsey: Billboard clouds for extreme model simplification (2003), sections
3 and 4. A plane is a direction and an offset. A piece is valid for it if each of its corners can
move onto it by at most epsilon. The density of a plane is the projected area of the pieces that are
valid for it. The densest cell of a grid of planes is refined to one plane, the pieces that are
valid for that are taken away, and so on, until all are.

Three things are done otherwise than in the paper. The offset is not subdivided but found: it is
where most of the intervals of valid offsets overlap, by their sorted ends; the direction is tilted,
by half as much each time. Densities are sums of whole numbers, so that what is taken away leaves
nothing behind. And there is no penalty for pieces that a plane just misses, which costs planes and
time (docs/methods/plane_space.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.clustering.features import Labels

DIRECTIONS = 256
"""Of the grid, over half a sphere: some 9 degrees apart."""
MOST_OFFSETS = 512
"""Of the grid."""
CELL = 0.5
"""Of epsilon: a cell's depth, where that takes no more than MOST_OFFSETS."""
TILTS = 4
"""Times a direction is refined."""
STEP = 2.0**-44
"""Of all weight: densities are multiples of it, which float64 adds without error."""
ROUNDING = 1e-9
"""Radii, by which corners may lie beyond epsilon."""
MOST_PIECES = 1 << 14
"""Among which planes are sought at a time: the others join the planes of every nth of them."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """What goes onto planes whole: p pieces of f faces, lengths in radii, centred.

    corners: (3, f, 3), of the faces, those of a piece one after another. first: (p,) the face with
    which each piece begins. area: (f, 3) normals, as long as the faces weigh, all together 1. bare:
    (f,) what faces weigh that have no normal.
    """

    corners: FloatArray
    first: Labels
    area: FloatArray
    bare: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    def of(self, rows: Labels) -> Pieces:
        """Some of them."""
        ends = np.append(self.first[1:], len(self.area))
        count = ends[rows] - self.first[rows]
        first = np.cumsum(count) - count
        face = np.repeat(self.first[rows] - first, count) + np.arange(int(count.sum()))
        return Pieces(self.corners[:, face], first, self.area[face], self.bare[face])

    def spans(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(d, p) least and greatest offset of the pieces' corners along (d, 3) unit vectors."""
        low = np.empty((len(directions), len(self)))
        high = np.empty_like(low)
        for nth, direction in enumerate(directions):
            a, b, c = self.corners @ direction
            low[nth] = np.minimum.reduceat(np.minimum(np.minimum(a, b), c), self.first)
            high[nth] = np.maximum.reduceat(np.maximum(np.maximum(a, b), c), self.first)
        return low, high

    def projected(self, directions: FloatArray) -> FloatArray:
        """(d, p) area of the pieces along (d, 3) unit vectors, in multiples of STEP."""
        seen = np.abs(self.area @ directions.T) + self.bare[:, None]
        return np.asarray(np.rint(np.add.reduceat(seen, self.first, axis=0).T / STEP) * STEP)

    @cached_property
    def on_grid(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(DIRECTIONS, p) spans and areas along the directions of the grid."""
        return *self.spans(GRID), self.projected(GRID)


@dataclass(frozen=True, eq=False)
class Cover:
    """k planes, and which of them each piece is moved onto: labels (p,) 0..k-1. normal: (k, 3)
    unit. offset: (k,) radii, of normal . x."""

    labels: Labels
    normal: FloatArray
    offset: FloatArray


def cover(pieces: Pieces, epsilon: float, most: int) -> Cover | None:
    """Planes within `epsilon` radii of all pieces; None where that takes more than `most`.

    A piece that no plane passes within epsilon has one of its own. The densest plane is the first.
    """
    reach = epsilon + ROUNDING
    if len(pieces) > MOST_PIECES:
        return _joined(pieces, epsilon, reach, most)
    grid = Grid(pieces, reach)
    labels = np.full(len(pieces), -1, dtype=np.int64)
    normals, offsets = list[FloatArray](), list[float]()
    while grid.left.any():
        if len(normals) == most:
            return None
        rows, normal, offset = densest_plane(grid)
        labels[rows] = len(normals)
        normals.append(normal)
        offsets.append(offset)
        grid.take(rows)
    return Cover(labels, np.array(normals), np.array(offsets))


def _joined(pieces: Pieces, epsilon: float, reach: float, most: int) -> Cover | None:
    """The planes of some pieces, which most of the others are valid for, and those of the rest."""
    some = cover(
        pieces.of(np.arange(0, len(pieces), 1 + len(pieces) // MOST_PIECES)), epsilon, most
    )
    if some is None:
        return None
    labels = first_valid(pieces, some, reach)
    left = np.flatnonzero(labels < 0)
    kept = np.unique(labels[labels >= 0])  # of a plane, all pieces may be valid for earlier ones
    labels = np.searchsorted(kept, labels)
    normal, offset = some.normal[kept], some.offset[kept]
    if not len(left):
        return Cover(labels, normal, offset)
    rest = cover(pieces.of(left), epsilon, most - len(kept))
    if rest is None:
        return None
    labels[left] = len(kept) + rest.labels
    return Cover(
        labels, np.concatenate([normal, rest.normal]), np.concatenate([offset, rest.offset])
    )


def first_valid(pieces: Pieces, planes: Cover, reach: float) -> Labels:
    """(p,) the first plane that each piece is valid for, or -1."""
    labels = np.full(len(pieces), -1, dtype=np.int64)
    left = np.arange(len(pieces))
    for nth, (normal, offset) in enumerate(zip(planes.normal, planes.offset, strict=True)):
        low, high = pieces.of(left).spans(normal[None])
        valid = (high[0] - reach <= offset) & (offset <= low[0] + reach)
        labels[left[valid]] = nth
        left = left[~valid]
        if not len(left):
            break
    return labels


class Grid:
    """The density of each cell of plane space, (d, r), of the pieces that are left, (p,) bool."""

    def __init__(self, pieces: Pieces, reach: float) -> None:
        self.pieces, self.reach = pieces, reach
        self.low, self.high, self._area = pieces.on_grid
        self._start = float(self.low.min()) - reach
        length = float(self.high.max()) + reach - self._start
        self._count = int(min(np.ceil(length / (CELL * reach)), MOST_OFFSETS))
        self.cell = length / self._count
        self.left = np.ones(len(pieces), dtype=bool)
        self.density = self._of(np.arange(len(pieces)))

    def densest(self) -> tuple[FloatArray, Labels]:
        """Direction (3,) of the densest cell, and the pieces that planes about it may pass."""
        nth, cell = np.unravel_index(int(self.density.argmax()), self.density.shape)
        offset = self._start + (float(cell) + 0.5) * self.cell
        about = 2 * self.reach + self.cell
        near = (self.low[nth] - about <= offset) & (offset <= self.high[nth] + about)
        return GRID[nth], np.flatnonzero(near & self.left)

    def take(self, rows: Labels) -> None:
        """Pieces off."""
        self.density -= self._of(rows)
        self.left[rows] = False

    def _of(self, rows: Labels) -> FloatArray:
        """(d, r) of some pieces alone: a cell has those that a plane in it may be valid for."""
        size = self._count + 1
        row = size * np.arange(len(self.low))[:, None]
        begin, end = self.high[:, rows] - self.reach, self.low[:, rows] + self.reach
        worth = np.where(begin <= end, self._area[:, rows], 0.0).ravel()
        first, last = (
            np.floor((at - self._start) / self.cell).astype(np.int64) for at in (begin, end)
        )
        first, last = np.clip(first, 0, self._count), np.clip(last + 1, 0, self._count)
        change: FloatArray = np.zeros(row.size * size)
        change += np.bincount((row + first).ravel(), worth, change.size)
        change -= np.bincount((row + last).ravel(), worth, change.size)
        return np.cumsum(change.reshape(-1, size), axis=1)[:, :-1]


def densest_plane(grid: Grid) -> tuple[Labels, FloatArray, float]:
    """Rows of the pieces that are valid for the best plane about the densest cell; its normal and
    its offset."""
    direction, near = grid.densest()
    part, step = grid.pieces.of(near), np.sqrt(2 * np.pi / DIRECTIONS) / 2
    most, offset = -np.inf, 0.0
    valid = np.zeros(len(near), dtype=bool)
    for _ in range(TILTS + 1 if len(near) else 0):
        tilted = tilts(direction, step)
        low, high = part.spans(tilted)
        density, at = densest_offsets(low, high, part.projected(tilted), grid.reach)
        best = int(density.argmax())
        if density[best] > most:
            most, direction, offset = float(density[best]), tilted[best], float(at[best])
            valid = (high[best] - grid.reach <= offset) & (offset <= low[best] + grid.reach)
        step /= 2
    if valid.any():
        return near[valid], direction, offset
    return alone(grid)


def alone(grid: Grid) -> tuple[Labels, FloatArray, float]:
    """The plane of the largest piece that is left: that piece, and all that are valid for it."""
    left = np.flatnonzero(grid.left)
    facing = np.add.reduceat(grid.pieces.area, grid.pieces.first, axis=0)[left]
    largest = int((facing**2).sum(axis=1).argmax())
    normal = unit(facing[largest])
    if not normal.any():
        normal = across(grid.pieces.of(left[largest : largest + 1]).corners[:, 0])
    low, high = (of[0] for of in grid.pieces.of(left).spans(normal[None]))
    offset = float(low[largest] + high[largest]) / 2
    valid = (high - grid.reach <= offset) & (offset <= low + grid.reach)
    valid[largest] = True
    return left[valid], normal, offset


def across(corners: FloatArray) -> FloatArray:
    """(3,) a unit vector across the longest edge of a triangle (3, 3) that has no normal."""
    edges = np.roll(corners, -1, axis=0) - corners
    edge = edges[np.linalg.norm(edges, axis=1).argmax()]
    normal = unit(np.cross(edge, np.eye(3)[np.abs(edge).argmin()]))
    return normal if normal.any() else np.array([0.0, 0.0, 1.0])


def densest_offsets(
    low: FloatArray, high: FloatArray, area: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """(d,) the most area that is valid for one plane along each direction, and its offset."""
    first, last = high - reach, low + reach
    worth = np.where(first <= last, area, 0.0)
    ends = np.concatenate([first, np.nextafter(np.maximum(first, last), np.inf)], axis=1)
    order = np.argsort(ends, axis=1)
    ends = np.take_along_axis(ends, order, axis=1)
    steps = np.take_along_axis(np.concatenate([worth, -worth], axis=1), order, axis=1)
    density = np.cumsum(steps, axis=1)
    density[:, :-1][ends[:, 1:] == ends[:, :-1]] = -np.inf  # not all that begins there is in it
    best, rows = density.argmax(axis=1), np.arange(len(ends))
    return density[rows, best], ends[rows, best]


def tilts(direction: FloatArray, angle: float) -> FloatArray:
    """(9, 3) a direction, and eight that are tilted from it by an angle in radians."""
    u = unit(np.cross(direction, np.eye(3)[np.abs(direction).argmin()]))
    v = np.cross(direction, u)
    way = np.arange(8)[:, None] * np.pi / 4
    out = np.cos(way) * u + np.sin(way) * v
    return np.concatenate([direction[None], np.cos(angle) * direction + np.sin(angle) * out])


def even_hemisphere(count: int) -> FloatArray:
    """(count, 3) unit vectors spread evenly over half a sphere (a Fibonacci lattice)."""
    nth = np.arange(count) + 0.5
    z = nth / count
    angle, r = np.pi * (1 + 5**0.5) * nth, np.sqrt(1 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


GRID = even_hemisphere(DIRECTIONS)
"""Its directions."""
