"""Oriented boxes of least volume, by turning a first box until none of its neighbours is smaller.

Paper: Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes
using hybrid level-of-detail approaches (2005), section 2.1: a first box is jittered in steps of
one degree. Here the steps go from coarse to fine, which leaves the local minima that single
one-degree steps stick in, all neighbours of all boxes are tried at once, and a grid of starts
precedes them; where a cluster is flat or spreads alike along two axes, exact rectangles have the
last word (flush.py). Only points that can touch a box take part: the extreme ones in many
directions, after the cluster has been stretched to equal spread along its principal axes. The box
that comes out is measured on all points.
"""

from __future__ import annotations

from itertools import combinations_with_replacement, product

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes.box import MIN_EXTENT, Boxes
from vegtool.boxes.flush import flush_box
from vegtool.boxes.groups import Groups
from vegtool.boxes.options import BoxOptions

BLOCK = 512
"""Points whose extremes are sought together: their products stay in the processor's cache."""
TIED = 1e-6
"""Variances that differ by less, as a fraction of the largest, leave the principal axes open."""
BLOCKS = 64
"""Blocks taken at once: a cluster of a million triangles takes no more memory than a small one."""
LEAST_SPREAD = 1e-6
"""Standard deviation, as a fraction of the largest, below which a cluster counts as flat there."""
TURNS_PER_STEP = 12
"""Turns taken at most at one angle before going on to the next finer one."""
SHARP = 0.02
"""Fraction of a box's shortest side that the last, halved step may still change it by."""
LEAST_GAIN = 1e-9
"""Fraction of its volume by which a neighbour must be smaller: more than rounding."""
HALVINGS = 12
"""Times the finest step is halved at most: enough for the flattest box that the floor allows."""
BATCH = 32
"""Clusters searched together: their products stay in the processor's cache."""
STARTS = 3
"""Starts that are followed for each cluster: the principal axes and the best of a grid."""


def fit_boxes(
    points: FloatArray, cluster: IntArray, count: int, options: BoxOptions | None = None
) -> Boxes:
    """The box of nearly least volume around the points of each cluster.

    points: (n, 3) metres. cluster: (n,) 0..count-1. Returns `count` boxes, axes from longest to
    shortest, half extents 0 where a cluster is flat; a cluster without points gets a box of no
    size at the origin. Extents below MIN_EXTENT of the cluster's diagonal (twice the greatest
    distance from its mean) count as that long where volumes are compared.
    """
    options = options or BoxOptions()
    center, half = np.zeros((count, 3)), np.zeros((count, 3))
    axes = np.tile(np.eye(3), (count, 1, 1))
    if not len(points):
        return Boxes(center, axes, half)
    groups = Groups(cluster)
    origin, scale, local = centred(points, groups)
    frames, spread = principal_axes(local, groups)
    found = np.empty_like(frames)
    support = support_points(local, groups, frames, spread)
    by_size = np.argsort([len(s) for s in support], kind="stable")
    for start in range(0, len(groups), BATCH):
        batch = by_size[start : start + BATCH]
        found[batch] = search([support[i] for i in batch], options.steps_deg)
    for i in np.flatnonzero(undecided(spread)):
        found[i] = flush_box(support[i], found[i])
    found = found @ frames
    low, high = extents(local, groups, found)
    here = groups.present
    axes[here], half[here] = longest_first(found, (high - low) / 2 * scale[:, None])
    middle = np.einsum("gi,gij->gj", (high + low) / 2, found)
    center[here] = origin + middle * scale[:, None]
    return Boxes(center, axes, half)


