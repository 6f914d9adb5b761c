"""Wood: every stem a tube of rings along its curve, closed in a point at its tip."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.growth.mesh import Piece, grid_faces, pile
from vegtool.growth.stems import Stems

ROOTS = 5  # lobes of a flared trunk


def tubes(
    stems: Stems,
    chosen: IntArray,
    sides: IntArray,
    segments: IntArray,
    branch: IntArray,
    tile: float,
    flare: float = 0.0,
) -> Iterator[Piece]:
    """The tubes of the `chosen` (m,) stems with that many sides and segments (m,), as pieces.

    branch: (m,) index of each tube's branch. tile: metres of bark per repeat of its texture.
    """
    for kind in np.unique(sides * 65536 + segments):
        same = np.flatnonzero(sides * 65536 + segments == kind)
        yield _alike(
            stems,
            chosen[same],
            int(kind) // 65536,
            int(kind) % 65536,
            branch[same],
            tile,
            flare,
        )


def _alike(
    stems: Stems,
    chosen: IntArray,
    sides: int,
    segments: int,
    branch: IntArray,
    tile: float,
    flare: float,
) -> Piece:
    n, rings, columns = len(chosen), segments + 1, sides + 1
    t = np.linspace(0, 1, rings) ** (1.4 if flare else 1.0)  # a flare needs its rings low down
    stem = np.repeat(chosen, rings)
    center, direction, side = stems.at(stem, np.tile(t, n))
    upward = np.cross(side, direction)
    radius = stems.radius_at(stem, np.tile(t, n)).reshape(n, rings)
    radius[:, -1] = 0.0
    # From side towards the downward direction, so that columns run to the right seen from outside.
    angle = np.linspace(0, 2 * np.pi, columns)
    outward = (
        np.cos(angle)[:, None] * side[:, None] - np.sin(angle)[:, None] * upward[:, None]
    ).reshape(n, rings, columns, 3)
    outward[:, :, -1] = outward[:, :, 0]
    wide = np.broadcast_to(radius[:, :, None], (n, rings, columns))
    if flare:
        height = t[None, :, None] * (stems.length[chosen] / stems.radius[chosen])[:, None, None]
        lobes = 1.0 + 0.45 * np.cos(ROOTS * angle)[None, None]
        wide = wide * (1.0 + flare * lobes * np.exp(-0.7 * height))
    positions = center.reshape(n, rings, 1, 3) + wide[..., None] * outward
    faces = grid_faces(segments, sides, pointed=True)
    repeats = np.maximum(1, np.rint(2 * np.pi * stems.radius[chosen] / tile))
    along = stems.length[chosen] * repeats / (2 * np.pi * stems.radius[chosen])
    uvs = np.empty((n, rings, columns, 2))
    uvs[..., 0] = repeats[:, None, None] * (angle / (2 * np.pi))[None, None]
    uvs[..., 1] = -along[:, None, None] * t[None, :, None]
    return Piece(
        positions.reshape(-1, 3),
        _normals(outward, radius, stems.length[chosen], direction.reshape(n, rings, 3)),
        uvs.reshape(-1, 2),
        pile(faces, rings * columns, n),
        np.repeat(branch, len(faces)).astype(np.int32),
        np.zeros(n * len(faces), np.int32),
    )


def _normals(
    outward: FloatArray, radius: FloatArray, length: FloatArray, direction: FloatArray
) -> FloatArray:
    """(v, 3): outward, tilted towards the tip as the tube tapers."""
    slope = (radius[:, 0] - radius[:, -2]) / length
    tilted = outward + slope[:, None, None, None] * direction[:, :, None]
    return unit(tilted.reshape(-1, 3))
