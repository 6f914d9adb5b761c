"""Normals of a level bent as a whole, by two numbers.

lean: a client turns a billboard's normals round with the billboard, where each leaf of the plant
turns to the viewer by itself (Colditz et al. 2005, section 3). Normals that lean far over are lit
as if from behind for whoever looks along the billboard; so they are made to lean less.

height: one normal that stands for those of many leaves is more extreme than most of them. Up and
down light differs most, so a level would be too bright from above and too dark from below; so
normals are made to look up and down less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vegtool.arrays import ByteArray, FloatArray, unit
from vegtool.lod import Atlas, Billboards, Level
from vegtool.refine.retouch import GUTTER, normal_bytes


@dataclass(frozen=True)
class Bend:
    """lean: factor of a normal's part along the plane of its billboard. height: factor of its part
    along y, after that."""

    lean: float = 1.0
    height: float = 1.0


def bent(normal: FloatArray, plane: FloatArray, bend: Bend, on_billboard: np.ndarray) -> FloatArray:
    """(n, 3) unit normals, bent. plane: (n, 3) unit normals of the planes. on_billboard: (n,) bool,
    those that lean."""
    if bend.lean != 1:
        out = (normal * plane).sum(axis=1, keepdims=True) * plane
        leaned = unit(out + bend.lean * (normal - out))
        normal = np.where(on_billboard[:, None], leaned, normal)
    return lowered(normal, bend.height)


def lowered(normal: FloatArray, height: float) -> FloatArray:
    """(n, 3) unit normals whose part along y is times `height`."""
    return normal if height == 1 else unit(normal * np.array([1.0, height, 1.0]))


def bent_level(level: Level, bend: Bend) -> Level:
    """The level with the normals of its atlas and of its mesh bent."""
    if level.mesh is not None:
        normals = lowered(level.mesh.normals, bend.height)
        level = replace(level, mesh=replace(level.mesh, normals=normals))
    if level.atlas is None or level.billboards is None or level.atlas.normal is None:
        return level
    if bend == Bend():
        return level
    normal = _bent_pictures(level.atlas, level.billboards, level.atlas.normal, bend)
    return replace(level, atlas=replace(level.atlas, normal=normal))


def _bent_pictures(
    atlas: Atlas, billboards: Billboards, normal: ByteArray, bend: Bend
) -> ByteArray:
    """(h, w, 3) uint8: each picture's normals bent in space. Gutters, half way to the next picture,
    are the picture's too."""
    values = normal / 127.5 - 1.0
    values[..., :2] *= bend.lean
    done = np.zeros(normal.shape[:2], dtype=bool)
    sides = [(atlas.front, 1.0)]
    if not np.array_equal(atlas.front, atlas.back):
        sides.append((atlas.back, -1.0))
    result = values.copy()
    for rects, side in sides:
        for number, rect in enumerate(rects.tolist()):
            x, y, w, h = rect
            around = np.s_[y - GUTTER : y + h + GUTTER, x - GUTTER : x + w + GUTTER]
            u, v, n = billboards.u[number], billboards.v[number], billboards.normal[number]
            frame = np.stack([u, v, side * n])
            part = values[around].reshape(-1, 3) @ frame
            part = part * np.array([1.0, bend.height, 1.0])
            inner = ~done[around]
            result[around][inner] = (part @ frame.T).reshape(*inner.shape, 3)[inner]
            done[around] = True
    bytes_of = normal_bytes(result)
    if atlas.white is not None:
        x, y, w, h = atlas.white.tolist()
        block = np.s_[y - GUTTER : y + h + GUTTER, x - GUTTER : x + w + GUTTER]
        bytes_of[block] = normal[block]
    return np.asarray(bytes_of)