def centred(points: FloatArray, groups: Groups) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origin (g, 3) and scale (g,) of each group, and its points (3, n) about the mean, within 1.

    Coordinates lie in three rows, in which the sums of a million points stay fast.
    """
    origin = points[groups.order[groups.starts[:-1]]]
    count = np.diff(groups.starts)
    local = np.empty((3, len(points)))
    for axis, row in enumerate(local):
        np.take(points[:, axis], groups.order, out=row)
        row -= groups.spread(origin[:, axis])  # before summing: keeps all digits
        mean = groups.sum(row) / count
        row -= groups.spread(mean)
        origin[:, axis] += mean
    scale = np.sqrt(groups.greatest(local[0] ** 2 + local[1] ** 2 + local[2] ** 2))
    scale[scale == 0] = 1.0
    local *= groups.spread(1 / scale)
    return origin, scale, local


def principal_axes(local: FloatArray, groups: Groups) -> tuple[FloatArray, FloatArray]:
    """Rows (g, 3, 3) of rotations to the principal axes, and the standard deviations (g, 3)."""
    scatter = np.empty((len(groups), 3, 3))
    for i, j in combinations_with_replacement(range(3), 2):
        scatter[:, i, j] = scatter[:, j, i] = groups.sum(local[i] * local[j])
    values, vectors = np.linalg.eigh(scatter / np.diff(groups.starts)[:, None, None])
    axes = np.swapaxes(vectors, 1, 2)[:, ::-1].copy()
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes, np.sqrt(np.maximum(values[:, ::-1], 0.0))


def undecided(spread: FloatArray) -> npt.NDArray[np.bool_]:
    """(g,) whether points spread alike along two axes, which rounding then chooses, or lie in a
    plane, where the least rectangle is known."""
    variance = spread**2
    gaps = np.append(-np.diff(variance, axis=1), variance[:, 2:], axis=1)
    return np.asarray((gaps <= TIED * variance[:, :1]).any(axis=1))


def support_points(
    local: FloatArray, groups: Groups, frames: FloatArray, spread: FloatArray
) -> list[FloatArray]:
    """Points (m, 3), in the principal frame, that are extreme in some direction, per group."""
    widest = np.where(spread[:, :1] > 0, spread[:, :1], 1.0)
    stretch = 1 / np.maximum(spread, LEAST_SPREAD * widest)
    found = []
    for part, frame, scale in zip(groups.slices(), frames, stretch, strict=True):
        points = np.einsum("ij,jn->in", frame, local[:, part])
        rows = extreme_rows((points * scale[:, None]).astype(np.float32))
        found.append(points[:, rows].T)
    return found


def extreme_rows(points: npt.NDArray[np.float32]) -> npt.NDArray[np.intp]:
    """Which of the points (3, n) are the farthest one way or the other along a direction.

    First the extreme ones of each block, then those of what is left, until one block holds all.
    """
    rows = np.arange(points.shape[1])
    while True:
        blocks = -(-len(rows) // BLOCK)
        padded = np.resize(rows, (blocks, -(-len(rows) // blocks)))
        found = []
        for first in range(0, blocks, BLOCKS):
            part = padded[first : first + BLOCKS]
            along = DIRECTIONS @ np.swapaxes(points[:, part], 0, 1)  # (blocks, directions, points)
            ends = np.concatenate([along.argmax(axis=2), along.argmin(axis=2)], axis=1)
            found.append(np.take_along_axis(part, ends, axis=1).ravel())
        rows = np.unique(np.concatenate(found))
        if blocks == 1:
            return rows


def even_directions(count: int) -> FloatArray:
    """About `count` unit vectors (n, 3), spread evenly over half a sphere, mirrored in two axes.

    A golden spiral fills one octant and its mirror images the others: which way the principal axes
    point, a matter of chance, does not change the box.
    """
    octant = -(-count // 4)
    i = np.arange(octant) + 0.5
    z = 1 - i / octant
    turn = np.pi / 2 * (i * (1 + 5**0.5) / 2 % 1)
    r = np.sqrt(1 - z * z)
    first = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
    mirrors = np.array([[1, 1, 1], [-1, 1, 1], [1, -1, 1], [-1, -1, 1]])
    return np.asarray((mirrors[:, None] * first).reshape(-1, 3))


def search(support: list[FloatArray], steps_deg: tuple[float, ...]) -> FloatArray:
    """Rotations (g, 3, 3), rows are axes, of the smallest boxes found around each set of points."""
    width = max(len(s) for s in support)
    points = np.stack([np.concatenate([s, np.repeat(s[:1], width - len(s), 0)]) for s in support])
    rotation = first_rotations(points).reshape(-1, 3, 3)
    points = np.repeat(points, STARTS, axis=0)
    sides = box_sides(rotation[:, None], points)[:, 0]
    everywhere = np.arange(len(points))
    for degrees in steps_deg:
        jitter(rotation, sides, points, degrees, everywhere)
    for halving in range(1, HALVINGS + 1):
        degrees = steps_deg[-1] / 2**halving
        change = sides.max(axis=1) * np.radians(degrees)
        jitter(rotation, sides, points, degrees, np.flatnonzero(change > SHARP / 2 * sides.min(1)))
    winner = sides.prod(axis=1).reshape(-1, STARTS).argmin(axis=1)
    return np.asarray(rotation.reshape(-1, STARTS, 3, 3)[np.arange(len(winner)), winner])


def first_rotations(points: FloatArray) -> FloatArray:
    """(g, STARTS, 3, 3): none, and those of the grid that give points (g, m, 3) smaller boxes."""
    grid = np.broadcast_to(START_GRID, (len(points), *START_GRID.shape))
    volumes = box_sides(grid, points).prod(axis=2)
    volumes[:, 0] = -1.0  # the principal axes are always one of the starts
    return START_GRID[np.argsort(volumes, axis=1, kind="stable")[:, :STARTS]]


def jitter(
    rotation: FloatArray,
    sides: FloatArray,
    points: FloatArray,
    degrees: float,
    active: npt.NDArray[np.intp],
) -> None:
    """Turn the active boxes to their smallest neighbours until none is smaller, in place.

    rotation: (g, 3, 3) and sides: (g, 3), both updated; points: (g, m, 3).
    """
    turns = rotations(NEIGHBOURS * np.radians(degrees))
    for _ in range(TURNS_PER_STEP):
        if not len(active):
            return
        tried = turns @ rotation[active, None]
        found = box_sides(tried, points[active])
        volumes = found.prod(axis=2)
        best = volumes.argmin(axis=1)
        row = np.arange(len(active))
        better = volumes[row, best] < sides[active].prod(axis=1) * (1 - LEAST_GAIN)
        active = active[better]
        rotation[active] = tried[better, best[better]]
        sides[active] = found[better, best[better]]


def box_sides(rotation: FloatArray, points: FloatArray) -> FloatArray:
    """(g, r, 3) sides of the boxes along rotations (g, r, 3, 3) around points (g, m, 3).

    A side below the floor counts as the floor and a hundredth of itself, so that flat clusters,
    whose volume the floor decides, keep to their plane.
    """
    g, r = rotation.shape[:2]
    along = points @ np.swapaxes(rotation.reshape(g, 3 * r, 3), 1, 2)
    extent = (along.max(axis=1) - along.min(axis=1)).reshape(g, r, 3)
    floor = 2 * MIN_EXTENT  # points lie within a radius of 1
    return np.asarray(np.maximum(extent, floor) + 0.01 * np.minimum(extent, floor))


def rotations(vectors: FloatArray) -> FloatArray:
    """Rotation matrices (r, 3, 3) about vectors (r, 3) by their length in radians (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = (vectors / np.where(angle[:, 0] > 0, angle[:, 0], 1.0)).T
    zero = np.zeros_like(x)
    k = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k))


