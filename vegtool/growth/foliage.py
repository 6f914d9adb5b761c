"""Leaves: cards that show a drawn twig or leaf, and blades of real geometry."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.growth.mesh import Piece, grid_faces, pile
from vegtool.growth.species import Foliage
from vegtool.growth.stems import (
    UP,
    Stems,
    above_ground,
    across,
    aim,
    envelope_at,
    lay_out,
    level_side,
)
from vegtool.growth.textures import CELL_MARGIN, CELLS

LARGEST = 4.0  # times its reference size: at a very low detail a crown is allowed to thin out


def foliage(
    kind: Foliage,
    stems: Stems,
    count: int,
    enlarged: float,
    segments: int,
    branch: IntArray,
    material: int,
    rng: np.random.Generator,
) -> Piece:
    """`count` leaves on the stems of one level.

    enlarged: how many leaves of the reference each one stands for. branch: (n,) branch index of
    every stem. material: index of the leaves' material.
    """
    stem, along = lay_out(count, stems.length, kind.along, rng)
    origin, direction, side = stems.at(stem, along)
    low, high = kind.along
    share = (along - low) / max(high - low, 1e-9)
    heading = aim(
        direction,
        side,
        share,
        kind.down_angle,
        kind.down_variation,
        kind.rows,
        kind.row_variation,
        rng,
    )
    size = 1 + kind.length_variation * rng.uniform(-1, 1, count)
    size *= envelope_at(kind.envelope, share)
    length, width = kind.length * size, kind.width * size
    if kind.pointed:
        width = width * min(enlarged, LARGEST)
    else:
        grow = min(np.sqrt(enlarged), LARGEST)
        length, width = length * grow, width * grow
    roll = np.radians(rng.normal(0, kind.roll_variation, count))[:, None]
    level = level_side(heading)
    leaf_side = np.cos(roll) * level + np.sin(roll) * np.cross(level, heading)
    droop = np.radians(kind.droop * rng.uniform(0.5, 1.5, count))
    rows = segments + 1
    center, tangent = _bend(origin, heading, length, droop, segments)
    across_row = across(np.repeat(leaf_side[:, None], rows, 1), tangent)
    half = np.repeat(width[:, None] / 2, rows, 1)
    if kind.pointed:
        half *= np.maximum(1 - np.linspace(0, 1, rows) ** 2, 0)
    normals = np.cross(across_row, tangent)
    edge = half[..., None] * across_row
    positions = np.stack([center - edge, center + edge], axis=2)
    positions[..., 1] -= np.minimum(positions[..., 1].min(axis=(1, 2), keepdims=True), 0)
    faces = grid_faces(segments, 1, kind.pointed)
    return Piece(
        positions.reshape(-1, 3),
        np.repeat(normals.reshape(-1, 3), 2, axis=0),
        _cells(count, rows, rng),
        pile(faces, 2 * rows, count),
        np.repeat(branch[stem], len(faces)).astype(np.int32),
        np.full(count * len(faces), material, np.int32),
    )


def _bend(
    origin: FloatArray, heading: FloatArray, length: FloatArray, droop: FloatArray, segments: int
) -> tuple[FloatArray, FloatArray]:
    """Points and tangents (n, segments + 1, 3) of leaves that sink towards the ground."""
    n = len(origin)
    points, tangents = np.empty((n, segments + 1, 3)), np.empty((n, segments + 1, 3))
    points[:, 0], tangent = origin, heading
    # A pointed look needs at least two segments to bend; a flat card turns by half of its droop.
    for step in range(segments):
        down = across(np.broadcast_to(-UP, tangent.shape), tangent)
        share = droop[:, None] / segments * (0.5 if step == 0 else 1.0)
        tangents[:, step] = tangent
        tangent = np.cos(share) * tangent + np.sin(share) * down
        tangent = above_ground(tangent, points[:, step], length / segments)
        points[:, step + 1] = points[:, step] + tangent * (length / segments)[:, None]
    tangents[:, segments] = tangent
    return points, tangents


def _cells(count: int, rows: int, rng: np.random.Generator) -> FloatArray:
    """(count * rows * 2, 2) UVs: a random one of the texture's drawings, root at its foot."""
    cell = rng.integers(0, CELLS * CELLS, count)
    corner = np.stack([cell % CELLS, cell // CELLS], axis=1)[:, None, None]
    flip = rng.integers(0, 2, count)[:, None]
    u = np.broadcast_to(np.array([[0.0, 1.0]]), (count, 2))
    u = np.where(flip, 1 - u, u)
    inside = np.empty((count, rows, 2, 2))
    inside[..., 0] = u[:, None]
    inside[..., 1] = (1 - np.linspace(0, 1, rows))[None, :, None]
    inside = CELL_MARGIN + (1 - 2 * CELL_MARGIN) * inside
    return np.asarray(((corner + inside) / CELLS).reshape(-1, 2))
