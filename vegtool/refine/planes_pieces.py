"""Surface in pieces, and what pieces cost on planes, by moments that add up.

What a piece costs on a plane through c with the normal m is, per area,

    depth^2  +  compactness distance^2  +  orientation (1 - (n . m)^2)

depth: of its points off the plane, which is how far they are drawn from where they are; distance:
along the plane from c, which keeps pictures small and full; n: its normal, an oblique piece
covering less on the plane than it should. The plane that costs a cluster least passes through its
mean, and its normal is the least eigenvector of a 3 x 3 matrix: k-plane clustering (Bradley,
Mangasarian 2000) with the orientation of Cohen-Steiner, Alliez, Desbrun: Variational shape
approximation (2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.clustering.features import SAME, Labels, face_features, face_weights, own_corners
from vegtool.plant import Plant

AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The six numbers of a symmetric tensor, in the order of clustering/features."""
TWICE = np.array([1, 1, 1, 2**0.5, 2**0.5, 2**0.5])
"""Times these, six numbers have the scalar product of all nine."""


@dataclass(frozen=True)
class Weights:
    """What counts beside depth: `compactness`, and `orientation` in squared radii."""

    compactness: float
    orientation: float


@dataclass(frozen=True, eq=False)
class Pieces:
    """Surface in pieces, or clusters of them, n, by moments; lengths in radii, in a plant's own
    frame.

    weight: (n,) how much of it matters. middle: (n, 3) centroid. second: (n, 6) mean of the
    tensors x x^T of its points. looks: (n, 6) the same of its normals.
    """

    weight: FloatArray
    middle: FloatArray
    second: FloatArray
    looks: FloatArray

    def __len__(self) -> int:
        return len(self.weight)

    def __getitem__(self, rows: Labels) -> Pieces:
        return Pieces(self.weight[rows], self.middle[rows], self.second[rows], self.looks[rows])


@dataclass(frozen=True, eq=False)
class Planes:
    """Planes through center (k, 3) with the unit normal (k, 3)."""

    center: FloatArray
    normal: FloatArray


def pieces_of(plant: Plant, of_face: Labels) -> tuple[Pieces, FloatArray, float]:
    """The faces (f,) of each piece as one, weighted by their share of the surface; the axes (3, 3)
    of the plant's own frame; and the surface in squared radii.

    Numbers are multiples of SAME, so that rounding does not decide where a plant is turned.
    """
    corners, axes = own_corners(plant)
    edges = corners[:, 1:] - corners[:, :1]
    surface = float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum()) / 2
    features = face_features(plant, 1.0)
    around = corners - corners.mean(axis=1, keepdims=True)
    spread = np.stack([(around[..., i] * around[..., j]).sum(axis=1) for i, j in AXES], axis=1)
    spread = np.round(spread / 12 * TWICE / SAME) * SAME
    faces = Pieces(
        face_weights(plant),
        features[:, :3],
        spread + tensor(features[:, :3]),
        features[:, 3:],
    )
    return together(faces, of_face), axes, round(surface / SAME) * SAME


def tensor(vectors: FloatArray) -> FloatArray:
    """(n, 6) the tensors v v^T of vectors (n, 3)."""
    squares = [vectors[:, i] * vectors[:, j] for i, j in AXES]
    return np.asarray(np.stack(squares, axis=1) * TWICE)


def together(pieces: Pieces, labels: Labels) -> Pieces:
    """What pieces are with all those of the same label (n,), 0 to k - 1, each of which is used."""
    total = np.bincount(labels, pieces.weight).astype(np.float64)

    def mean(values: FloatArray) -> FloatArray:
        sums = [np.bincount(labels, pieces.weight * column) for column in values.T]
        return np.asarray(np.stack(sums, axis=1) / total[:, None])

    return Pieces(total, mean(pieces.middle), mean(pieces.second), mean(pieces.looks))


def matrices(clusters: Pieces, weights: Weights) -> FloatArray:
    """(k, 6) the matrices whose least eigenvectors are the normals of the best planes."""
    around = clusters.second - tensor(clusters.middle)
    six = (1 - weights.compactness) * around - weights.orientation * clusters.looks
    return np.asarray(six / TWICE)


def fit(clusters: Pieces, weights: Weights) -> Planes:
    """The planes that cost clusters least."""
    matrix = np.empty((len(clusters), 3, 3))
    for column, (i, j) in zip(matrices(clusters, weights).T, AXES, strict=True):
        matrix[:, i, j] = matrix[:, j, i] = column
    return Planes(clusters.middle, np.linalg.eigh(matrix)[1][:, :, 0])


def least_costs(clusters: Pieces, weights: Weights) -> FloatArray:
    """(k,) what clusters cost on their best planes, times their weight."""
    around = (clusters.second - tensor(clusters.middle))[:, :3].sum(axis=1)
    least = least_eigenvalues(matrices(clusters, weights))
    cost = least + weights.orientation + weights.compactness * around
    return np.asarray(clusters.weight * cost)


def least_eigenvalues(six: FloatArray) -> FloatArray:
    """(n,) of symmetric matrices (n, 6), in closed form.

    Smith: Eigenvalues of a symmetric 3 x 3 matrix (1961).
    """
    middle = six[:, :3].mean(axis=1)
    a, b, c = six[:, :3].T - middle
    d, e, f = six[:, 3:].T
    size = np.sqrt((a * a + b * b + c * c + 2 * (d * d + e * e + f * f)) / 6)
    volume = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    cube = 2 * size**3
    cosine = np.divide(volume, cube, out=np.ones_like(cube), where=cube > 0)
    angle = np.arccos(np.clip(cosine, -1, 1)) / 3
    return np.asarray(middle + 2 * size * np.cos(angle + 2 * np.pi / 3))


def costs(pieces: Pieces, planes: Planes, weights: Weights) -> tuple[FloatArray, FloatArray]:
    """What pieces cost on planes, per weight, as the product of (n, 11) and (11, k)."""
    flat, deep = weights.compactness, 1 - weights.compactness
    c, m = planes.center, planes.normal
    along = (c * m).sum(axis=1)
    left = [
        deep * pieces.second - weights.orientation * pieces.looks,
        pieces.middle,
        flat * pieces.second[:, :3].sum(axis=1, keepdims=True),
        np.ones((len(pieces), 1)),
    ]
    right = [
        tensor(m),
        -2 * flat * c - 2 * deep * along[:, None] * m,
        np.ones((len(c), 1)),
        (flat * (c * c).sum(axis=1) + deep * along**2 + weights.orientation)[:, None],
    ]
    return np.concatenate(left, axis=1), np.ascontiguousarray(np.concatenate(right, axis=1).T)