def extents(local: FloatArray, groups: Groups, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least and greatest coordinate (g, 3) of each group's points along its axes."""
    low, high = np.empty((len(groups), 3)), np.empty((len(groups), 3))
    for i, part in enumerate(groups.slices()):
        along = np.einsum("ij,jn->in", axes[i], local[:, part])
        low[i], high[i] = along.min(axis=1), along.max(axis=1)
    return low, high


def longest_first(axes: FloatArray, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Axes and half extents in descending order, right-handed, with signs that are always alike."""
    order = np.argsort(-half, axis=1, kind="stable")
    half = np.take_along_axis(half, order, axis=1)
    axes = np.take_along_axis(axes, order[:, :, None], axis=1)
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=2)[:, :, None], axis=2)
    axes = np.where(largest < 0, -axes, axes)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes, half


NEIGHBOURS = np.array([n for n in product((-1.0, 0.0, 1.0), repeat=3) if any(n)])
"""(26, 3) rotation vectors to all neighbours of a box, in steps."""
_angles = np.radians([0.0, -22.5, 22.5, -45.0, 45.0])
START_GRID = rotations(np.array(list(product(_angles, repeat=3))))
"""(125, 3, 3) rotations about the principal axes; the first one is none."""
DIRECTIONS = even_directions(96).astype(np.float32)
"""(96, 3) directions in which the extreme points are sought, at both ends."""
