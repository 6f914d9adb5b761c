"""Pieces of a mesh under construction, and grids of quads, of which all samples are made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Piece:
    """Part of a plant: positions, normals (v, 3), uvs (v, 2), faces (f, 3) int32 of its own
    vertices, face_branch and face_material (f,) int32."""

    positions: FloatArray
    normals: FloatArray
    uvs: FloatArray
    faces: IntArray
    face_branch: IntArray
    face_material: IntArray


def grid_faces(rows: int, columns: int, pointed: bool) -> IntArray:
    """(f, 3) faces of a grid of (rows + 1) x (columns + 1) vertices, row by row.

    Seen with the rows upward and the columns to the right they turn counter-clockwise. A pointed
    grid's last row of vertices lies in one point, so its quads are single triangles.
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    a = row * (columns + 1) + column
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    lower, upper = np.stack([a, b, c], 1), np.stack([a, c, d], 1)
    if pointed:
        last = (rows - 1) * columns
        lower[last:, 2] = d[last:] if columns == 1 else c[last:]
        upper = upper[:last]
    faces = np.empty((len(lower) + len(upper), 3), np.int32)
    faces[0 : 2 * len(upper) : 2], faces[1 : 2 * len(upper) : 2] = lower[: len(upper)], upper
    faces[2 * len(upper) :] = lower[len(upper) :]
    return faces


def grid_triangles(rows: int, columns: int, pointed: bool) -> int:
    """How many faces `grid_faces` gives."""
    return columns * (2 * rows - pointed)


def closed_faces(rings: int, columns: int) -> IntArray:
    """(2 rings columns, 3) faces: a fan below, a grid that closes on itself, a fan above.

    Of a point, rings of vertices, and a point, in this order; seen from above, rings turn
    counter-clockwise, and the faces look outward.
    """
    grid = grid_faces(rings - 1, columns, pointed=False)
    ring, column = np.divmod(grid, columns + 1)
    grid = 1 + ring * columns + column % columns
    around = np.arange(columns)
    after = (around + 1) % columns
    top = 1 + rings * columns
    below = np.stack([np.zeros(columns, np.int64), 1 + after, 1 + around], axis=1)
    last = 1 + (rings - 1) * columns
    above = np.stack([last + around, last + after, np.full(columns, top)], axis=1)
    return np.concatenate([below, grid, above]).astype(np.int32)


def pile(faces: IntArray, vertices: int, copies: int) -> IntArray:
    """(copies * f, 3): the same faces for `copies` grids of that many vertices each."""
    offset = np.arange(copies, dtype=np.int32)[:, None, None] * vertices
    return np.asarray((faces[None] + offset).reshape(-1, 3).astype(np.int32))


def join(pieces: Sequence[Piece]) -> Piece:
    """All pieces as one, faces sorted by branch (stable), vertices in the order of first use."""
    starts = np.cumsum([0, *(len(p.positions) for p in pieces)])
    faces = np.concatenate([p.faces + start for p, start in zip(pieces, starts[:-1], strict=True)])
    face_branch = np.concatenate([p.face_branch for p in pieces])
    order = np.argsort(face_branch, kind="stable")
    faces = faces[order]
    used, first = np.unique(faces.ravel(), return_index=True)
    vertices = used[np.argsort(first, kind="stable")]
    number = np.empty(starts[-1], np.int32)
    number[vertices] = np.arange(len(vertices), dtype=np.int32)
    return Piece(
        np.concatenate([p.positions for p in pieces])[vertices],
        np.concatenate([p.normals for p in pieces])[vertices],
        np.concatenate([p.uvs for p in pieces])[vertices],
        number[faces],
        face_branch[order],
        np.concatenate([p.face_material for p in pieces])[order],
    )
