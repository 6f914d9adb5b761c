"""Billboards chosen by what their pictures get wrong, not by how compact their clusters are.

Planes are fitted to clusters and pieces of surface go to the plane that suits them best, in turn
(Bradley, Mangasarian: k-plane clustering, 2000), by a cost that planes_pieces.py states. Pieces are
the faces, the halves of a leaf card as one, and weigh by how much of them is seen
(planes_seen.py). The start is greedy: of all pairs of neighbours, those are merged that cost least
together (Ward 1963, "Hierarchical grouping to optimize an objective function").
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
from vegtool.clustering.features import Labels, quads
from vegtool.clustering.partition import compacted, disjoint_pairs
from vegtool.errors import UsageError
from vegtool.lod import Billboards
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.refine.planes_pieces import (
    Pieces,
    Planes,
    Weights,
    costs,
    fit,
    least_costs,
    pieces_of,
    together,
)
from vegtool.refine.planes_seen import opacity, seen

MOST_PIECES = 1 << 14
"""That are merged; of more, clusters of k-means are."""
PARTNERS = 16
"""Neighbours that a cluster may merge with."""
MERGED = 8
"""Of a round, one in so many clusters at most."""
NEAR = 64
"""Clusters, the nearest to its own, that a piece may move to."""
LEAST_SEEN = 1e-3
"""Of a piece: what seems hidden is to lie somewhere too."""
LEAST_GAIN = 1e-9
"""Of what a piece costs: it stays where it is unless it saves more."""


@dataclass(frozen=True)
class PlaneOptions:
    """What planes are chosen by, and for how long.

    compactness: what a squared distance along the plane from its centre costs, if one off the plane
    costs 1.
    orientation: what a piece seen from the edge costs, if one as far off its plane as it is large,
    or as a pixel where that is larger, costs 1.
    outside: power of the share of a piece that is seen, by which pieces weigh; 0 for all alike.
    rounds: of fitting and moving, at most.
    settled: share of the cost; a round that saves less is the last.
    """

    compactness: float = 0.01
    orientation: float = 0.1
    outside: float = 1.5
    rounds: int = 16
    settled: float = 1e-3


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
    pixel_m: metres that a pixel covers where the level is seen from nearest. There are fewer
    billboards only where there are fewer pieces. A plant moved, turned or scaled, and its pixel
    with it, is cut alike. Nothing is random: the seed changes nothing. Raises UsageError for a
    count below one.
    """
    options = options or PlaneOptions()
    if count < 1:
        raise UsageError(f"billboards: expected at least 1, got {count}. Ask for one or more.")
    labels = np.zeros(len(plant.faces), dtype=np.int32)
    if not len(faces):
        return labels, none()
    progress("planes", 0.0)
    shown = replace(
        plant,
        faces=plant.faces[faces],
        face_material=plant.face_material[faces],
        branches=None,
    )
    of_face = quads(shown)
    pieces, axes, surface = pieces_of(shown, of_face)
    size = float(np.sqrt(pieces.weight @ pieces.weight * surface))
    pixel = pixel_m / shown.radius if shown.radius else 0.0
    weights = Weights(options.compactness, options.orientation * (size**2 + pixel**2))
    if options.outside:
        share = np.maximum(seen(pieces, surface, size, opacity(shown)), LEAST_SEEN)
        pieces = replace(pieces, weight=pieces.weight * share**options.outside)
    start = np.arange(len(pieces))
    if len(pieces) > max(MOST_PIECES, count):
        how = ClusterOptions(orientation_weight=0.12)
        start[of_face] = cluster(shown, "kmeans", max(MOST_PIECES // 2, count), how, seed)
        start = compacted(start)
    found = merged(pieces, start, count, weights)
    found = settled(pieces, found, weights, options, progress)
    normal = fit(together(pieces, found), weights).normal @ axes
    own = found[of_face].astype(np.int32)
    labels[:] = len(normal)
    labels[faces] = own
    return labels, billboards_about(shown, own, normal)


def merged(pieces: Pieces, labels: Labels, count: int, weights: Weights) -> Labels:
    """Neighbouring clusters made one, the pairs that cost least first, until `count` are left."""
    from scipy.spatial import cKDTree

    k = int(labels.max()) + 1
    while k > count:
        clusters = together(pieces, labels)
        alone = least_costs(clusters, weights)
        features = [clusters.middle, np.sqrt(weights.orientation) * clusters.looks]
        place = np.concatenate(features, axis=1)
        near = cKDTree(place).query(place, k=min(PARTNERS + 1, k))[1]
        a, b = np.repeat(np.arange(k), near.shape[1]), near.ravel()
        a, b = a[a != b], b[a != b]
        added = least_costs(pairs(clusters, a, b), weights) - alone[a] - alone[b]
        order = np.argsort(added, kind="stable")
        most = max(1, min((k - count + 1) // 2, k // MERGED))
        labels = compacted(disjoint_pairs(a[order], b[order], k, most)[labels])
        k = int(labels.max()) + 1
    return labels


def pairs(clusters: Pieces, a: Labels, b: Labels) -> Pieces:
    """Clusters a (n,) and b (n,), each with the other as one."""
    one, other = clusters[a], clusters[b]
    weight = one.weight + other.weight
    part = (other.weight / weight)[:, None]
    return Pieces(
        weight,
        one.middle + part * (other.middle - one.middle),
        one.second + part * (other.second - one.second),
        one.looks + part * (other.looks - one.looks),
    )


def settled(
    pieces: Pieces,
    labels: Labels,
    weights: Weights,
    options: PlaneOptions,
    progress: Progress = silent,
) -> Labels:
    """Planes fitted and pieces moved in turn, until little is saved."""
    clusters = together(pieces, labels)
    before = float(least_costs(clusters, weights).sum())
    for done in range(options.rounds):
        progress("planes", (done + 1) / (options.rounds + 1))
        labels = moved(pieces, labels, fit(clusters, weights), weights)
        clusters = together(pieces, labels)
        now = float(least_costs(clusters, weights).sum())
        if now >= (1 - options.settled) * before:
            break
        before = now
    return labels


def moved(pieces: Pieces, labels: Labels, planes: Planes, weights: Weights) -> Labels:
    """Every piece on the plane that suits it best, of the NEAR next to its own; planes that are
    left empty are no more."""
    from scipy.spatial import cKDTree

    left, right = costs(pieces, planes, weights)
    nearest = np.arange(1, min(NEAR, len(planes.center)) + 1)
    near = cKDTree(planes.center).query(planes.center, k=nearest)[1]
    groups = Groups(labels.astype(np.int32))
    result = labels.copy()
    for own, (part, there) in enumerate(zip(groups.slices(), near, strict=True)):
        rows = groups.order[part]
        cost = left[rows] @ right[:, there]
        best = cost.argmin(axis=1)
        stay = left[rows] @ right[:, own]
        saved = stay - cost[np.arange(len(rows)), best]
        result[rows] = np.where(saved > LEAST_GAIN * stay, there[best], own)
    return compacted(result)


def billboards_about(plant: Plant, labels: IntArray, normal: FloatArray) -> Billboards:
    """One billboard for each cluster of a plant's faces (f,), with the normals (k, 3)."""
    options = BoxOptions(shape="single", plane="orientation")
    boxes = boxes_about(plant.corners, Groups(labels), normal, len(normal))
    one = np.ones(len(normal), dtype=np.int32)
    return cut_planes(plant, labels, boxes, one, shown_shares(plant, labels, boxes), options)


def none() -> Billboards:
    """No billboards."""
    empty = np.empty((0, 3))
    return Billboards(empty, empty, empty, empty[:, :2], empty[:, 0], np.empty(0, dtype=np.int32))
