"""Closed pieces drawn through rings of points, and plants of them with normals that break at
creases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.growth.mesh import closed_faces
from vegtool.plant import Material, Plant
from vegtool.srgb import linear_from_srgb


@dataclass(frozen=True, eq=False)
class Piece:
    """Closed and turned outward. positions: (v, 3) metres. faces: (f, 3). material: index."""

    positions: FloatArray
    faces: IntArray
    material: int


def lofted(start: npt.ArrayLike, rings: npt.ArrayLike, end: npt.ArrayLike, material: int) -> Piece:
    """From a point through rings (r, n, 3), which turn counter-clockwise seen from the end, to a
    point: 2 r n triangles."""
    rings = np.asarray(rings, dtype=np.float64)
    points = np.concatenate([[start], rings.reshape(-1, 3), [end]])
    return Piece(points, closed_faces(*rings.shape[:2]), material)


def tube(
    path: npt.ArrayLike,
    radius: npt.ArrayLike,
    columns: int,
    material: int,
    side: npt.ArrayLike = (0.0, 0.0, 1.0),
    flat: float = 1.0,
) -> Piece:
    """Along a path (r + 2, 3) with the radii (r,) at all but its ends. side: a direction across
    the path. flat: radius along it, as a share of that across."""
    path, radius = np.asarray(path, dtype=np.float64), np.asarray(radius, dtype=np.float64)
    along = unit(path[2:] - path[:-2])
    across = unit(np.cross(np.cross(along, side), along))
    other = np.cross(along, across)
    turn = 2 * np.pi * np.arange(columns) / columns
    spoke = flat * np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * other[:, None]
    return lofted(path[0], path[1:-1, None] + radius[:, None, None] * spoke, path[-1], material)


def ellipsoid(
    center: npt.ArrayLike, half: npt.ArrayLike, rings: int, columns: int, material: int
) -> Piece:
    """About a center, with three half axes; its poles are up and down."""
    height = -np.cos(np.pi * np.arange(rings + 2) / (rings + 1))
    path = height[:, None] * np.array([0.0, 1.0, 0.0])
    ball = tube(path, np.sqrt(1 - height[1:-1] ** 2), columns, material)
    return Piece(center + ball.positions * np.asarray(half), ball.faces, material)


def mirrored(piece: Piece) -> Piece:
    """To the other side of the plane z = 0."""
    return Piece(piece.positions * np.array([1.0, 1.0, -1.0]), piece.faces[:, ::-1], piece.material)


def plant_of(name: str, pieces: Sequence[Piece], colors: dict[str, str], crease: float) -> Plant:
    """All pieces, standing on the ground. colors: of the materials, sRGB, by their names. crease:
    degrees between faces from which on normals break."""
    positions, normals, faces, materials = [], [], [], []
    count = 0
    for piece in pieces:
        corner = creased(piece, crease)
        key = np.column_stack([piece.faces.ravel(), np.rint(corner * 1e6).astype(np.int64)])
        _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
        positions.append(piece.positions[piece.faces.ravel()[first]])
        normals.append(corner[first])
        faces.append(count + index.reshape(-1, 3))
        materials.append(np.full(len(piece.faces), piece.material))
        count += len(first)
    points = np.concatenate(positions)
    return Plant(
        name=name,
        positions=points - np.array([0.0, points[:, 1].min(), 0.0]),
        normals=np.concatenate(normals),
        uvs=np.zeros((count, 2)),
        faces=np.concatenate(faces),
        face_material=np.concatenate(materials),
        materials=tuple(
            Material(part, base_color=linear(color), roughness=0.6)
            for part, color in colors.items()
        ),
        source=f"benchmarks/solids, {name}",
    )


def creased(piece: Piece, crease: float) -> FloatArray:
    """(3 f, 3) unit normals of the faces' corners: of the faces about the place, those less than a
    crease away, by their areas."""
    a, b, c = (piece.positions[piece.faces[:, corner]] for corner in range(3))
    area = np.cross(b - a, c - a)
    normal = unit(area)
    place = piece.faces.ravel()
    order = np.argsort(place, kind="stable")
    out = np.empty((len(place), 3))
    for corners in np.split(order, np.flatnonzero(np.diff(place[order])) + 1):
        about = corners // 3
        near = normal[about] @ normal[about].T > np.cos(np.radians(crease))
        out[corners] = unit(near.astype(np.float64) @ area[about])
    return out


def linear(color: str) -> tuple[float, float, float, float]:
    """Of "#rrggbb"."""
    r, g, b = linear_from_srgb(np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]))
    return float(r), float(g), float(b), 1.0
