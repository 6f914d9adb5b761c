"""What a hierarchy of surfel billboards stands on: the coarsest triangles of a multi-triangulation.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007), section
4.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.surfels.box import boxes_of
from vegtool.surfels.multi_triangulation import MultiTriangulation

Ints = npt.NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class Base:
    """What a hierarchy stands on: p patches of t triangles.

    corners: (t, 3, 3) metres, patch by patch. first: (p,) int the first triangle of each, none of
    which is empty. error: (p,) metres, of the surface as triangles: none is coarser. center: (p, 3)
    and radius: (p,) metres, spheres that errors are seen from, round the patches.
    """

    corners: FloatArray
    first: Ints
    error: FloatArray
    center: FloatArray
    radius: FloatArray


def base_of(mt: MultiTriangulation) -> Base:
    """The patches of the source's arcs. What has never been simplified is seen from spheres of its
    own, all else from those of the nodes that made it."""
    source = len(mt.error) - 1
    begin = int(np.searchsorted(mt.start, source))
    at = int(mt.first[begin])
    corners, first = mt.plant.positions[mt.faces[at:]], mt.first[begin:-1] - at
    made_by = mt.end[begin:]
    boxes = boxes_of(corners, first)
    simplified = made_by > 0
    center = np.where(simplified[:, None], mt.center[made_by], boxes.center)
    radius = np.where(simplified, mt.radius[made_by], np.linalg.norm(boxes.half, axis=1))
    return Base(corners, first, mt.error[made_by], center, radius)
