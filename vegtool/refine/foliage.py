"""Leaves as opaque, coloured triangles, for levels in which one stands for what is a few pixels
large: multisampling gives them fractional coverage, which no alpha test has, and they have no mips
to lose it in.

    leaves = leaves_of(plant, faces)                     # once for a plant
    foliage = reduced_leaves(leaves, triangles, pixel_m)  # for each level

After Cook, Halstead, Planck, Ryu: Stochastic simplification of aggregate detail (2007): of many
small elements some are drawn, as much larger. Here leaves are put into as many groups as there are
triangles, of leaves that are near each other, look one way and have one colour. Of each group one
leaf, chosen by chance in proportion to what it covers, says how the triangle is turned and where it
lies; the group says how long and wide it is, its colour and how much it covers. Leaves of a group
hide each other where its triangle hides nothing of itself, so it covers what they do together, as
rays from all around find it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, checked, unit
from vegtool.plant import Plant
from vegtool.refine.cutouts import cutouts
from vegtool.refine.foliage_groups import grouped, mean_of
from vegtool.refine.hits import Hits, Rays, distinct, hits, nearest
from vegtool.seeding import generator

Ints = npt.NDArray[np.int64]

UNSEEN = 0.25
"""What a hidden leaf counts where triangles are dealt out, beside one that is seen."""
LEANING = 0.5
"""The least ratio of width to length."""
ROUNDS = 3
"""In which the area of all triangles is brought to cover what all leaves do."""


@dataclass(frozen=True, eq=False)
class Leaves:
    """The covered parts of n faces, in units of `radius` metres about `center`, (3,) metres.

    area: (n,) half of what can be seen of them from all sides, which for a face seen from both is
    its own. middle: (n, 3) centroid. spread: (n, 3, 3) second moment about it. normal: (n, 3) unit,
    of the front. shading: (n, 3) unit, what light falls on. color: (n, 3) linear. seen: (n,) share,
    0 to 1, that others do not hide. found: where rays meet them, whose `face` is an index into n.
    """

    center: FloatArray
    radius: float
    area: FloatArray
    middle: FloatArray
    spread: FloatArray
    normal: FloatArray
    shading: FloatArray
    color: FloatArray
    seen: FloatArray
    rays: Rays
    found: Hits

    def __len__(self) -> int:
        return len(self.area)


@dataclass(frozen=True, eq=False)
class Foliage:
    """A mesh of leaves, v vertices and t triangles, to be drawn from both sides.

    positions: (v, 3) metres. normals: (v, 3) unit. colors: (v, 3) linear. faces: (t, 3) int32.
    factor: how many times the area of a triangle is that which its leaves cover together, so that
    all cover what all leaves do.
    """

    positions: FloatArray
    normals: FloatArray
    colors: FloatArray
    faces: IntArray
    factor: float

    def __post_init__(self) -> None:
        positions = checked("Foliage.positions", self.positions, (None, 3), np.float64)
        n = len(positions)
        values = {
            "positions": positions,
            "normals": checked("Foliage.normals", self.normals, (n, 3), np.float64),
            "colors": checked("Foliage.colors", self.colors, (n, 3), np.float64),
            "faces": checked("Foliage.faces", self.faces, (None, 3), np.int32, n),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)


def leaves_of(plant: Plant, faces: IntArray) -> Leaves | None:
    """The leaves among a plant's faces, (k,) indices; None where they cover nothing."""
    cut = cutouts(plant, faces)
    corners = plant.corners[faces]
    low, high = corners.min(axis=(0, 1), initial=np.inf), corners.max(axis=(0, 1), initial=-np.inf)
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
    covered = plant.face_areas[faces] * cut.share
    own = np.flatnonzero(covered > 0)
    if not len(own):
        return None
    corners = (corners[own] - center) / radius
    two_sided = np.array([m.double_sided for m in plant.materials], dtype=bool)
    both = np.asarray(two_sided[plant.face_material[faces[own]]])
    rays = Rays.around(corners)
    found = hits(rays, corners)
    shows = np.asarray(found.front | both[found.face])
    found = found.of(cut.covered(own[found.face], found.at) & shows)
    at, moment = cut.at[own], cut.moment[own]
    bent = np.einsum("fc,fci->fi", at, plant.normals[plant.faces[faces[own]]])
    normal = unit(plant.face_area_vectors[faces[own]] / radius**2)
    return Leaves(
        center,
        radius,
        covered[own] / radius**2 * np.where(both, 1.0, 0.5),
        np.einsum("fc,fci->fi", at, corners),
        np.einsum("fcd,fci,fdj->fij", moment, corners, corners, optimize=True),
        normal,
        np.where(bent.any(axis=1)[:, None], unit(bent), normal),
        cut.color[own],
        _seen(found, len(own)),
        rays,
        found,
    )


