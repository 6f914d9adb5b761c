"""Coloured meshes without textures, the opaque part of a level, joined into one plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vegtool.arrays import FloatArray, IntArray, checked
from vegtool.plant import Material, Plant


@dataclass(frozen=True, eq=False)
class ColoredMesh:
    """A mesh of v vertices and t triangles.

    positions: (v, 3) metres. normals: (v, 3) unit. colors: (v, 3) linear. faces: (t, 3) int32.
    """

    positions: FloatArray
    normals: FloatArray
    colors: FloatArray
    faces: IntArray

    def __post_init__(self) -> None:
        name, n = type(self).__name__, len(self.positions)
        for item in ("positions", "normals", "colors"):
            value = checked(f"{name}.{item}", getattr(self, item), (n, 3), np.float64)
            object.__setattr__(self, item, value)
        faces = checked(f"{name}.faces", self.faces, (None, 3), np.int32, n)
        object.__setattr__(self, "faces", faces)


@dataclass(frozen=True, eq=False)
class Scattering:
    """What a mesh's material says of light: unlit, or a share that passes through, (3,) tinted; and
    whether it is drawn from both sides."""

    unlit: bool = False
    transmission: float = 0.0
    tint: FloatArray = field(default_factory=lambda: np.ones(3))
    double_sided: bool = True


def joined(
    parts: Sequence[ColoredMesh | None],
    name: str = "mesh",
    scattering: Sequence[Scattering] = (),
) -> Plant | None:
    """All parts as a plant, as `Level.mesh` wants it; None where no part has a face.

    scattering: of each part, or none. Parts alike in it share an opaque material, and a client
    draws them by one call.
    """
    told = scattering or [Scattering()] * len(parts)
    both = [(p, s) for p, s in zip(parts, told, strict=True) if p is not None and len(p.faces)]
    if not both:
        return None
    some = [part for part, _ in both]
    kinds = [(s.unlit, s.transmission, s.double_sided) for _, s in both]
    first_of = {kind: index for index, kind in reversed(list(enumerate(kinds)))}
    order = sorted(first_of.values())
    number = [order.index(first_of[kind]) for kind in kinds]
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
        np.repeat(number, [len(part.faces) for part in some]).astype(np.int32),
        tuple(
            Material(
                name if len(order) == 1 else f"{name}_{i}",
                double_sided=both[i][1].double_sided,
                unlit=both[i][1].unlit,
                transmission=both[i][1].transmission,
                transmission_tint=both[i][1].tint,
            )
            for i in order
        ),
        np.concatenate([colors, np.ones((len(colors), 1))], axis=1),
    )
