"""Leaves as opaque, coloured triangles, for levels in which one stands for what is a few pixels
large: multisampling gives them fractional coverage, which no alpha test has, and they have no mips
to lose it in.

    leaves = leaves_of(plant, faces)                     # once for a plant
    foliage = reduced_leaves(leaves, triangles, pixel_m)  # for each level

After Cook, Halstead, Planck, Ryu: Stochastic simplification of aggregate detail (2007), where some
of many small elements are drawn in place of all, as much larger; here nothing is left to chance.
Leaves are put into as many groups as there are triangles (foliage_groups.py), mostly of what can be
seen from outside. A triangle lies in the middle of its group, along the plane that its leaves look
out of, as long and wide as they spread there, and as large as what they cover together: leaves of a
group hide each other where a triangle hides nothing of itself, and so do triangles less than the
leaves. Both are found by rays from all around.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.plant import Plant
from vegtool.refine.cutouts import cutouts
from vegtool.refine.foliage_groups import grouped, mean_of
from vegtool.refine.hits import CELLS, Hits, Rays, distinct, hits, nearest, rays_met
from vegtool.refine.mesh import ColoredMesh

Ints = npt.NDArray[np.int64]

UNSEEN = 0.03
"""What a hidden leaf counts where triangles are dealt out, beside one that is seen."""
SLIMMEST = 0.12
"""The least ratio of a triangle's width to its length, beside those of an equilateral one."""
FEW = 16
"""Rays for which the mean of all groups counts where one is asked how much it covers, and no
change where all are: as good as none where many meet, and the answer where none does."""
LEAST = 1e-15
"""Squared radii: faces that cover no more are none."""
ROUNDS = 3
"""In which the area of all triangles is brought to cover what all leaves do."""


@dataclass(frozen=True, eq=False)
class Leaves:
    """The covered parts of n faces, in units of `radius` metres about `center`, (3,) metres.

    face: (n,) which of the plant's they are. area: (n,) half of what can be seen of them from all
    sides, which for a face seen from both is its own. middle: (n, 3) centroid. spread: (n, 3, 3)
    second moment about it. normal: (n, 3) unit, of the front. shading: (n, 3) unit, what light
    falls on. color: (n, 3) linear. seen: (n,) share, 0 to 1, that others do not hide. found: where
    rays meet them, whose `face` is an index into n.
    """

    center: FloatArray
    radius: float
    face: IntArray
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

    @property
    def weight(self) -> FloatArray:
        """(n,) how much each counts where triangles are dealt out."""
        return self.area * (UNSEEN + (1 - UNSEEN) * self.seen)


@dataclass(frozen=True, eq=False)
class Foliage(ColoredMesh):
    """A mesh of leaves. scale: how many times as large a triangle is as what its leaves cover
    together, for all to cover what all leaves do."""

    scale: float