def reduced_leaves(
    leaves: Leaves, triangles: int, pixel_m: float, factor: float = 1.0, seed: int = 0
) -> Foliage | None:
    """The leaves as at most that many triangles; None for none.

    pixel_m: metres that a pixel covers, where the level is seen from nearest. factor: how many
    times the area that is expected to cover as much as the leaves do. Raises ValueError where
    either is not positive.
    """
    for name, value in (("pixel_m", pixel_m), ("factor", factor)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name}: expected a positive number, found {value}")
    if triangles < 1:
        return None
    weight = leaves.area * (UNSEEN + (1 - UNSEEN) * leaves.seen)
    group = grouped(leaves.middle, leaves.normal, leaves.color, weight, min(triangles, len(leaves)))
    count = int(group.max()) + 1
    model = drawn_of(leaves, group, weight, seed)
    side = sides(leaves.normal, leaves.normal[model], group)
    total = np.bincount(group, leaves.area, count).astype(np.float64)
    area = total * kept(leaves, group, total)
    axes, ratio = frames(leaves, group, model)
    color = mean_of(leaves.color, weight, group, count)
    shading = mean_of(leaves.shading * side[:, None], weight, group, count)
    shading = np.where(shading.any(axis=1)[:, None], unit(shading), leaves.normal[model])

    def corners(scale: float) -> FloatArray:
        return triangles_about(leaves.middle[model], axes, ratio, area * scale)

    scale = unbiased(leaves, corners)
    positions = corners(scale * factor) * leaves.radius + leaves.center
    return Foliage(
        positions.reshape(-1, 3),
        np.repeat(shading, 3, axis=0),
        np.repeat(color, 3, axis=0),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        scale,
    )


def _seen(found: Hits, count: int) -> FloatArray:
    """(n,) share of faces that is seen, in the mean over all of them where rays meet none."""
    met = np.bincount(found.face, minlength=count)
    free = np.bincount(found.face[nearest(found)], minlength=count)
    mean = free.sum() / max(met.sum(), 1)
    return np.asarray((free + mean) / (met + 1))


def drawn_of(leaves: Leaves, group: Ints, weight: FloatArray, seed: int) -> Ints:
    """(k,) of each group one leaf, by chance in proportion to its weight."""
    order = np.argsort(group, kind="stable")
    first = np.flatnonzero(np.diff(group[order], prepend=-1))
    end = np.append(first[1:], len(order))
    reached = np.cumsum(weight[order])
    before = np.append(0.0, reached)[first]
    chance = generator(seed, "foliage").random(len(first))
    at = np.searchsorted(reached, before + chance * (reached[end - 1] - before), side="right")
    return np.asarray(order[np.clip(at, first, end - 1)])


def sides(normal: FloatArray, front: FloatArray, group: Ints) -> FloatArray:
    """(n,) 1 where a leaf's front is on the side of its group's, (k, 3), and -1 where its back."""
    return np.where((normal * front[group]).sum(axis=1) < 0, -1.0, 1.0)


def kept(leaves: Leaves, group: Ints, total: FloatArray) -> FloatArray:
    """(k,) share of the leaves' area that a group covers, where they hide each other; of groups
    that few rays meet it is near the mean of all."""
    found, count = leaves.found, len(total)
    met = np.bincount(group[found.face], minlength=count)
    once = distinct(found.ray, group[found.face], count)
    mean = once.sum() / max(met.sum(), 1)
    return np.asarray((once + FEW * mean) / (met + FEW))


FEW = 16
"""Rays as which the mean of all counts."""


def frames(leaves: Leaves, group: Ints, model: Ints) -> tuple[FloatArray, FloatArray]:
    """(k, 2, 3) axes in the planes of the leaves that are drawn, along the most and the least of
    what the group is, and (k,) the ratio of both."""
    normal = leaves.normal[model]
    count = len(model)
    spread = leaves.spread[model]
    u = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]))
    v = np.cross(normal, u)
    uv = np.stack([u, v], axis=1)
    flat = np.einsum("kai,kij,kbj->kab", uv, spread, uv)
    values, vectors = np.linalg.eigh(flat)
    axes = np.einsum("kab,kai->kbi", vectors[:, :, ::-1], uv)
    axes[:, 1] = np.cross(normal, axes[:, 0])
    values = np.maximum(values, 0.0)
    ratio = np.sqrt(values[:, 0] / np.maximum(values[:, 1], np.finfo(float).tiny))
    assert len(axes) == count
    return axes, np.maximum(ratio, LEANING)


def triangles_about(
    middle: FloatArray, axes: FloatArray, ratio: FloatArray, area: FloatArray
) -> FloatArray:
    """(k, 3, 3) corners of triangles with those centroids, of that area, as much wider across as
    `ratio` says beside an equilateral one."""
    turn = np.arange(3) * 2 * np.pi / 3
    reach = np.sqrt(4 * area / (3 * np.sqrt(3)))
    along = reach / np.sqrt(ratio)
    across = reach * np.sqrt(ratio)
    offset = (
        np.cos(turn)[:, None] * (along[:, None] * axes[:, 0])[:, None]
        + np.sin(turn)[:, None] * (across[:, None] * axes[:, 1])[:, None]
    )
    return np.asarray(middle[:, None] + offset)


def unbiased(leaves: Leaves, corners: Callable[[float], FloatArray]) -> float:
    """The scale of areas with which triangles cover as much as the leaves, seen from all sides."""
    truth = len(np.unique(leaves.found.ray))
    scale = 1.0
    for _ in range(ROUNDS):
        covers = len(np.unique(hits(leaves.rays, corners(scale)).ray))
        if not covers:
            return 1.0
        scale *= truth / covers
    return scale
