"""Planes of a square's billboards: those of a plant (refine/planes.py), for very many leaves.

What is fitted are groups of leaves rather than leaves. They start as clusters by place and look,
found by halving, and move to the plane that suits them best, in turn with the planes (Bradley,
Mangasarian: k-plane clustering, 2000). A billboard's front looks up: from there squares are seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes.billboards import UP
from vegtool.boxes.planes import frames_about
from vegtool.lod import Billboards
from vegtool.measure.views import direction
from vegtool.plant import Plant
from vegtool.refine.foliage import Leaves
from vegtool.refine.foliage_groups import Ints, split
from vegtool.refine.foliage_groups import settled as nearest
from vegtool.refine.planes import LEAST_SEEN, PlaneOptions, settled
from vegtool.refine.planes_pieces import AXES, TWICE, Pieces, Weights, fit, tensor, together
from vegtool.refine.planes_seen import rms_cosine, transmittances

TURNS = 6
"""Rectangles that are tried around a cluster, turned by up to a right angle."""
LEAST_SIDE = 1e-6
"""Radii: half side of a billboard, at least; never without texels."""

EYES = np.stack(
    [
        direction(45.0 * nth, elevation)
        for nth, elevation in enumerate((5.0, 30.0, 15.0, 50.0, 8.0, 30.0, 15.0, 50.0))
    ]
)
"""Unit vectors towards those who look at a square, for what they see of it."""


def far_planes(
    plant: Plant, leaves: Leaves, group: Ints, count: int, pixel: float
) -> tuple[IntArray, Billboards]:
    """Labels (f,) int32 of a plant's faces, -1 of those that cover nothing, and at most `count`
    billboards, which show the others.

    group: (n,) of the leaves, those that lie on one plane; each label is used. pixel: what one
    covers where the square is seen from nearest, in the leaves' radii.
    """
    options = PlaneOptions()
    single = pieces_of_leaves(leaves)
    pieces = together(single, group)
    surface = float(leaves.area.sum())
    weights = Weights(
        options.compactness, options.orientation * (mean_size(single, surface) ** 2 + pixel**2)
    )
    share = seen_from_above(pieces, surface)
    weight = pieces.weight * np.maximum(share, LEAST_SEEN) ** options.outside
    pieces = replace(pieces, weight=weight)
    found = settled(pieces, started(pieces, count, surface), weights, options)
    planes = fit(together(pieces, found), weights)
    own = found[group]
    labels = np.full(len(plant.faces), -1, dtype=np.int32)
    labels[leaves.face] = own
    corners = (plant.corners[leaves.face] - leaves.center) / leaves.radius
    around = rectangles(corners, own, planes.center, planes.normal)
    return labels, replace(
        around,
        center=around.center * leaves.radius + leaves.center,
        half_size=around.half_size * leaves.radius,
        half_depth=around.half_depth * leaves.radius,
    )


def rectangles(
    corners: FloatArray, own: Ints, middle: FloatArray, normal: FloatArray
) -> Billboards:
    """Rectangles around faces (m, 3, 3) of clusters (m,), each of which has some, on planes through
    the middles (k, 3) across the normals (k, 3): of those turned by TURNS, that of least area."""
    normal = np.where(normal[:, 1:2] < 0, -normal, normal)
    frames = frames_about(normal)
    order = np.argsort(own, kind="stable")
    sorted_to = own[order]
    start = 3 * np.searchsorted(sorted_to, np.arange(len(normal)))
    local = corners[order] - middle[sorted_to, None]
    x, y, z = np.einsum("mai,mci->amc", frames[sorted_to], local).reshape(3, -1)
    turn = np.pi / 2 * np.arange(TURNS) / TURNS
    low, high = np.empty((2, TURNS, len(normal), 2))
    for i, (cos, sin) in enumerate(zip(np.cos(turn), np.sin(turn), strict=True)):
        for axis, along in enumerate((cos * x + sin * y, cos * y - sin * x)):
            low[i, :, axis] = np.minimum.reduceat(along, start)
            high[i, :, axis] = np.maximum.reduceat(along, start)
    best = (high - low).prod(axis=2).argmin(axis=0)
    each = np.arange(len(normal))
    low, high = low[best, each], high[best, each]
    cos, sin = np.cos(turn[best])[:, None], np.sin(turn[best])[:, None]
    first, second = frames[:, 0], frames[:, 1]
    sides = np.stack([cos * first + sin * second, cos * second - sin * first], axis=1)
    center = middle + np.einsum("ka,kai->ki", (low + high) / 2, sides)
    upward = sides @ UP
    upper = np.abs(upward).argmax(axis=1)
    v = sides[each, upper] * np.where(upward[each, upper] < 0, -1.0, 1.0)[:, None]
    half = (high - low) / 2
    return Billboards(
        center,
        np.cross(v, normal),
        v,
        np.maximum(np.stack([half[each, 1 - upper], half[each, upper]], axis=1), LEAST_SIDE),
        np.maximum.reduceat(np.abs(z), start),
        each.astype(np.int32),
    )


def pieces_of_leaves(leaves: Leaves) -> Pieces:
    """Each leaf as a piece, by its covered part; lengths in the leaves' radii."""
    spread = np.stack([leaves.spread[:, i, j] for i, j in AXES], axis=1) * TWICE
    return Pieces(
        leaves.area / leaves.area.sum(),
        leaves.middle,
        spread + tensor(leaves.middle),
        tensor(leaves.normal),
    )


def seen_from_above(pieces: Pieces, surface: float) -> FloatArray:
    """(n,) 0 to 1: the share of pieces that shows from EYES, as of planes_seen.seen."""
    total, shown = np.zeros((2, len(pieces)))
    size = mean_size(pieces, surface)
    for eye, toward, _ in transmittances(pieces, surface, size, 1.0, EYES):
        turned = rms_cosine(pieces, eye)
        total += turned * toward
        shown += turned
    return np.divide(total, shown, out=np.ones_like(total), where=shown > 0)


def mean_size(pieces: Pieces, surface: float) -> float:
    """Of pieces whose weights are shares of a surface, by area."""
    return float(np.sqrt(pieces.weight @ pieces.weight * surface))


def started(pieces: Pieces, count: int, surface: float) -> Ints:
    """(n,) clusters, at most `count`, that planes are first fitted to."""
    if len(pieces) <= count:
        return np.arange(len(pieces))
    size = np.sqrt(pieces.weight.sum() * surface / count)
    features: FloatArray = np.concatenate([pieces.middle, size * pieces.looks], axis=1)
    clusters = split(features, pieces.weight, count)
    return nearest(features, pieces.weight, clusters, count)
