"""The mesh of a hybrid, in the colours of what it stands for.

A vertex has the mean colour of the faces about all original vertices that have become part of it,
as textures show them, and the normal of the nearest of these on its own side of a crease.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.hybrid.greedy import Part
from vegtool.plant import Plant
from vegtool.refine.face_texels import face_colors
from vegtool.refine.mesh import ColoredMesh, joined


@dataclass(frozen=True, eq=False)
class Mesh(ColoredMesh):
    """place: (t, 3) int32, where corners are, whatever their attributes. stands_for: (n,) int32
    faces of the original."""

    place: IntArray
    stands_for: IntArray

    @cached_property
    def plant(self) -> Plant:
        """As a plant."""
        made = joined([self])
        assert made is not None
        return made

    def split(self, group: IntArray) -> Mesh:
        """With vertices that are of one group of faces each, (t,); those of a group that is not -1
        are white."""
        key = np.stack([self.faces.ravel(), np.repeat(group, 3)], axis=1)
        vertex, index = np.unique(key, axis=0, return_inverse=True)
        colors = np.where(vertex[:, 1:] >= 0, 1.0, self.colors[vertex[:, 0]])
        return replace(
            self, positions=self.positions[vertex[:, 0]], normals=self.normals[vertex[:, 0]],
            colors=colors, faces=index.reshape(-1, 3).astype(np.int32),
        )  # fmt: skip


def colored(plant: Plant, parts: Iterable[Part]) -> Mesh | None:
    """All parts as one mesh, in metres; None for none."""
    color = face_colors(plant, np.arange(len(plant.faces), dtype=np.int32))
    meshes = [_colored(plant, part, color) for part in parts if len(part.surface.faces)]
    if not meshes:
        return None
    first = np.cumsum([0, *(len(one.positions) for one in meshes)])
    places = np.cumsum([0, *(int(one.place.max()) + 1 for one in meshes)])
    return Mesh(
        np.concatenate([one.positions for one in meshes]),
        np.concatenate([one.normals for one in meshes]),
        np.concatenate([one.colors for one in meshes]),
        np.concatenate([m.faces + at for m, at in zip(meshes, first, strict=False)]),
        np.concatenate([m.place + at for m, at in zip(meshes, places, strict=False)]),
        np.concatenate([one.stands_for for one in meshes]),
    )


def _colored(plant: Plant, part: Part, color: FloatArray) -> Mesh:
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
    return Mesh(
        positions, plant.normals[vertex[:, 1]], mean[vertex[:, 0]],
        index.reshape(-1, 3).astype(np.int32), surface.faces.astype(np.int32),
        part.faces.astype(np.int32),
    )  # fmt: skip
