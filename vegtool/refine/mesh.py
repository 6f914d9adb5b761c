"""Coloured meshes without textures, the opaque part of a level, joined into one plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.plant import Material, Plant


@dataclass(frozen=True, eq=False)
class ColoredMesh:
    """A mesh of v vertices and t triangles, to be drawn from both sides.

    positions: (v, 3) metres. normals: (v, 3) unit. colors: (v, 3) linear. faces: (t, 3) int32.
    """

    positions: FloatArray
    normals: FloatArray
    colors: FloatArray
    faces: IntArray

    def __post_init__(self) -> None:
        name, n = type(self).__name__, len(self.positions)
        for field in ("positions", "normals", "colors"):
            value = checked(f"{name}.{field}", getattr(self, field), (n, 3), np.float64)
            object.__setattr__(self, field, value)
        faces = checked(f"{name}.faces", self.faces, (None, 3), np.int32, n)
        object.__setattr__(self, "faces", faces)


def joined(parts: Sequence[ColoredMesh | None], name: str = "mesh") -> Plant | None:
    """All parts as a plant with one opaque, double-sided material, as `Level.mesh` wants it; None
    where no part has a face."""
    some = [part for part in parts if part is not None and len(part.faces)]
    if not some:
        return None
    before = np.cumsum([0, *(len(part.positions) for part in some[:-1])])
    positions = np.concatenate([part.positions for part in some])
    colors = np.concatenate([part.colors for part in some])
    faces = np.concatenate([p.faces + b for p, b in zip(some, before, strict=True)])
    return Plant(
        name,
        positions,
        np.concatenate([part.normals for part in some]),
        np.zeros((len(positions), 2)),
        faces.astype(np.int32),
        np.zeros(len(faces), dtype=np.int32),
        (Material(name, double_sided=True),),
        np.concatenate([colors, np.ones((len(colors), 1))], axis=1),
    )
