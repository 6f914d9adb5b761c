"""Plants whose reductions are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vegtool.plant import Material, Plant

Array = npt.NDArray[np.float64]


def plant_from(
    positions: npt.ArrayLike,
    faces: npt.ArrayLike,
    normals: npt.ArrayLike | None = None,
    uvs: npt.ArrayLike | None = None,
    face_material: npt.ArrayLike | None = None,
    materials: Sequence[Material] = (Material("bark"),),
) -> Plant:
    """A plant with normals up and uvs 0 where none are given."""
    n, f = len(np.asarray(positions)), len(np.asarray(faces))
    return Plant(
        "test",
        np.asarray(positions, float),
        np.tile([0.0, 1.0, 0.0], (n, 1)) if normals is None else np.asarray(normals, float),
        np.zeros((n, 2)) if uvs is None else np.asarray(uvs, float),
        np.asarray(faces, np.int32),
        np.zeros(f, np.int32) if face_material is None else np.asarray(face_material, np.int32),
        tuple(materials),
    )


def grid_faces(rows: int, columns: int) -> npt.NDArray[np.int32]:
    """(2 rows columns, 3): the quads of a grid of (rows + 1) x (columns + 1) vertices, halved."""
    row, column = (a.ravel() for a in np.mgrid[:rows, :columns])
    a = row * (columns + 1) + column
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    return np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)


def sphere(rows: int = 24, columns: int = 48, material: Material | None = None) -> Plant:
    """The unit sphere, u around and v down, with a seam where u is 0 and 1."""
    down, around = np.mgrid[: rows + 1, : columns + 1]
    theta, phi = np.pi * down.ravel() / rows, 2 * np.pi * around.ravel() / columns
    points = np.stack(
        [np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=1
    )
    uvs = np.stack([around.ravel() / columns, down.ravel() / rows], axis=1)
    faces = grid_faces(rows, columns)[:, ::-1]
    return plant_from(points, faces, points, uvs, materials=[material or Material("bark")])


def tube(foot: npt.ArrayLike, radius: float, height: float, sides: int, rings: int) -> Plant:
    """An open upright tube."""
    up, around = np.mgrid[: rings + 1, : sides + 1]
    phi = 2 * np.pi * (around.ravel() % sides) / sides
    out = np.stack([np.sin(phi), np.zeros_like(phi), np.cos(phi)], axis=1)
    points = radius * out + np.asarray(foot, float)
    points[:, 1] += height * up.ravel() / rings
    uvs = np.stack([around.ravel() / sides, up.ravel() / rings], axis=1)
    return plant_from(points, grid_faces(rings, sides), out, uvs)


def cards(count: int, size: float = 0.02, seed: int = 0) -> Plant:
    """Square leaves of two triangles in a unit cube, side `size`, turned about y."""
    rng = np.random.default_rng(seed)
    middle, turn = rng.random((count, 3)), rng.random(count) * np.pi
    u = np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1) * size / 2
    v = np.array([0.0, size / 2, 0.0])
    corners = np.stack([middle - u - v, middle + u - v, middle + u + v, middle - u + v], axis=1)
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    faces = (4 * np.arange(count)[:, None, None] + quad).reshape(-1, 3)
    uvs = np.tile([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]], (count, 1))
    leaf = Material("leaf", role="leaf", double_sided=True)
    return plant_from(corners.reshape(-1, 3), faces, uvs=uvs, materials=[leaf])


def together(*plants: Plant) -> Plant:
    """One plant of several, each with its own material."""
    vertices = np.cumsum([0, *(len(p.positions) for p in plants)])
    return plant_from(
        np.concatenate([p.positions for p in plants]),
        np.concatenate([p.faces + n for p, n in zip(plants, vertices[:-1], strict=True)]),
        np.concatenate([p.normals for p in plants]),
        np.concatenate([p.uvs for p in plants]),
        np.concatenate([np.full(len(p.faces), i) for i, p in enumerate(plants)]),
        [replace(p.materials[0], name=f"{i}") for i, p in enumerate(plants)],
    )
