"""A box turned about its own axes, one after the other, until none of its rectangles is smaller.

O'Rourke, "Finding minimal enclosing boxes" (1985): faces of the least box lie flush with edges of
the convex hull. About one axis the box of least volume has the rectangle of least area for its
section, which is known exactly; so where the search by steps stops short, as it does where nothing
tells it where to start (cubes, spheres, needles), this ends on the edges themselves.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.boxes.rectangle import least_rectangle

ROUNDS = 8
"""Times all three axes are tried at most."""
LEAST_GAIN = 1e-9
"""Fraction of its area by which a rectangle must be smaller: more than rounding."""
THIN = 1e-12
"""Of the farthest point's distance: sides below this are rounding, and count as this long."""


def flush_box(points: FloatArray, axes: FloatArray) -> FloatArray:
    """Rows (3, 3), the axes of a box around points (m, 3) no larger than the one along `axes`."""
    axes = axes.copy()
    thin = THIN * float(np.linalg.norm(points, axis=1).max())
    sides = np.maximum(np.ptp(points @ axes.T, axis=0), thin)
    for _ in range(ROUNDS):
        before = axes.copy()
        for about in np.argsort(-sides, kind="stable"):
            one, other = (about + 1) % 3, (about + 2) % 3
            (x, y), low, high = least_rectangle(axes[[one, other]] @ points.T)
            found = np.maximum(high - low, thin)
            if found.prod() < sides[one] * sides[other] * (1 - LEAST_GAIN):
                axes[one], axes[other] = (
                    x * axes[one] + y * axes[other],
                    x * axes[other] - y * axes[one],
                )
                sides[[one, other]] = found
        if np.array_equal(axes, before):
            break
    return axes
