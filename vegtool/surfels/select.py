"""Which billboards and triangles are drawn for an eye.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.5; sequential as in Dachsbacher, Vogelgsang, Stamminger: Sequential point trees (2003).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.surfels.hierarchy import SurfelHierarchy
from vegtool.surfels.validity import projection_error, spread

Bools = npt.NDArray[np.bool_]


def valid(one: SurfelHierarchy, eye: FloatArray, epsilon: float, pc: float) -> Bools:
    """(b,) whether billboards are valid (eq. 1) for an eye (3,): a texel covers no more than
    epsilon pixels, which holds from z_min on (eq. 9), and the plane displaces nothing by more."""
    return _valid(one, np.arange(len(one)), eye, epsilon, pc)


def top_down(one: SurfelHierarchy, eye: FloatArray, epsilon: float, pc: float) -> IntArray:
    """(m,) int32 what is drawn (eq. 18), by descent: whatever is valid below nothing that is."""
    found, over = valid(one, eye, epsilon, pc), np.zeros(len(one), dtype=bool)
    for number in range(len(one) - 1, -1, -1):
        father = one.father[number]
        over[number] = father >= 0 and (over[father] or found[father])
    return np.flatnonzero(found & ~over).astype(np.int32)


def left_to_triangles(one: SurfelHierarchy, drawn: IntArray) -> Bools:
    """(p,) the patches that no billboard shows of those drawn, (m,): they are drawn as triangles,
    as fine as the multi-triangulation has it."""
    chosen = np.zeros(len(one), dtype=bool)
    chosen[drawn] = True
    return np.asarray(shown_below(one, chosen) < 0)


def shown_below(one: SurfelHierarchy, chosen: Bools) -> IntArray:
    """(p,) int32 the highest of the billboards chosen, (b,), over each patch, -1 where there is
    none."""
    highest = np.full(len(one) + 1, -1, dtype=np.int32)  # the last: over nothing
    for number in range(len(one) - 1, -1, -1):
        over = highest[one.father[number]]
        highest[number] = number if over < 0 and chosen[number] else over
    return np.asarray(highest[one.above])


@dataclass(frozen=True, eq=False)
class Sequence:
    """A hierarchy as an array of billboards by what is left of z_min of their fathers.

    order: (b,) int32 billboards. until: (b,) metres, rising: epsilon / pc times the distance of the
    whole from which on a father is valid from everywhere, infinite where there is none.
    """

    hierarchy: SurfelHierarchy
    order: IntArray
    until: FloatArray

    def range(self, eye: FloatArray, epsilon: float, pc: float) -> slice:
        """Those that may be drawn for an eye (3,), found in O(log b)."""
        one = self.hierarchy
        roots = one.father < 0
        away = np.linalg.norm(one.center[roots] - eye, axis=1) - one.radius[roots]
        nearest = max(float(away.min(initial=np.inf)), 0.0)
        first = int(np.searchsorted(self.until, nearest * epsilon / pc, side="right"))
        return slice(first, len(self.order))

    def drawn(self, eye: FloatArray, epsilon: float, pc: float) -> IntArray:
        """(m,) int32 what is drawn: of each that may be, itself and its father are looked at."""
        one = self.hierarchy
        rows = self.order[self.range(eye, epsilon, pc)]
        father = one.father[rows]
        hidden = _valid(one, np.maximum(father, 0), eye, epsilon, pc) & (father >= 0)
        return np.sort(rows[_valid(one, rows, eye, epsilon, pc) & ~hidden])


def sequence(one: SurfelHierarchy) -> Sequence:
    """The billboards in the order in which they come into question."""
    over = one.father >= 0
    until = np.full(len(one), np.inf)
    until[over] = one.error[one.father[over]] / spread(one.theta)
    order = np.argsort(until, kind="stable").astype(np.int32)
    return Sequence(one, order, until[order])


def _valid(
    one: SurfelHierarchy, rows: npt.NDArray[np.integer], eye: FloatArray, epsilon: float, pc: float
) -> Bools:
    to_center = one.center[rows] - eye
    z = np.linalg.norm(to_center, axis=1) - one.radius[rows]
    far = z * epsilon >= one.error[rows] * pc
    half_depth = one.boxes.half[rows, 2]
    moved = projection_error(half_depth, one.boxes.normal[rows], to_center, z, pc)
    return np.asarray(far & (z > 0) & (moved <= epsilon))
