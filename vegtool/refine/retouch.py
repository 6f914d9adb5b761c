"""Each picture of a level and each triangle of its mesh changed by itself: how bright it is, and
which way its normals look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.baking.coverage import owners
from vegtool.baking.options import BakeOptions
from vegtool.lod import Atlas, Billboards, Level
from vegtool.plant import Plant
from vegtool.refine.color import factor_table

GUTTER = BakeOptions().gutter


def elements_of(level: Level) -> IntArray:
    """(t,) of each triangle that a client draws: its picture, or its triangle of the mesh after
    all pictures."""
    if level.atlas is None:
        assert level.mesh is not None
        return np.arange(len(level.mesh.faces), dtype=np.int32)
    count = len(level.atlas.front)
    quads = np.tile(np.repeat(np.arange(count), 2), 1 if level.double_sided else 2)
    mesh: list[IntArray] = []
    if level.mesh is not None:
        for index in np.unique(level.mesh.face_material):
            own = np.flatnonzero(level.mesh.face_material == index).astype(np.int32)
            twice = level.mesh.materials[index].double_sided and not level.double_sided
            mesh += [own, own[::-1]] if twice else [own]  # as `level_triangles` has them
    return np.concatenate([quads, *(count + own for own in mesh)]).astype(np.int32)


def retouched(level: Level, gain: FloatArray, turn: FloatArray) -> Level:
    """The level with linear colours times a gain (e,), and with normals turned about axes (e, 3) in
    space by as many radians as these are long; elements as of `elements_of`.

    A vertex of the mesh takes the mean of its triangles; a mesh without colours of its own keeps
    them. No channel gets brighter than 1.
    """
    count = 0
    if level.atlas is not None and level.billboards is not None:
        count = len(level.atlas.front)
        atlas = _pictures(level.atlas, level.billboards, gain[:count], turn[:count])
        level = replace(level, atlas=atlas)
    if level.mesh is not None:
        level = replace(level, mesh=_mesh(level.mesh, gain[count:], turn[count:]))
    return level


def _pictures(atlas: Atlas, billboards: Billboards, gain: FloatArray, turn: FloatArray) -> Atlas:
    color = atlas.color.copy()
    normal = None if atlas.normal is None else atlas.normal.copy()
    sides = [(atlas.front, 1.0)]
    if not np.array_equal(atlas.front, atlas.back):
        sides.insert(0, (atlas.back, -1.0))  # of a picture for both sides, the front's counts
    rects = np.concatenate([rect for rect, _ in sides])
    grown = rects + np.array([-GUTTER, -GUTTER, 2 * GUTTER, 2 * GUTTER], np.int32)
    owner = owners(color.shape[:2], grown)
    for number, (x, y, w, h) in enumerate(grown.tolist()):
        which, side = number % len(gain), sides[number // len(gain)][1]
        part = np.s_[y : y + h, x : x + w]
        own = owner[part] == number
        color[part][own, :3] = factor_table(float(gain[which]))[color[part][own, :3]]
        if normal is not None and turn[which].any():
            frame = np.stack(
                [billboards.u[which], billboards.v[which], side * billboards.normal[which]]
            )
            values = (normal[part][own] / 127.5 - 1.0) @ frame
            turned = (values @ rotation(turn[which]).T) @ frame.T
            normal[part][own] = normal_bytes(turned)
    return replace(atlas, color=color, normal=normal)


def _mesh(mesh: Plant, gain: FloatArray, turn: FloatArray) -> Plant:
    corners = mesh.faces.ravel()
    times = np.maximum(np.bincount(corners, minlength=len(mesh.positions)), 1)

    def mean(values: FloatArray) -> FloatArray:
        """(v,) of the triangles of each vertex."""
        return np.asarray(np.bincount(corners, np.repeat(values, 3), len(times)) / times)

    axis = np.stack([mean(column) for column in turn.T], axis=1)
    mesh = replace(mesh, normals=rotated(mesh.normals, axis))
    if mesh.colors is None:
        return mesh
    colors = mesh.colors.copy()
    colors[:, :3] = np.clip(colors[:, :3] * (1 + mean(gain - 1))[:, None], 0.0, 1.0)
    return replace(mesh, colors=colors)


def rotated(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    """(n, 3) vectors turned about axes (n, 3) by as many radians as these are long.

    Rodrigues' formula (1840).
    """
    angle = np.linalg.norm(axes, axis=1, keepdims=True)
    axis = unit(axes)
    along = (axis * vectors).sum(axis=1, keepdims=True) * axis
    across = np.cross(axis, vectors)
    return np.asarray(along + np.cos(angle) * (vectors - along) + np.sin(angle) * across)


def rotation(axis: FloatArray) -> FloatArray:
    """(3, 3) the matrix that turns columns so."""
    return rotated(np.eye(3), np.repeat(axis[None], 3, axis=0)).T


def normal_bytes(normal: FloatArray) -> np.ndarray:
    """(..., 3) uint8 of normals, made unit."""
    return np.asarray(np.floor(unit(normal) * 127.5 + 128.001).clip(0, 255).astype(np.uint8))
