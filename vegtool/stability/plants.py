"""Plants and point sets of known form, and the same ones moved, scaled and turned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import cos, sin

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray, unit
from vegtool.plant import Material, Plant
from vegtool.seeding import generator

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
"""(3, 3) metres."""
FAR = np.array([5e6, 300.0, -5e6])
"""Metres: where a map may put a plant."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A plant elsewhere, of another size, or turned. scale: how many times as large it is."""

    name: str
    of: Callable[[FloatArray], FloatArray]
    turn: FloatArray
    scale: float = 1.0
    offset: float = 0.0

    @property
    def turns(self) -> bool:
        """Whether it turns the plant."""
        return not np.array_equal(self.turn, np.eye(3))

    def plant(self, plant: Plant) -> Plant:
        """The plant moved; its normals turn along."""
        positions, normals = self.of(plant.positions), rotated(plant.normals, self.turn)
        return replace(plant, positions=positions, normals=normals)

    def offset_over(self, size: float) -> float:
        """How far from the origin in sizes of `size` metres."""
        return self.offset / size


def rotated(points: FloatArray, turn: FloatArray) -> FloatArray:
    """Points (n, 3) turned by a matrix, equal points staying equal to the bit."""
    return np.asarray(sum(points[:, i : i + 1] * turn[:, i] for i in range(3)))


def rotation(seed: int = 0) -> FloatArray:
    """(3, 3) a rotation by no angle in particular."""
    q, _ = np.linalg.qr(generator(seed, "stability", "rotation").normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q)))


_TURN = rotation()
MOTIONS: tuple[Motion, ...] = (
    Motion("5,000 km away", lambda p: p + FAR, np.eye(3), offset=float(np.linalg.norm(FAR))),
    Motion("1e-6 times the size", lambda p: 1e-6 * p, np.eye(3), scale=1e-6),
    Motion("1e6 times the size", lambda p: 1e6 * p, np.eye(3), scale=1e6),
    Motion("turned", lambda p: rotated(p, _TURN), _TURN),
    Motion(
        "turned and 5,000 km away",
        lambda p: rotated(p, _TURN) + FAR,
        _TURN,
        offset=float(np.linalg.norm(FAR)),
    ),
)


@cache
def tree() -> Plant:
    """A broadleaf tree of 6,000 triangles, from our own generator."""
    from vegtool.growth import sample

    return sample("broadleaf", 6000)


def soup(corners: npt.ArrayLike) -> Plant:
    """A plant of bare triangles (f, 3, 3), metres: leaves without a texture."""
    positions = np.asarray(corners, dtype=np.float64).reshape(-1, 3)
    count = len(positions)
    return Plant(
        "soup",
        positions,
        np.tile([0.0, 1.0, 0.0], (count, 1)),
        np.zeros((count, 2)),
        np.arange(count, dtype=np.int32).reshape(-1, 3),
        np.zeros(count // 3, dtype=np.int32),
        (Material("leaf", role="leaf", double_sided=True),),
    )


def facing(normal: FloatArray, turn: float = 0.0) -> FloatArray:
    """(3, 3) rows: two across a unit vector, turned about it by radians, and itself."""
    across = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin()])[None])[0]
    other = np.cross(normal, across)
    return np.stack(
        [cos(turn) * across + sin(turn) * other, cos(turn) * other - sin(turn) * across, normal]
    )


def facing_out(points: FloatArray, size: float) -> FloatArray:
    """(n, 3, 3) a small triangle at each of the unit vectors (n, 3), across it."""
    across = np.cross(points, np.eye(3)[np.abs(points).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(points, across)
    return np.stack([points, points + size * across, points + size * other], axis=1)


def at(points: FloatArray, size: float = 0.01) -> FloatArray:
    """(n, 3, 3) a small triangle at each of the points (n, 3)."""
    return np.asarray(points[:, None] + size * TRIANGLE)


def cube_points(steps: int) -> FloatArray:
    """(steps^3, 3) a lattice with whole coordinates: equal variances, and ties everywhere."""
    axes = np.meshgrid(*[np.arange(float(steps))] * 3, indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, 3)


def sphere_points(count: int) -> FloatArray:
    """(count, 3) a Fibonacci lattice on the unit sphere."""
    i = np.arange(count) + 0.5
    y = 1 - 2 * i / count
    around = np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(around), y, r * np.sin(around)], axis=1)


def box_faces(half: tuple[float, float, float], even: bool = True) -> FloatArray:
    """(12, 3, 3) the triangles of a box about the origin, with half sides `half` metres.

    even: diagonals that meet in four of the corners, so that the principal axes are the box's.
    """
    faces = []
    for axis in range(3):
        across, one, other = np.roll(np.eye(3), axis, axis=0)
        for side in (-1, 1):
            a, b, c, d = (side * across + s * one + t * other for s, t in SQUARE)
            if even and a.prod() < 0:
                a, b, c, d = b, c, d, a
            faces += [[a, b, c], [a, c, d]]
    return np.array(faces) * half


SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
SLOPE = facing(unit(np.array([[1.0, 2.0, 3.0]]))[0])
"""(3, 3) axes along none of the world's: two of a slope, and its normal."""
