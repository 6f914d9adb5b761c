"""What a hybrid costs: surface error, polygons, fill.

"Hybrid billboard clouds" (sketch), section 2: "a cost function that includes terms for surface
error, polycount, and fillrate". All three are shares of the original: of its surface, what is
displaced or not shown; of its triangles, how many there are; of the fragments that it makes, seen
from all around and hidden ones included, how many are made. A plane makes half of its area, in the
mean over all directions, and so does a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.hybrid.options import Weights

DISPLACED = 0.5
"""What costs a surface that is drawn as far from its place as a plane may move it, if one that is
not shown costs 1; so does one twice as far away."""
PER_BILLBOARD = 2
"""Triangles; twice as many where its sides differ."""


@dataclass(frozen=True)
class Terms:
    """error: of the surface, 0 to 1. polygons: of the original's triangles. fill: of its
    fragments."""

    error: float = 0.0
    polygons: float = 0.0
    fill: float = 0.0

    def __add__(self, other: Terms) -> Terms:
        return Terms(
            self.error + other.error, self.polygons + other.polygons, self.fill + other.fill
        )

    def __sub__(self, other: Terms) -> Terms:
        return Terms(
            self.error - other.error, self.polygons - other.polygons, self.fill - other.fill
        )

    def cost(self, weights: Weights) -> float:
        return (
            weights.error * self.error + weights.polygons * self.polygons + weights.fill * self.fill
        )


def misplaced(distance: FloatArray, reach: float) -> FloatArray:
    """What surface costs that is drawn so far from its place; infinite for what is not drawn."""
    return np.asarray(np.minimum(DISPLACED * distance / max(reach, np.finfo(float).tiny), 1.0))
