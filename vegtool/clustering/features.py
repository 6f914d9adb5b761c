"""What the clustering methods see of a plant: weighted points in a feature space.

A face is nine numbers: its centroid, and the tensor n n^T of its normal (which does not tell front
from back). Off-diagonals are scaled by sqrt 2, so that Euclidean distance is Frobenius distance.
Positions are in plant radii from the centre; `ClusterOptions.orientation_scale` scales the tensor.
All nine lie in the plant's own frame (`frame`), so that a cut across an axis, or a cell of a grid,
is the same one however the plant is turned.

Points stand for one or more faces, so that the cost of clustering does not grow with the plant:
the halves of a quad are one *piece* (which also keeps a leaf card on one billboard), equal faces
are one, and where there are still too many, `coarse` joins those that share a grid cell.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit
from vegtool.plant import Plant

SAME = 1e-9  # plant radii: features closer than this, per axis, are the same
TIED = 1e-6  # of the largest: variances, third moments, squared edges this close are equal
FAR = 0.618  # of the farthest point's distance
PARALLEL = 0.99  # cosine: halves of a quad may be bent by 8 degrees
LIGHTEST = 1e-6  # of the mean face: the weight of faces without area
CELLS = 1 << 14  # points that clustering works on
CELLS_PER_CLUSTER = 8  # at least, where the count is large
FIRST_EDGE = 1 / 128  # plant radii: suits trees of 100,000 triangles and more

Labels = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Samples:
    """Distinct weighted points, and which of them each face became.

    points: (n, 9) plant radii, pairwise different. weights: (n,) positive, sum 1.
    of_face: (f,) index into points.
    """

    points: FloatArray
    weights: FloatArray
    of_face: Labels


def face_features(plant: Plant, orientation_scale: float) -> FloatArray:
    """(f, 9) plant radii: centroid and scaled normal tensor of every face; see the module.

    Center and radius are those of the plant's bounds in its own frame. Features are multiples of
    SAME, so that rounding does not decide between points that are equally near.
    """
    corners, axes = own_corners(plant)
    position = corners.mean(axis=1)
    scale = plant.radius or 1.0
    x, y, z = np.einsum("fi,ai->af", unit(plant.face_area_vectors / scale**2), axes)
    root2 = sqrt(2)
    tensor = np.stack([x * x, y * y, z * z, root2 * x * y, root2 * x * z, root2 * y * z], axis=1)
    features = np.concatenate([position, orientation_scale * tensor], axis=1)
    return np.asarray(np.round(features / SAME) * SAME)


def own_corners(plant: Plant) -> tuple[FloatArray, FloatArray]:
    """(f, 3, 3) plant radii: the faces' corners in the plant's own frame; and (3, 3) its axes.

    Center and radius are those of the plant's bounds in that frame.
    """
    corners = (plant.corners - plant.center) / (plant.radius or 1.0)
    axes = frame(corners.mean(axis=1), face_weights(plant))
    corners = np.einsum("fci,ai->fca", corners, axes)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    radius = float(np.linalg.norm(high - low)) / 2
    return (corners - (low + high) / 2) / (radius or 1.0), axes


def frame(points: FloatArray, weights: FloatArray) -> FloatArray:
    """(3, 3) rows: principal axes of weighted points (n, 3), longest first, right-handed.

    Turned points give turned axes. The first two point to the side to which the points are skewed.
    Where points are skewed to neither side, or spread alike along several axes, the first point
    that lies FAR off decides.
    """
    offset = points - (weights[:, None] * points).sum(axis=0)
    values, vectors = np.linalg.eigh(np.einsum("n,ni,nj->ij", weights, offset, offset))
    values, axes = values[::-1], vectors.T[::-1].copy()
    for i in range(2):
        alike = slice(i, int((values[i] - values <= TIED * values[0]).nonzero()[0][-1]) + 1)
        within = np.einsum("ni,ai->na", offset, axes[alike])
        first = within[first_far(np.linalg.norm(within, axis=1))]
        basis = np.linalg.qr(np.column_stack([first, np.eye(len(first))]))[0]
        axes[alike] = basis.T @ axes[alike]
        along = np.einsum("ni,i->n", offset, axes[i])
        skew = float((weights * along**3).sum())
        if abs(skew) <= TIED * max(float(values[0]), 0.0) ** 1.5:
            skew = float(along[first_far(np.abs(along))])
        axes[i] *= -1.0 if skew < 0 else 1.0
    axes[2] = np.cross(axes[0], axes[1])
    return axes


def first_far(distance: FloatArray) -> int:
    """The first of (n,) distances that is more than FAR of the greatest, or 0."""
    return int((distance > FAR * distance.max()).argmax())


def face_weights(plant: Plant) -> FloatArray:
    """(f,) share of the plant's area, at least LIGHTEST of the mean; equal if there is no area.

    In steps of SAME of the mean, as the features are.
    """
    areas = plant.face_areas / (plant.radius or 1.0) ** 2
    mean = areas.mean()
    if mean == 0:
        return np.full(len(areas), 1 / len(areas))
    weights = np.round(np.maximum(areas / mean, LIGHTEST) / SAME) * SAME
    return np.asarray(weights / weights.sum())


def samples(
    plant: Plant, orientation_scale: float, count: int, group: Labels | None = None
) -> Samples:
    """The plant's pieces as points, or its faces where `count` asks for more than pieces.

    group: (f,) faces of different groups never become one point.
    """
    features = face_features(plant, orientation_scale)
    weights = face_weights(plant)
    pieces = _grouped(features, weights, quads(plant, group))
    pieces = coarser(pieces, SAME, group)
    if len(pieces.points) >= count:
        return pieces
    return _grouped(features, weights, cells(features, SAME, group))


def coarse(fine: Samples, count: int, group: Labels | None = None) -> Samples:
    """`fine` with the points that share a grid cell made one, where there are very many.

    At most CELLS points, more for a large count; at least as many as clusters are asked for.
    """
    limit = max(CELLS, CELLS_PER_CLUSTER * count)
    if len(fine.points) <= limit:
        return fine
    edge, widest = FIRST_EDGE, 2 * float(np.abs(fine.points).max())
    result = coarser(fine, edge, group)
    while len(result.points) < limit // 4 and edge > SAME:  # the plant huddles in few cells
        edge /= 2
        result = coarser(fine, edge, group)
    while len(result.points) > limit and edge < widest:
        edge *= max(1.25, (len(result.points) / limit) ** 0.2)  # the points fill some 5 dimensions
        result = coarser(result, edge, group)
    return result if len(result.points) >= count else fine


def coarser(fine: Samples, edge: float, group: Labels | None = None) -> Samples:
    """`fine` with the points that share a cell of the grid with that edge made one."""
    of_point = None if group is None else spread_to(fine.of_face, group)
    cell = cells(fine.points, edge, of_point)
    result = _grouped(fine.points, fine.weights, cell)
    return Samples(result.points, result.weights, cell[fine.of_face])


def spread_to(of_face: Labels, group: Labels) -> Labels:
    """(n,) the group that each point, or each cluster, lies in, from that of its faces."""
    result = np.empty(int(of_face.max()) + 1, dtype=np.int64)
    result[of_face] = group
    return result


def quads(plant: Plant, group: Labels | None = None) -> Labels:
    """(f,) piece of each face: faces that share their longest edge, by position, and are parallel.

    The longest edge of a quad's halves is its diagonal. Faces need not share vertex indices.
    """
    corners = plant.corners
    edges = corners - np.roll(corners, 1, axis=1)
    squared = np.einsum("fij,fij->fi", edges, edges)
    longest = (squared >= (1 - TIED) * squared.max(axis=1, keepdims=True)).argmax(axis=1)
    rows = np.arange(len(corners))
    a, b = corners[rows, longest], corners[rows, longest - 1]
    along = b - a
    ahead = along[rows, (along != 0).argmax(axis=1)] >= 0  # which end comes first must not matter
    along = np.where(ahead[:, None], along, -along)
    ends = np.concatenate([a + b, along], axis=1)  # a + b equals b + a exactly
    same = _same_rows((ends + 0.0).view(np.int64))  # + 0.0: no negative zero
    first = np.full(same.max() + 1, len(rows))
    np.minimum.at(first, same, rows)
    leader = first[same]
    normal = unit(plant.face_area_vectors / (plant.radius or 1.0) ** 2)
    fits = np.abs(np.einsum("fi,fi->f", normal, normal[leader])) > PARALLEL
    if group is not None:
        fits &= group == group[leader]
    return np.unique(np.where(fits, leader, rows), return_inverse=True)[1]


def cells(points: FloatArray, edge: float, group: Labels | None = None) -> Labels:
    """(n,) which cell, of that edge length, of a grid in feature space each point lies in."""
    rows = np.floor(points / edge + 0.5).astype(np.int64)
    return _same_rows(rows if group is None else np.concatenate([rows, group[:, None]], axis=1))


def _same_rows(rows: npt.NDArray[np.int64]) -> Labels:
    """(n,) group of equal rows; by 64-bit hash (a collision, 1 in 1e7 plants, joins two groups)."""
    mixed = np.zeros(len(rows), dtype=np.uint64)
    for column in rows.T:
        mixed ^= column.astype(np.uint64)
        mixed *= np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return np.unique(mixed, return_inverse=True)[1]


def _grouped(points: FloatArray, weights: FloatArray, group: Labels) -> Samples:
    """Weighted means of the points of each group."""
    total: FloatArray = np.bincount(group, weights).astype(np.float64)
    means = [np.bincount(group, weights * column) / total for column in points.T]
    return Samples(np.stack(means, axis=1), total, group)
