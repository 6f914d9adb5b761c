"""Sizes of surfels with which they cover as much of a picture as what they stand for.

Brandt et al. draw discs that leave no hole in a surface, and state that thin parts come out
fattened (section 6). Here a disc is as large as that only where the surface goes on in all
directions around it, which is asked as of boundaries of point sets (Bendels, Schnabel, Klein:
Detecting holes in point set surfaces, 2006, the angle criterion). All others of a doubling of the
prefix have a size in common, with which pictures have the right coverage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.gl.points import SurfelSetBuffers
from vegtool.lod import Display
from vegtool.measure.pictures import live_prefix
from vegtool.measure.views import Camera, around, views
from vegtool.surfel_set import SurfelSet

REACH = (0.6, 1.8)
"""Of the radius of a disc: how far what its surface goes on with is away."""
FLAT = 0.35
"""Of the radius: how far off its plane that is at most."""
NEIGHBOURS = 16
"""That are looked at."""
GAP = (2 * np.pi / 3, np.pi)
"""Radians around it without any: up to which it is whole, and from which on it is an edge."""


SOME = 2000
"""Points whose distances tell those of a prefix."""
FEWEST = 256
"""Points of the shortest prefix whose pictures are compared; those before have sizes as in it."""
VIEWS = 3
"""Directions in which it is looked at."""
SUPERSAMPLE = 4
"""Samples per axis and pixel of what it is compared with."""
STEP = 0.75
"""Factor from one size that is tried to the next, from 1 on."""
LEAST = 0.05
"""Size below which none is tried."""
TOTAL = 0.5
"""How much a difference of the whole coverage counts, beside all differences of pixels."""


def sizes(surfels: SurfelSet, truth: Callable[[Camera], Picture]) -> FloatArray:
    """(n,) of the radius of discs. truth: a picture of what the surfels stand for."""
    whole = inside(surfels)
    size = np.ones(len(surfels))
    for first, length in doublings(len(surfels), FEWEST):
        rows, radius = slice(first, length), surfels.spacing.radius(length)
        cameras = cameras_of(surfels, length)
        known = [truth(camera)[..., 3] for camera in cameras]

        def sized(share: float) -> None:
            size[rows] = share + (1 - share) * whole[rows]

        def measured(share: float) -> tuple[float, float]:
            sized(share)
            with SurfelSetBuffers(replace(surfels, size=size)) as buffers:
                off = [
                    live_prefix(buffers, camera, length, radius)[..., 3] - picture
                    for camera, picture in zip(cameras, known, strict=True)
                ]
            excess = sum(float(part.sum()) for part in off)
            return excess, sum(float(np.abs(part).sum()) for part in off) + TOTAL * abs(excess)

        sized(_share(measured))
    return size


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


def cameras_of(surfels: SurfelSet, length: int) -> list[Camera]:
    """From where discs of a prefix are a pixel wide, in the middle of the surfels."""
    display = Display()
    away = 2 * surfels.spacing.radius(length) * display.pixels_per_metre(1.0)
    away += float(np.linalg.norm(np.diff(surfels.bounds, axis=0)) / 2)
    return [around(surfels.position, view.direction, away, display) for view in views("all", VIEWS)]


def inside(surfels: SurfelSet) -> FloatArray:
    """(n,) 0 to 1: how far the surface goes on around each, on the scale of the discs that it is
    first drawn with."""
    total = len(surfels)
    result = np.zeros(total)
    if total < 2:
        return result
    from scipy.spatial import cKDTree

    trees, apart = {}, {}
    for _, length in doublings(total, 2):
        trees[length] = tree = cKDTree(surfels.position[:length])
        apart[length] = np.median(tree.query(surfels.position[: min(length, SOME)], 2)[0][:, 1])
    for first, length in doublings(total, 2):
        rows = np.arange(first, length)
        radius = surfels.spacing.radius(length)
        # of more points than such discs need, as on what is thin, fewer tell as much
        net = max((k for k in trees if k <= length and apart[k] >= REACH[0] * radius), default=2)
        found = trees[net].query(
            surfels.position[rows], min(NEIGHBOURS, net), distance_upper_bound=REACH[1] * radius
        )
        distance, index = (np.reshape(part, (len(rows), -1)) for part in found)
        result[rows] = _whole(surfels, rows, distance, np.where(index < net, index, 0), radius)
    return result


def doublings(total: int, least: int) -> list[tuple[int, int]]:
    """Prefixes of doubling length, the last of all: of each, where what is new begins, and its
    length."""
    lengths = [least << k for k in range(max(((total - 1) // least).bit_length(), 0))]
    ends = [*lengths, total]
    return list(zip([0, *ends], ends))


def _whole(surfels, rows, distance, index, radius):
    normal = surfels.normal[rows]
    away = surfels.position[index] - surfels.position[rows][:, None]
    height = np.einsum("nkc,nc->nk", away, normal)
    near = (distance >= REACH[0] * radius) & (distance <= REACH[1] * radius)
    near &= np.abs(height) <= FLAT * radius
    least = np.eye(3)[np.abs(normal).argmin(axis=1)]
    right = np.cross(normal, least)
    up = np.cross(normal, right)
    angle = np.arctan2(np.einsum("nkc,nc->nk", away, up), np.einsum("nkc,nc->nk", away, right))
    angle = np.sort(np.where(near, angle, np.inf), axis=1)
    many = near.sum(axis=1)
    gaps = np.diff(angle, axis=1, append=np.inf)
    last = angle[np.arange(len(rows)), np.maximum(many - 1, 0)]
    inner = np.where(np.isfinite(gaps), gaps, 0).max(axis=1)
    around = np.maximum(inner, 2 * np.pi - (last - angle[:, 0]))
    around = np.where(many > 1, around, 2 * np.pi)
    return np.clip((GAP[1] - around) / (GAP[1] - GAP[0]), 0, 1)
