"""A tile's plants as one group of billboards: one mesh, one material, one draw call.

Colditz, Coconu, Deussen, Hege: Real-time rendering of complex photorealistic landscapes using
hybrid level-of-detail approaches (2005), introduction: "square tiles in the background consisting
of many plant models are represented by combined groups of billboards that can be displayed with a
single rendercall per tile".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray
from vegtool.lod import Triangles
from vegtool.tiles.sheet import BRIGHTEST
from vegtool.tiles.stand import Stand


def merged(
    stand: Stand, part: IntArray, parts: Sequence[Triangles], origin: FloatArray
) -> Triangles:
    """All plants as triangles in metres from `origin`, (3,).

    part: (n,) which of the parts each plant is drawn as. Plants of one part follow each other, in
    the stand's order. Colours are the parts' own times the plants' tints over BRIGHTEST. Raises
    ValueError for a part that is none, and where there are no plants.
    """
    if not len(part) or part.min() < 0 or part.max() >= len(parts):
        raise ValueError("merged: expected plants, and a part for each")
    drawn = [
        _repeated(stand, np.flatnonzero(part == index), parts[index], origin)
        for index in np.unique(part)
    ]
    first = np.cumsum([0, *(len(one.positions) for one in drawn)])
    indices = [one.indices + start for one, start in zip(drawn, first, strict=False)]

    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(one, name) for one in drawn])

    return Triangles(
        joined("positions"), joined("normals"), joined("tangents"), joined("uvs"),
        np.concatenate(indices).astype(np.int32), joined("colors"),
    )  # fmt: skip


def vertex_plants(part: IntArray, parts: Sequence[Triangles]) -> npt.NDArray[np.int64]:
    """(v,) which plant, of those of a stand, each vertex of `merged` is of."""
    return np.concatenate(
        [
            np.repeat(np.flatnonzero(part == index), len(parts[index].positions))
            for index in np.unique(part)
        ]
    )


def _repeated(stand: Stand, which: np.ndarray, part: Triangles, origin: FloatArray) -> Triangles:
    """One part, once for each of these plants."""
    count, size = len(which), len(part.positions)
    turn = stand.yaw[which]
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]

    def turned(vectors: FloatArray) -> FloatArray:
        x, y, z = vectors.T
        flat = np.broadcast_to(y, (count, size))
        return np.stack([cos * x + sin * z, flat, cos * z - sin * x], axis=-1)

    place = (stand.foot[which] - origin)[:, None]
    positions = stand.scale[which, None, None] * turned(part.positions) + place
    tangent = np.empty((count, size, 4))
    tangent[..., :3], tangent[..., 3] = turned(part.tangents[:, :3]), part.tangents[:, 3]
    own = np.ones((size, 4)) if part.colors is None else part.colors
    colors = np.broadcast_to(own, (count, size, 4)).copy()
    colors[..., :3] *= np.minimum(stand.tint[which, None] / BRIGHTEST, 1.0)
    start = size * np.arange(count, dtype=np.int32)[:, None]
    return Triangles(
        positions.reshape(-1, 3),
        turned(part.normals).reshape(-1, 3),
        tangent.reshape(-1, 4),
        np.tile(part.uvs, (count, 1)),
        (start + part.indices).ravel(),
        colors.reshape(-1, 4),
    )