def leaves_of(
    plant: Plant, faces: IntArray, views: FloatArray | None = None, cells: int = CELLS
) -> Leaves | None:
    """The leaves among a plant's faces, (k,) indices; None where they cover nothing. views: (d, 3)
    unit vectors towards those who look; None for all around. cells: rays along the longest extent
    that each sends."""
    if not len(faces):
        return None
    cut = cutouts(plant, faces)
    corners = plant.corners[faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    center, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
    covered = plant.face_areas[faces] * cut.share
    own = np.flatnonzero(covered > LEAST * radius**2)
    if not len(own):
        return None
    corners = (corners[own] - center) / radius
    two_sided = np.array([m.double_sided for m in plant.materials], dtype=bool)
    both = np.asarray(two_sided[plant.face_material[faces[own]]])
    rays = Rays.around(corners, cells=cells, views=views)
    found = hits(rays, corners)
    shows = np.asarray(found.front | both[found.face])
    found = found.of(cut.covered(own[found.face], found.at) & shows)
    at, moment = cut.at[own], cut.moment[own]
    bent = np.einsum("fc,fci->fi", at, plant.normals[plant.faces[faces[own]]])
    normal = unit(plant.face_area_vectors[faces[own]] / radius**2)
    return Leaves(
        center,
        radius,
        faces[own],
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
    leaves: Leaves, triangles: int, pixel_m: float, factor: float = 1.0
) -> Foliage | None:
    """The leaves as at most that many triangles; None for none.

    pixel_m: metres that a pixel covers, where the level is seen from nearest. factor: how many
    times the area that is expected to cover as much as the leaves do, seen from all sides. The
    triangles suit the leaves, not where they stand. Nothing is random. Raises
    ValueError where a length or factor is not positive.
    """
    for name, value in (("pixel_m", pixel_m), ("factor", factor)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name}: expected a positive number, found {value}")
    if triangles < 1:
        return None
    count = min(triangles, len(leaves))
    pixel = pixel_m / leaves.radius
    look = leaves.normal, leaves.shading, leaves.color
    group = grouped(leaves.middle, *look, leaves.weight, count, pixel)
    return foliage_of(leaves, group, factor)


def foliage_of(leaves: Leaves, group: Ints, factor: float = 1.0, rounds: int = ROUNDS) -> Foliage:
    """A triangle for each group of leaves, (n,) labels of which each is used; factor as above.

    rounds: in which the area of all triangles is brought to cover what all leaves do; with none,
    each covers what its leaves do.
    """
    weight = leaves.weight
    count = int(group.max()) + 1
    normal = facing(leaves, group, count)
    side = np.where((leaves.normal * normal[group]).sum(axis=1) < 0, -1.0, 1.0)
    total = np.bincount(group, leaves.area, count).astype(np.float64)
    area = total * kept(leaves, group, total)
    middle = mean_of(leaves.middle, leaves.area, group, count)
    axes, ratio = frames(leaves, group, middle, normal)
    color = mean_of(leaves.color, weight, group, count)
    shading = unit(mean_of(leaves.shading * side[:, None], weight, group, count))
    shading = np.where(np.any(shading, axis=1, keepdims=True), shading, normal)

    def corners(scale: float) -> FloatArray:
        return triangles_about(middle, axes, ratio, area * scale)

    scale = unbiased(leaves, corners, rounds)
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


def facing(leaves: Leaves, group: Ints, count: int) -> FloatArray:
    """(k, 3) unit normals along which most of each group is seen, on the side where most fronts
    look."""
    square = leaves.normal[:, :, None] * leaves.normal[:, None]
    mean = mean_of(square.reshape(-1, 9), leaves.area, group, count).reshape(-1, 3, 3)
    normal = np.linalg.eigh(mean)[1][:, :, 2]
    front = mean_of(leaves.normal, leaves.area, group, count)
    return np.where(((front * normal).sum(axis=1) < 0)[:, None], -normal, normal)


def kept(leaves: Leaves, group: Ints, total: FloatArray) -> FloatArray:
    """(k,) share of the leaves' area that a group covers, where they hide each other; of groups
    that few rays meet it is near the mean of all."""
    found, count = leaves.found, len(total)
    met = np.bincount(group[found.face], minlength=count)
    once = distinct(found.ray, group[found.face], count)
    mean = once.sum() / met.sum() if met.any() else 1.0
    return np.asarray((once + FEW * mean) / (met + FEW))


def frames(
    leaves: Leaves, group: Ints, middle: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(k, 2, 3) axes across the normals (k, 3), along the most and the least of what each group
    spreads about its middle (k, 3), and (k,) the ratio of both.

    The first points to where the group reaches farther, as a triangle does with its tip.
    """
    count = len(middle)
    off = leaves.middle - middle[group]
    moment = (leaves.spread + off[:, :, None] * off[:, None]).reshape(-1, 9)
    spread = mean_of(moment, leaves.area, group, count).reshape(-1, 3, 3)
    u = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]))
    uv = np.stack([u, np.cross(normal, u)], axis=1)
    values, vectors = np.linalg.eigh(np.einsum("kai,kij,kbj->kab", uv, spread, uv))
    values = np.maximum(values, np.finfo(float).tiny)
    along = np.einsum("ka,kai->ki", vectors[:, :, 1], uv)
    far = np.bincount(group, leaves.area * (off * along[group]).sum(axis=1) ** 3, count)
    along = np.where((far < 0)[:, None], -along, along)
    axes = np.stack([along, np.cross(normal, along)], axis=1)
    return axes, np.maximum(np.sqrt(values[:, 0] / values[:, 1]), SLIMMEST)


def triangles_about(
    middle: FloatArray, axes: FloatArray, ratio: FloatArray, area: FloatArray
) -> FloatArray:
    """(k, 3, 3) corners, counter-clockwise from where the first axis crosses to the second, of
    isosceles triangles with those centroids and areas, their tips along the first; in an
    equilateral one the ratio is 1."""
    turn = np.arange(3) * 2 * np.pi / 3
    reach = np.sqrt(4 * area / (3 * np.sqrt(3)))
    sizes = reach[:, None] * np.stack([1 / np.sqrt(ratio), np.sqrt(ratio)], axis=1)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return np.asarray(middle[:, None] + np.einsum("ca,ka,kai->kci", around, sizes, axes))


def unbiased(leaves: Leaves, corners: Callable[[float], FloatArray], rounds: int = ROUNDS) -> float:
    """The scale of areas at which triangles cover as much as the leaves, seen from all sides.

    corners: of the triangles, (k, 3, 3), at a scale.
    """
    wanted = np.count_nonzero(rays_met(leaves.rays, leaves.found))
    scale = 1.0
    for _ in range(rounds):
        found = np.count_nonzero(rays_met(leaves.rays, hits(leaves.rays, corners(scale))))
        scale *= (wanted + FEW) / (found + FEW)
    return scale
