"""Sets of surfels made by hand, that tests share."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vegtool.seeding import generator
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.distances import spacing
from vegtool.surfels.blue.exact import exact_order


def ball(
    count: int = 500, radius: float = 1.0, center: npt.ArrayLike = (0, 0, 0), unlit: bool = False
) -> SurfelSet:
    """A sphere of surfels in exact order, whose colours are their normals, as shares."""
    points = generator(0, "ball").normal(size=(20 * count, 3))
    normal = points / np.linalg.norm(points, axis=1, keepdims=True)
    normal = normal[exact_order(normal, count)]
    position = np.asarray(center) + radius * normal
    return SurfelSet(position, normal, (normal + 1) / 2, spacing(position), unlit=unlit)
