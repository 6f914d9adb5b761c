"""Billboards chosen by what their picture gets wrong, not by how compact their clusters are.

Bradley, Mangasarian: k-plane clustering (2000): planes are fitted to the points of their clusters,
points go to the plane that suits them best, in turn. Here points are pieces of surface (the halves
of a leaf card are one), and what a piece costs on a plane is, per area,

    depth^2  +  compactness distance^2  +  orientation (1 - (n . m)^2)

depth: of its points off the plane, which is how far they are drawn from where they are; distance:
from the cluster's centre, which keeps pictures small and full; n, m: normals of piece and plane, an
oblique piece covering less on the plane than it should (cf. Cohen-Steiner, Alliez, Desbrun:
Variational shape approximation, 2004). All three are sums of moments of the pieces: the best plane
of a cluster passes through its mean, its normal being the least eigenvector of a 3 x 3 matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.boxes.billboards import cut_planes, shown_shares
from vegtool.boxes.groups import Groups
from vegtool.boxes.options import BoxOptions
from vegtool.boxes.planes import boxes_about
from vegtool.clustering import ClusterOptions, cluster
from vegtool.clustering.features import (
    SAME,
    Labels,
    face_features,
    face_weights,
    own_corners,
    quads,
)
from vegtool.errors import UsageError
from vegtool.lod import Billboards
from vegtool.plant import Plant
from vegtool.progress import Progress, silent

NEAR = 64
"""Clusters, the nearest to its own, that a piece may go to."""
START = ClusterOptions(orientation_weight=0.12)
"""Of the clustering that comes first."""
LEAST_GAIN = 1e-9
"""Of the mean cost: a piece stays where it is unless it gains more."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Of axes, in the order of the six numbers of a symmetric tensor; see clustering/features."""
DOUBLED = np.array([1, 1, 1, 2**0.5, 2**0.5, 2**0.5])
"""Tensors with these factors have their scalar product as if they had all nine numbers."""


@dataclass(frozen=True)
class PlaneOptions:
    """What a plane is chosen by.

    compactness: what a piece's squared distance from its cluster's centre costs, if its squared
    depth costs 1.
    orientation: what a piece costs that the plane shows from the edge, in squared radii of what is
    shown.
    rounds: of fitting and moving, at most.
    settled: of the error; rounds that gain less are the last.
    """

    compactness: float = 0.03
    orientation: float = 0.007
    rounds: int = 24
    settled: float = 1e-3


@dataclass(frozen=True, eq=False)
class Pieces:
    """Surface in pieces, n of them, by its moments, in a plant's own frame and radii.

    area: (n,) share of the whole. middle: (n, 3) centroid. spread: (n, 6) second moment about it.
    looks: (n, 6) mean of the tensors n n^T of its normals.
    """

    area: FloatArray
    middle: FloatArray
    spread: FloatArray
    looks: FloatArray


@dataclass(frozen=True, eq=False)
class Fitted:
    """Planes of clusters, k of them. center, normal: (k, 3). area: (k,), 0 for an empty one."""

    center: FloatArray
    normal: FloatArray
    area: FloatArray


