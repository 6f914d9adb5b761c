"""How much of the sky's light a plant lets through to its own parts: ambient occlusion.

Landis, "Production-ready global illumination" (2002): ambient light is less by the share of
directions from which the plant hides a place, weighed by the cosine. That share is the one that
planes are weighed by: foliage as a turbid medium (planes_seen.py), so nothing is drawn and single
leaves cast no edges. Both sides of a face have their own; what reaches the far side is how much
light there is for a leaf to let through, which engines call thickness (Barré-Brisebois, Bouchard:
Approximating translucency for a fast, cheap and convincing subsurface scattering look, 2011).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from vegtool.arrays import FloatArray, unit
from vegtool.clustering.features import quads
from vegtool.plant import Plant
from vegtool.refine.planes_pieces import pieces_of
from vegtool.refine.planes_seen import opacity, transmittances

NEAR = 8
"""Faces of a plant from which a vertex of a level has its exposure."""


def exposed(plant: Plant, strength: float) -> Plant:
    """The plant with its `exposure`: 1 - strength x (share of the sky's light that is hidden).

    strength: 0 for none, to 1. A vertex takes the mean of its faces, by area.
    """
    if strength <= 0 or not len(plant.faces):
        return plant
    exposure = 1 - strength * (1 - exposures(plant))
    return replace(plant, exposure=at_vertices(plant, exposure))


def exposures(plant: Plant) -> FloatArray:
    """(f, 2) 0 to 1: how much of the sky's light reaches the front and the back of each face."""
    of_face = quads(plant)
    pieces, axes, surface = pieces_of(plant, of_face)
    normal = unit(plant.face_area_vectors / (plant.radius or 1.0) ** 2) @ axes.T
    total = np.zeros(len(normal))
    reached = np.zeros((len(normal), 2))
    size = float(np.sqrt(pieces.weight @ pieces.weight * surface))
    for direction, toward, away in transmittances(pieces, surface, size, opacity(plant)):
        cosine = normal @ direction
        ends = np.stack([toward, away], axis=1)[of_face]
        ends = np.where(cosine[:, None] < 0, ends[:, ::-1], ends)
        reached += np.abs(cosine)[:, None] * ends
        total += np.abs(cosine)
    return np.divide(reached, total[:, None], out=np.ones_like(reached), where=total[:, None] > 0)


def at_vertices(plant: Plant, values: FloatArray) -> FloatArray:
    """(v, c) of values (f, c): the mean of a vertex' faces, by area; 1 where it has none."""
    corners, count = plant.faces.ravel(), len(plant.positions)
    weight = np.repeat(plant.face_areas, 3)
    total = np.bincount(corners, weight, count)[:, None]
    sums = [np.bincount(corners, weight * np.repeat(column, 3), count) for column in values.T]
    mean = np.ones((count, values.shape[1]))
    return np.divide(np.stack(sums, axis=1), total, out=mean, where=total > 0)


def exposed_like(mesh: Plant, plant: Plant) -> Plant:
    """A mesh made of a plant with the exposure of what of it lies nearest, side for side."""
    if plant.exposure is None:
        return mesh
    near = min(NEAR, len(plant.faces))
    found = cKDTree(plant.face_centroids).query(mesh.positions, k=near)[1].reshape(-1, near)
    of_face = plant.exposure[plant.faces].mean(axis=1)[found]
    facing = np.einsum("vi,vki->vk", mesh.normals, plant.face_area_vectors[found])
    of_face = np.where((facing < 0)[..., None], of_face[..., ::-1], of_face)
    weight = plant.face_areas[found]
    mean = (weight[..., None] * of_face).sum(axis=1)
    total = weight.sum(axis=1)[:, None]
    exposure = np.divide(mean, total, out=np.ones_like(mean), where=total > 0)
    return replace(mesh, exposure=exposure)
