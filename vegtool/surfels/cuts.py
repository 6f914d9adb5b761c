"""Cuts of a multi-triangulation: which patches are drawn.

Holst, Schumann: Surfel-based billboard hierarchies for fast rendering of 3D-objects (2007),
section 4.1. A cut is drawn where nodes are applied or not: of each arc whose end is applied, and
whose start is not, the patch. It is a valid one where every node below an applied one is applied
too, which errors and spheres see to (eq. 10 to 12).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.plant import Plant
from vegtool.surfels.multi_triangulation import MultiTriangulation
from vegtool.surfels.sheets import Flags, Labels


def by_error(mt: MultiTriangulation, delta: float) -> Flags:
    """(a,) bool: the arcs of the cut where no node's error is more than delta metres (eq. 10): at
    0 the original, at infinity the coarsest level."""
    return between(mt, mt.error <= delta)


def by_image_error(mt: MultiTriangulation, eye: FloatArray, pc: float, epsilon: float) -> Flags:
    """(a,) bool: the arcs of the cut whose image-space errors are at most epsilon pixels (eq. 12);
    see `image_errors`."""
    return between(mt, image_errors(mt, eye, pc) <= epsilon)


def image_errors(mt: MultiTriangulation, eye: FloatArray, pc: float) -> FloatArray:
    """(n,) pixels: bounds on the nodes' errors as seen from an eye (3,), metres (eq. 11).

    pc: pixels that a metre covers at a distance of one (eq. 3). The distance of an eye from the
    node's center stands for the depth, so that turning the head changes nothing. Infinite from
    inside the node's sphere, unless the node has no error.
    """
    distance = np.linalg.norm(mt.center - eye, axis=1) - mt.radius
    outside = distance > 0
    error = np.where(outside | (mt.error == 0), mt.error, np.inf)
    return np.asarray(error / np.where(outside, distance, 1.0) * pc)


def z_min(mt: MultiTriangulation, pc: float, epsilon: float) -> FloatArray:
    """(n,) metres from a node's center, from which on it may be applied (eq. 16); infinite at the
    source, 0 at the drain."""
    return np.asarray(np.where(mt.error > 0, mt.error / epsilon * pc + mt.radius, 0.0))


def coarsest(mt: MultiTriangulation) -> Flags:
    """(a,) bool: the arcs of the source."""
    return np.asarray(mt.start == len(mt.error) - 1)


def between(mt: MultiTriangulation, applied: Flags) -> Flags:
    """(a,) bool: the arcs from nodes that are not applied to such as are, of (n,) bool. The drain
    always is, the source never."""
    return np.asarray((applied[mt.end] | (mt.end == 0)) & (~applied[mt.start] | coarsest(mt)))


def triangles(mt: MultiTriangulation, cut: Flags) -> Labels:
    """(k,) int64 rows of `mt.faces` that a cut (a,) draws."""
    return np.flatnonzero(np.repeat(cut, mt.sizes))


def drawn(mt: MultiTriangulation, cut: Flags) -> Plant:
    """The plant as a cut (a,) draws it, with all its vertices, used or not."""
    rows = triangles(mt, cut)
    material = np.repeat(mt.material, mt.sizes)[rows]
    return replace(mt.plant, faces=mt.faces[rows], face_material=material, branches=None)
