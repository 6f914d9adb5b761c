"""How evenly the points of a prefix are spread, and how long a prefix is for discs of a radius.

Brandt, Jähn, Fischer, Meyer auf der Heide: Rendering of complex heterogenous scenes using
progressive blue surfels (2019), section 4.1 and figure 3. That does not say what distances are
relative to; here it is the largest that as many points in a plane can have from one another, on a
hexagonal grid (Lagae, Dutré: A comparison of methods for generating Poisson disk distributions,
2008).
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, checked
from vegtool.surfel_set import Spacing

PREFIX = 1000
"""Points of the prefix that is measured, p_m."""


def spacing(positions: FloatArray) -> Spacing:
    """Measures points (n, 3) in progressive order, metres."""
    positions = checked("positions", positions, (None, 3), np.float64)
    places = np.unique(positions[:PREFIX], axis=0)
    radius = float(np.median(nearest(places))) if len(places) > 1 else 0.0
    return Spacing(len(places), radius, len(positions))


def nearest(positions: FloatArray) -> FloatArray:
    """(n,) metres from each point (n, 3) to the nearest other one; infinite for one alone."""
    from scipy.spatial import cKDTree

    if len(positions) < 2:
        return np.full(len(positions), np.inf)
    return np.asarray(cKDTree(positions).query(positions, 2)[0][:, 1])


def relative(positions: FloatArray, area: float) -> FloatArray:
    """(n,) distance from each point (n, 3) to the nearest other, of the largest that n points on a
    plane of an area, m2, can all have. Below 1 on average, about 0.5 at random."""
    largest = (2 * area / (3**0.5 * max(len(positions), 1))) ** 0.5
    return np.asarray(nearest(positions) / largest)
