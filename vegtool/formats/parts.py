"""What every reader hands to `read.assemble`: a file's content, neither cleaned nor interpreted."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray
from vegtool.errors import InputError
from vegtool.plant import Material

IndexArray = npt.NDArray[np.integer[Any]]
"""Indices of any integer type: files have their own, a Plant has int32."""


MAX_FACES = 30_000_000
"""More than that is a landscape, or an attack by instances."""


def check_face_count(path: Path, count: int) -> None:
    """Refuse more triangles than MAX_FACES, before they are made."""
    if count > MAX_FACES:
        raise InputError(
            f"{path}: expected at most {MAX_FACES} triangles, found {count} or more; read one "
            "plant, not a landscape"
        )


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles that share one material, in the file's own unit and axes.

    positions: (v, 3) float64, may hold NaN. faces: (f, 3) vertex indices, checked to be in range.
    material: index into Parsed.materials. name: of the group, node or mesh, a hint for roles.
    normals: (v, 3), uvs: (v, 2) from the top left corner, colors: (v, 4) linear; None if absent.
    without_normal: (v,) bool, vertices that the file gives none although it gives others one (OBJ).
    point: (v,) index of the file's own point where a reader had to split points into vertices
    (OBJ), so that missing normals are smooth across the seams.
    branch: (f,) or one int for all: index into Declared.parent, -1 where the file does not say.
    """

    positions: FloatArray
    faces: IndexArray
    material: int
    name: str = ""
    normals: FloatArray | None = None
    uvs: FloatArray | None = None
    colors: FloatArray | None = None
    point: IndexArray | None = None
    branch: IndexArray | int = -1
    without_normal: npt.NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        count = len(self.positions)
        shapes = {
            "positions": (self.positions, (count, 3)),
            "faces": (self.faces, (len(self.faces), 3)),
            "normals": (self.normals, (count, 3)),
            "uvs": (self.uvs, (count, 2)),
            "colors": (self.colors, (count, 4)),
            "point": (self.point, (count,)),
            "without_normal": (self.without_normal, (count,)),
        }
        for name, (array, shape) in shapes.items():
            if array is not None and array.shape != shape:
                raise ValueError(f"{name} of shape {array.shape} where {shape} is expected")


@dataclass(frozen=True, eq=False)
class Declared:
    """What a file says of its branches.

    parent: (b,) index of the parent, -1 for a trunk; None where the file names branches only.
    level: (b,) where the file states it, -1 where not; None where parents say it all.
    """

    source: Literal["nodes", "groups", "skeleton", "attribute"]
    parent: IndexArray | None = None
    level: IndexArray | None = None


@dataclass(frozen=True, eq=False)
class Parsed:
    """A file's content. up: the format's upward axis, None where it has no convention."""

    name: str
    parts: list[Part]
    materials: list[Material]
    up: str | None = None
    declared: Declared | None = None
    notes: list[str] = field(default_factory=list)
