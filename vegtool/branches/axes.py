"""The tubes' axes as segments, and the nearest of them to a point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.branches.skeleton import Skeleton
from vegtool.branches.tubes import Tubes

NEIGHBOURS = 3  # samples looked at for each leaf
DEPTH = 0.1  # inside wood, a tenth of the distance to the axis counts
MOST_SAMPLES = 12  # per segment; one per diameter, so that the nearest lies on a near segment


@dataclass(frozen=True, eq=False)
class Axes:
    """Segments of tubes: s of them.

    a, b: (s, 3) ends, a towards the tube's start; radius_a, radius_b: (s,); tube: (s,);
    along: (s,) how far from the tube's start a lies. All in units of the plant's radius.
    """

    a: FloatArray
    b: FloatArray
    radius_a: FloatArray
    radius_b: FloatArray
    tube: np.ndarray
    along: FloatArray

    @cached_property
    def tree(self) -> Any:
        """A k-d-tree of the samples."""
        return tree_of(self.samples[0])

    @cached_property
    def samples(self) -> tuple[FloatArray, np.ndarray]:
        """(n, 3) points on the axes and (n,) the segment of each."""
        length = np.linalg.norm(self.b - self.a, axis=1)
        thick = np.maximum(self.radius_a + self.radius_b, length / MOST_SAMPLES + 1e-12)
        count = np.clip(np.ceil(length / thick), 1, MOST_SAMPLES).astype(np.int64)
        segment = np.repeat(np.arange(len(length)), count)
        nth = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
        t = ((nth + 0.5) / count[segment])[:, None]
        return self.a[segment] * (1 - t) + self.b[segment] * t, segment

    def measure(
        self, points: FloatArray, segment: np.ndarray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance (n, k) of points (n, 3) to the axes of segments (n, k), the radius of the wood
        there, and how far along the tube that is."""
        a, b = self.a[segment], self.b[segment]
        line = b - a
        square = np.maximum(np.einsum("nki,nki->nk", line, line), np.finfo(float).tiny)
        t = np.clip(np.einsum("nki,nki->nk", points[:, None] - a, line) / square, 0, 1)
        distance = np.linalg.norm(points[:, None] - a - t[..., None] * line, axis=-1)
        radius = self.radius_a[segment] * (1 - t) + self.radius_b[segment] * t
        return distance, radius, self.along[segment] + t * np.sqrt(square)

    def cost(self, points: FloatArray, segment: np.ndarray) -> FloatArray:
        """(n, k) what it costs to hang a leaf with its anchor at the point on the segment: the gap
        to the wood's surface; inside the wood, how deep."""
        distance, radius, _ = self.measure(points, segment)
        return np.maximum(distance - radius, 0) + DEPTH * distance

    def nearest_tubes(self, points: FloatArray) -> tuple[np.ndarray, FloatArray]:
        """(n,) the tube on which it costs least to hang a leaf anchored at each point, and the
        cost, (n,)."""
        segment_of = self.samples[1]
        k = min(NEIGHBOURS, len(segment_of))
        near = self.tree.query(points, k=k)[1].reshape(len(points), k)
        segment = segment_of[near]
        cost = self.cost(points, segment)
        best = cost.argmin(axis=1)
        row = np.arange(len(points))
        return self.tube[segment[row, best]], cost[row, best]

    def cost_to_tube(self, points: FloatArray, tube: np.ndarray) -> FloatArray:
        """(n,) what it costs to hang a leaf anchored at each point on that tube."""
        size = np.bincount(self.tube)
        first, count = (np.cumsum(size) - size)[tube], size[tube]
        row = np.repeat(np.arange(len(points)), count)
        nth = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        segment = np.argsort(self.tube, kind="stable")[first[row] + nth]
        least = np.full(len(points), np.inf)
        np.minimum.at(least, row, self.cost(points[row], segment[:, None])[:, 0])
        return least


def axes_of(rings: Skeleton, tubes: Tubes) -> Axes:
    """One segment per ring, to the ring before it; of no length where a part starts."""
    b = np.arange(len(rings.parent))
    a = np.where(rings.parent >= 0, rings.parent, b)
    begins = tubes.start[tubes.ring_tube]
    radius_a = np.where(b == begins, rings.radius[b], rings.radius[a])
    along = np.where(b == begins, 0.0, tubes.along[a])
    return Axes(rings.center[a], rings.center[b], radius_a, rings.radius[b], tubes.ring_tube, along)


def tree_of(points: FloatArray) -> Any:
    """A k-d-tree; the median splits are left out, which is faster and no less exact."""
    from scipy.spatial import cKDTree

    return cKDTree(points, balanced_tree=False, compact_nodes=False)
