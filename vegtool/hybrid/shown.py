"""Of how many viewers does a billboard show a face? Fractional coverage.

After "Hybrid billboard clouds" (sketch), section 2: "the fraction of all viewing angles from which
it is visible". Far away, a viewer sees a face of the normal n along a direction d as |n . d| of its
area, and its picture on a plane of the normal m as |n . m| |m . d|. What a plane shows of a face
beyond what others do counts; more than all of it is not needed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.clustering.plane_cover import even_hemisphere

VIEWERS = 64
"""Directions, over half a sphere: from the other side all looks alike."""


@lru_cache(maxsize=1)
def viewers() -> FloatArray:
    """(VIEWERS, 3) unit vectors."""
    return even_hemisphere(VIEWERS)


def seen(normals: FloatArray) -> FloatArray:
    """(n, v) how large faces of these unit normals (n, 3) look, per area."""
    return np.asarray(np.abs(normals @ viewers().T))


def pictured(normals: FloatArray, planes: FloatArray) -> FloatArray:
    """(n, v) how large the pictures of faces (n, 3) on a plane each, (n, 3), look, per area."""
    onto = np.abs(np.einsum("ni,ni->n", normals, planes))
    return np.asarray(onto[:, None] * seen(planes))


def shown_fraction(normals: FloatArray, pictures: FloatArray) -> FloatArray:
    """(n,) 0 to 1: how much of what is to be seen of faces (n, 3), from all around, their pictures
    show, (n, v) of all billboards together. Of faces without a normal, all."""
    wanted = seen(normals)
    total = wanted.sum(axis=1)
    shown = np.minimum(wanted, pictures).sum(axis=1)
    return np.asarray(np.divide(shown, total, out=np.ones_like(total), where=total > 0))
