"""Normals of leaves bent towards those of the crown as a whole.

After Reeves, Blau: Approximate and probabilistic algorithms for shading and rendering structured
particle systems (1985), who shade a tree's leaves by where they are in a simple shape around it;
here the ellipsoid that has the leaves' own moments, so that there is nothing to tell.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.plant import Plant

THINNEST = 1e-2
"""Of the crown's longest axis: what is flatter has normals across it and no others."""
TIED = 1e-6
"""Cosine: a leaf that looks into the crown by less lies along it; rounding is not to turn it."""


def crown_normals(plant: Plant, share: float) -> Plant:
    """The plant with the normals of its leaves so far, 0 to 1, towards those of its crown.

    A leaf keeps the side that is its front: where that looks into the crown, the crown's normal
    turns round, as clients turn it back for whoever sees the leaf from outside. Leaves get vertices
    of their own.
    """
    leaf = plant.face_is_leaf
    if share <= 0 or not leaf.any():
        return plant
    faces = np.flatnonzero(leaf)
    origin = plant.faces[faces].ravel()
    outward = ellipsoid_normals(plant, faces, plant.positions[origin])
    front = unit(np.repeat(plant.face_area_vectors[faces] / (plant.radius or 1.0) ** 2, 3, axis=0))
    outward *= np.where((outward * front).sum(axis=1, keepdims=True) < -TIED, -1.0, 1.0)
    bent = unit((1 - share) * plant.normals[origin] + share * outward)
    bent = np.where(np.any(bent, axis=1, keepdims=True), bent, outward)
    count = len(plant.positions)
    numbers = plant.faces.copy()
    numbers[faces] = count + np.arange(len(origin), dtype=np.int32).reshape(-1, 3)

    def longer(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else np.concatenate([values, values[origin]])

    return replace(
        plant,
        positions=np.concatenate([plant.positions, plant.positions[origin]]),
        normals=np.concatenate([plant.normals, bent]),
        uvs=np.concatenate([plant.uvs, plant.uvs[origin]]),
        colors=longer(plant.colors),
        exposure=longer(plant.exposure),
        faces=numbers,
    )


def ellipsoid_normals(plant: Plant, faces: np.ndarray, points: FloatArray) -> FloatArray:
    """(n, 3) unit normals, at points (n, 3), of ellipsoids about the middle of some faces, (k,)
    indices, as long along each axis as these spread; +y in the middle itself."""
    area = plant.face_areas[faces] + np.finfo(float).tiny
    weight = area / area.sum()
    middle = weight @ plant.face_centroids[faces]
    off = (plant.face_centroids[faces] - middle) / (plant.radius or 1.0)
    values, axes = np.linalg.eigh(np.einsum("f,fi,fj->ij", weight, off, off))
    if values[-1] < np.finfo(float).eps ** 2:  # one leaf: a ball about it
        values = np.ones(3)
    thinnest = THINNEST**2 * values[-1]
    if values[0] < thinnest <= values[1]:
        return np.tile(axes[:, 0], (len(points), 1))
    values = np.maximum(values, thinnest)
    local = ((points - middle) / (plant.radius or 1.0)) @ axes
    normal = unit((local / values) @ axes.T)
    return np.where(np.any(normal, axis=1, keepdims=True), normal, np.array([0.0, 1.0, 0.0]))
