"""The mesh of a hybrid, in the colours of what it stands for.

A vertex has the mean colour of the faces about all original vertices that have become part of it,
as textures show them, and the normal of the nearest of these on its own side of a crease.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.hybrid.greedy import Part
from vegtool.plant import Plant
from vegtool.refine.face_texels import face_colors
from vegtool.refine.mesh import ColoredMesh


def colored(plant: Plant, parts: Iterable[Part]) -> ColoredMesh | None:
    """All parts as one mesh, in metres; None for none."""
    color = face_colors(plant, np.arange(len(plant.faces), dtype=np.int32))
    meshes = [_colored(plant, part, color) for part in parts]
    if not meshes:
        return None
    first = np.cumsum([0, *(len(one.positions) for one in meshes)])
    return ColoredMesh(
        np.concatenate([one.positions for one in meshes]),
        np.concatenate([one.normals for one in meshes]),
        np.concatenate([one.colors for one in meshes]),
        np.concatenate([one.faces + at for one, at in zip(meshes, first, strict=False)]),
    )


def _colored(plant: Plant, part: Part, color: FloatArray) -> ColoredMesh:
    surface, became = part.surface, part.became.ravel()
    area = np.repeat(np.maximum(plant.face_areas[part.faces], np.finfo(float).tiny), 3)
    there, count = became >= 0, len(surface.positions)
    weight = np.bincount(became[there], area[there], count)
    light = np.repeat(color[part.faces], 3, axis=0) * area[:, None]
    total = np.stack([np.bincount(became[there], c[there], count) for c in light.T], axis=1)
    mean = total / np.maximum(weight, np.finfo(float).tiny)[:, None]
    # a corner is a place, and whose attributes it has
    pair = np.stack([surface.faces.ravel(), surface.corners.ravel()], axis=1)
    vertex, index = np.unique(pair, axis=0, return_inverse=True)
    positions = surface.positions[vertex[:, 0]] * (plant.radius or 1.0) + plant.center
    return ColoredMesh(
        positions, plant.normals[vertex[:, 1]], mean[vertex[:, 0]],
        index.reshape(-1, 3).astype(np.int32),
    )  # fmt: skip
