"""How much of a piece of surface is seen, averaged over all directions.

Planes are to be spent on what is seen: of a dense crown that is its outside. Light is taken to pass
foliage as a turbid medium (Monsi, Saeki: Über den Lichtfaktor in den Pflanzengesellschaften, 1953):
in a column of space, a piece is seen through those before it with a probability that falls
exponentially with the surface they turn towards the viewer.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vegtool.arrays import FloatArray, unit
from vegtool.plant import Plant
from vegtool.refine.face_texels import opacities
from vegtool.refine.planes_pieces import Pieces, tensor

DIRECTIONS = 24
"""From both ends of each."""
COLUMN = 3.0
"""Side of a column, in sizes of a piece."""
MOST_COLUMNS = 1 << 31
"""Of a row."""


def seen(pieces: Pieces, surface: float, size: float, opacity: float) -> FloatArray:
    """(n,) 0 to 1: the share of directions from which a piece shows, by how much it turns there.

    surface: of all, squared radii; weights are shares of it. size: of a piece, radii. opacity: the
    share of a piece that hides what is behind it.
    """
    total = np.zeros(len(pieces))
    shown = np.zeros(len(pieces))
    for direction, toward, away in transmittances(pieces, surface, size, opacity):
        turned = rms_cosine(pieces, direction)
        total += turned * (toward + away) / 2
        shown += turned
    return np.divide(total, shown, out=np.ones_like(total), where=shown > 0)


def transmittances(
    pieces: Pieces,
    surface: float,
    size: float,
    opacity: float,
    directions: FloatArray | None = None,
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """For each of DIRECTIONS, (3,) unit in the plant's own frame, the shares (n,) and (n,) of light
    that reach pieces from there and from the opposite one; arguments as of `seen`. directions:
    others, (d, 3) unit."""
    for direction in even_directions(DIRECTIONS) if directions is None else directions:
        if size == 0:
            yield direction, np.ones(len(pieces)), np.ones(len(pieces))
            continue
        depth = opacity * surface * pieces.weight * rms_cosine(pieces, direction)
        depth = depth / (COLUMN * size) ** 2
        across = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
        sides = unit(np.stack([across, np.cross(direction, across)]))
        x, y = np.floor(sides @ pieces.middle.T / (COLUMN * size) + 0.5).astype(np.int64)
        column = x * MOST_COLUMNS + y
        order = np.lexsort((pieces.middle @ direction, column))
        through = np.cumsum(depth[order])
        first = np.flatnonzero(np.diff(column[order], prepend=column[order[0]] - 1))
        length = np.diff(first, append=len(order))
        start = np.repeat(through[first] - depth[order[first]], length)
        end = np.repeat(through[first + length - 1], length)
        before, behind = np.empty(len(pieces)), np.empty(len(pieces))
        behind[order] = through - depth[order] - start
        before[order] = end - through
        yield direction, np.exp(-np.maximum(before, 0)), np.exp(-np.maximum(behind, 0))


def rms_cosine(pieces: Pieces, direction: FloatArray) -> FloatArray:
    """(n,) root mean square of the cosines of the pieces' normals to a direction, (3,) unit."""
    return np.asarray(np.sqrt(np.maximum(pieces.looks @ tensor(direction[None])[0], 0.0)))


def even_directions(count: int) -> FloatArray:
    """(count, 3) unit vectors, spread evenly over half a sphere along a golden spiral."""
    i = np.arange(count) + 0.5
    z = 1 - i / count
    turn = np.pi * i * (1 + 5**0.5)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def opacity(plant: Plant) -> float:
    """The share of a plant's surface that its materials do not cut away."""
    area = plant.face_areas
    total = float(area.sum())
    shown = opacities(plant, np.arange(len(area), dtype=np.int32))
    return float(area @ shown) / total if total > 0 else 1.0