def planes(
    plant: Plant,
    faces: IntArray,
    count: int,
    pixel_m: float,
    options: PlaneOptions | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> tuple[IntArray, Billboards]:
    """Labels (f,) int32 of all faces of a plant, and at most `count` billboards that show `faces`.

    faces: (n,) int32, those to be shown; the others get one more cluster, which no billboard shows.
    pixel_m: metres that a pixel covers where the level is seen from nearest. The planes suit the
    shape, not where it stands: a plant moved, turned or scaled is cut alike. Nothing is random, and
    the seed changes nothing. Raises UsageError for a count below one.
    """
    options = options or PlaneOptions()
    if count < 1:
        raise UsageError(f"billboards: expected at least 1, got {count}. Ask for one or more.")
    labels = np.zeros(len(plant.faces), dtype=np.int32)
    if not len(faces):
        return labels, none_of(plant)
    shown = replace(
        plant,
        faces=plant.faces[faces],
        face_material=plant.face_material[faces],
        branches=None,
    )
    of_face = quads(shown)
    first = cluster(shown, "kmeans", count, START, seed, progress).astype(np.int64)
    of_face = np.unique(np.stack([of_face, first]), axis=1, return_inverse=True)[1]
    pieces, axes = pieces_of(shown, of_face)
    start = np.empty(len(pieces.area), dtype=np.int64)
    start[of_face] = first
    found = settled(pieces, start, options, progress)
    used, found = np.unique(found, return_inverse=True)
    fitted = fit(pieces, found, len(used), options)
    own = found[of_face].astype(np.int32)
    labels[:] = len(used)
    labels[faces] = own
    return labels, billboards_about(shown, own, fitted.normal @ axes)


def pieces_of(plant: Plant, of_face: Labels) -> tuple[Pieces, FloatArray]:
    """The faces (f,) of each piece as one; and the axes (3, 3) of the frame they are in.

    Numbers are multiples of SAME, so that rounding does not decide where a plant is turned.
    """
    features = face_features(plant, 1.0)
    area = face_weights(plant)
    corners, axes = own_corners(plant)
    corners = corners - corners.mean(axis=1, keepdims=True)
    spread = np.stack([(corners[..., i] * corners[..., j]).sum(axis=1) for i, j in PAIRS], axis=1)
    spread = np.round(spread / 12 * DOUBLED / SAME) * SAME
    total = np.bincount(of_face, area)
    middle = mean_of(features[:, :3], area, of_face)
    offset = features[:, :3] - middle[of_face]
    return Pieces(
        total,
        middle,
        mean_of(spread + tensor(offset), area, of_face),
        mean_of(features[:, 3:], area, of_face),
    ), axes


def tensor(vectors: FloatArray) -> FloatArray:
    """(n, 6) the tensors v v^T of vectors (n, 3)."""
    return np.stack([vectors[:, i] * vectors[:, j] for i, j in PAIRS], axis=1) * DOUBLED


def mean_of(values: FloatArray, weights: FloatArray, group: Labels, count: int = 0) -> FloatArray:
    """(g, d) weighted means of values (n, d); 0 for groups without any."""
    total = np.bincount(group, weights, count)
    sums = np.stack([np.bincount(group, weights * column, count) for column in values.T], axis=1)
    return sums / np.where(total > 0, total, 1.0)[:, None]


def fit(pieces: Pieces, labels: Labels, count: int, options: PlaneOptions) -> Fitted:
    """The planes that cost least."""
    area = np.bincount(labels, pieces.area, count)
    center = mean_of(pieces.middle, pieces.area, labels, count)
    offset = pieces.middle - center[labels]
    deep = (1 - options.compactness) * (tensor(offset) + pieces.spread)
    six = mean_of(deep - options.orientation * pieces.looks, pieces.area, labels, count) / DOUBLED
    matrix = np.empty((count, 3, 3))
    for column, (i, j) in enumerate(PAIRS):
        matrix[:, i, j] = matrix[:, j, i] = six[:, column]
    return Fitted(center, np.linalg.eigh(matrix)[1][:, :, 0], area)


def costs(pieces: Pieces, fitted: Fitted, options: PlaneOptions) -> tuple[FloatArray, FloatArray]:
    """What pieces cost on planes per area, as a product of (n, 11) with (11, k)."""
    be, al, ga = options.compactness, 1 - options.compactness, options.orientation
    x, c, m = pieces.middle, fitted.center, fitted.normal
    own = be * ((x * x).sum(axis=1) + pieces.spread[:, :3].sum(axis=1))
    left = np.column_stack(
        [al * (tensor(x) + pieces.spread) - ga * pieces.looks, x, own, np.ones(len(x))]
    )
    depth = (c * m).sum(axis=1)
    fixed = be * (c * c).sum(axis=1) + al * depth**2 + ga
    right = np.column_stack(
        [tensor(m), -2 * be * c - 2 * al * depth[:, None] * m, np.ones(len(c)), fixed]
    )
    return left, np.ascontiguousarray(right.T)


def error(pieces: Pieces, labels: Labels, fitted: Fitted, options: PlaneOptions) -> float:
    """What all pieces cost on the planes of their clusters."""
    left, right = costs(pieces, fitted, options)
    return float(pieces.area @ (left * right.T[labels]).sum(axis=1))


def moved(pieces: Pieces, labels: Labels, fitted: Fitted, options: PlaneOptions) -> Labels:
    """Every piece on the plane that suits it best, of those near its own."""
    from scipy.spatial import cKDTree

    left, right = costs(pieces, fitted, options)
    here = np.flatnonzero(fitted.area > 0)
    near = here[
        cKDTree(fitted.center[here]).query(
            fitted.center[here], k=np.arange(1, 1 + min(NEAR, len(here)))
        )[1]
    ]
    groups = Groups(labels.astype(np.int32))
    result = labels.copy()
    for part, there in zip(groups.slices(), near, strict=True):
        rows = groups.order[part]
        cost = left[rows] @ right[:, there]
        best = cost.argmin(axis=1)
        stay = cost[:, (there == labels[rows[0]]).argmax()]
        gain = stay - cost[np.arange(len(rows)), best]
        result[rows] = np.where(gain > LEAST_GAIN * stay, there[best], labels[rows])
    return result


def settled(
    pieces: Pieces, labels: Labels, options: PlaneOptions, progress: Progress = silent
) -> Labels:
    """Planes fitted and pieces moved in turn, until little is gained."""
    count = int(labels.max()) + 1
    fitted = fit(pieces, labels, count, options)
    before = error(pieces, labels, fitted, options)
    for done in range(options.rounds):
        progress("planes", done / options.rounds)
        labels = moved(pieces, labels, fitted, options)
        fitted = fit(pieces, labels, count, options)
        now = error(pieces, labels, fitted, options)
        if now > (1 - options.settled) * before:
            break
        before = now
    return labels


def billboards_about(plant: Plant, labels: IntArray, normal: FloatArray) -> Billboards:
    """One billboard for each cluster of a plant's faces (f,), with normals (k, 3)."""
    options = BoxOptions(shape="single", plane="orientation")
    boxes = boxes_about(plant.corners, Groups(labels), normal, len(normal))
    one = np.ones(len(normal), dtype=np.int32)
    return cut_planes(plant, labels, boxes, one, shown_shares(plant, labels, boxes), options)


def none_of(plant: Plant) -> Billboards:
    """No billboards."""
    none = np.empty((0, 3))
    return Billboards(none, none, none, none[:, :2], none[:, 0], np.empty(0, dtype=np.int32))
