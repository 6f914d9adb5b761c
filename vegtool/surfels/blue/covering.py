"""Sizes of discs with which surfels cover as much of a picture as what they stand for.

Brandt et al., section 6, state that thin parts come out fattened, as discs that leave no hole in a
surface stand over its edges. Here a disc is that large only where the surface goes on in all
directions around it: the angle criterion of Bendels, Schnabel, Klein: Detecting holes in point set
surfaces (2006). All others by which a prefix doubles are smaller by one factor, with which pictures
have the right coverage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray, Picture
from vegtool.gl.points import SurfelSetBuffers
from vegtool.lod import Display
from vegtool.measure.pictures import live_prefix
from vegtool.measure.views import Camera, around, views
from vegtool.surfel_set import SurfelSet

FEWEST = 256
"""Points of the shortest prefix of which pictures are compared; all of it have one factor."""
VIEWS = 3
"""Directions in which a prefix is looked at."""
STEP = 0.75
"""Factor from a size that is tried to the next."""
LEAST = 0.05
"""Size below which none is tried."""
TOTAL = 0.5
"""How much a difference of the whole coverage counts, beside all differences of pixels."""

REACH = (0.6, 1.8)
"""Of the radius of a disc: how far away what its surface goes on with is."""
FLAT = 0.5
"""Of the radius: how far off its plane that is at most."""
NEIGHBOURS = 16
"""Points that are looked at, the nearest."""
SOME = 2000
"""Points whose distances are taken for those of all of a prefix."""
GAP = (np.radians(120), np.radians(180))
"""Radians around a disc in which nothing is: up to which it is inside, and from which on at an
edge."""


def sizes(surfels: SurfelSet, truth: Callable[[Camera], Picture]) -> FloatArray:
    """(n,) of the radius of discs. truth: a picture of what the surfels stand for."""
    whole = inside(surfels)
    size = np.ones(len(surfels))
    if surfels.spacing.radius_m == 0:
        return size  # a single place
    for first, length in doublings(len(surfels), FEWEST):
        rows = slice(first, length)
        size[rows] = _sizes(surfels, size, whole[rows], rows, truth)
    return size


def _sizes(
    surfels: SurfelSet, size: FloatArray, whole: FloatArray, rows: slice,
    truth: Callable[[Camera], Picture],
) -> FloatArray:  # fmt: skip
    """(m,) of rows that end a prefix. size: (n,) of those before. whole: (m,) how far inside."""
    radius = surfels.spacing.radius(rows.stop)
    cameras = _cameras(surfels, radius)
    known = [truth(camera)[..., 3] for camera in cameras]
    tried = size.copy()

    def measured(share: float) -> tuple[float, float]:
        tried[rows] = share + (1 - share) * whole
        with SurfelSetBuffers(replace(surfels, size=tried)) as buffers:
            off = [
                live_prefix(buffers, camera, rows.stop, radius)[..., 3] - picture
                for camera, picture in zip(cameras, known, strict=True)
            ]
        excess = sum(float(part.sum()) for part in off)
        return excess, sum(float(np.abs(part).sum()) for part in off) + TOTAL * abs(excess)

    share = _share(measured)
    return np.asarray(share + (1 - share) * whole)


def _share(measured: Callable[[float], tuple[float, float]]) -> float:
    """From 1 down, as long as too much is covered and differences become less. measured: of a size,
    coverage in excess, and differences."""
    share = 1.0
    excess, error = measured(share)
    while excess > 0 and STEP * share >= LEAST:
        other, then = measured(STEP * share)
        if other < 0:
            return share * (1 - (1 - STEP) * excess / (excess - other))
        if then >= error:
            break
        share, excess, error = STEP * share, other, then
    return share


def _cameras(surfels: SurfelSet, radius_m: float) -> list[Camera]:
    """To which discs of a radius are about a pixel wide."""
    display = Display()
    away = 2 * radius_m * display.pixels_per_metre(1.0)
    away += float(np.linalg.norm(np.diff(surfels.bounds, axis=0)) / 2)
    return [around(surfels.position, view.direction, away, display) for view in views("all", VIEWS)]


def inside(surfels: SurfelSet) -> FloatArray:
    """(n,) 0 to 1: how far the surface goes on around each, seen at the scale of the discs of the
    prefix by which it has come."""
    total = len(surfels)
    result = np.zeros(total)
    if total < 2:
        return result
    from scipy.spatial import cKDTree

    lengths = doublings(total, 2)
    trees = {length: cKDTree(surfels.position[:length]) for _, length in lengths}
    apart = {length: _apart(surfels.position[:length]) for length in trees}
    for first, length in lengths:
        radius = max(surfels.spacing.radius(length), apart[length])
        # where there are more points than such discs need, as on what is thin, fewer tell as much
        enough = [n for n in trees if n <= length and apart[n] >= REACH[0] * radius]
        net = max(enough, default=2)
        rows = np.arange(first, length, dtype=np.int32)
        index = trees[net].query(surfels.position[rows], min(NEIGHBOURS, net))[1]
        result[rows] = _inside(surfels, rows, index, radius)
    return result


def _apart(positions: FloatArray) -> float:
    """Median of the distances from each of some to the nearest other one, two at least."""
    from scipy.spatial import cKDTree

    return float(np.median(cKDTree(positions).query(positions[:SOME], 2)[0][:, 1]))


def _inside(surfels: SurfelSet, rows: IntArray, index: IntArray, radius: float) -> FloatArray:
    """(m,) of rows (m,), by neighbours (m, k)."""
    normal = surfels.normal[rows]
    away = surfels.position[index] - surfels.position[rows][:, None]
    distance = np.linalg.norm(away, axis=2)
    height = np.abs(np.einsum("mkc,mc->mk", away, normal))
    goes_on = (distance >= REACH[0] * radius) & (distance <= REACH[1] * radius)
    goes_on &= height <= FLAT * radius
    right = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    up = np.cross(normal, right)
    angle = np.arctan2(*(np.einsum("mkc,mc->mk", away, axis) for axis in (up, right)))
    any_one = angle[np.arange(len(rows)), goes_on.argmax(axis=1)]
    angle = np.sort(np.where(goes_on, angle, any_one[:, None]), axis=1)
    gap = np.diff(angle, axis=1, append=angle[:, :1] + 2 * np.pi).max(axis=1)
    return np.asarray(np.clip((GAP[1] - gap) / (GAP[1] - GAP[0]), 0, 1))


def doublings(total: int, least: int) -> list[tuple[int, int]]:
    """What prefixes of doubling length add, from the shortest on, `least` or all, to all: where it
    begins and ends."""
    lengths = [least << k for k in range(((total - 1) // least).bit_length())]
    ends = [*lengths, total]
    return list(zip([0, *lengths], ends, strict=True))
