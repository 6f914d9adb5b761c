"""Plants of cards: squares of two triangles, which the tests of what is drawn many times share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import unit
from vegtool.plant import Material, Plant, Texture

LEAF = Material("leaf", role="leaf", double_sided=True)
SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
UVS = np.array([[0.0, 1], [1, 1], [1, 0], [0, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def cards(
    middles: npt.ArrayLike,
    half: npt.ArrayLike = 0.05,
    material: Material = LEAF,
    normals: npt.ArrayLike = (0.0, 0.0, 1.0),
) -> Plant:
    """A square about each of (n, 3) middles, of half a side, facing along its normal."""
    middle = np.asarray(middles, np.float64).reshape(-1, 3)
    count = len(middle)
    facing = unit(np.broadcast_to(np.asarray(normals, np.float64), (count, 3)))
    upwards = np.where(np.abs(facing[:, 1:2]) > 0.9, [0.0, 0, -1], [0.0, 1, 0])
    right = unit(np.cross(upwards, facing))
    up = np.cross(facing, right)
    sizes = np.broadcast_to(np.asarray(half, np.float64), (count,))[:, None, None]
    corners = SQUARE[:, :1] * right[:, None] + SQUARE[:, 1:] * up[:, None]
    return Plant(
        "cards",
        (middle[:, None] + sizes * corners).reshape(-1, 3),
        np.repeat(facing, 4, axis=0),
        np.tile(UVS, (count, 1)),
        (4 * np.arange(count)[:, None, None] + FACES).reshape(-1, 3),
        np.zeros(2 * count, np.int32),
        (material,),
    )


def together(*plants: Plant) -> Plant:
    """Plants as one, each with its own materials; colours and exposure are those of no plant."""
    vertices = np.cumsum([0, *(len(p.positions) for p in plants)])
    materials = np.cumsum([0, *(len(p.materials) for p in plants)])
    return Plant(
        "together",
        np.concatenate([p.positions for p in plants]),
        np.concatenate([p.normals for p in plants]),
        np.concatenate([p.uvs for p in plants]),
        np.concatenate([p.faces + v for p, v in zip(plants, vertices, strict=False)]),
        np.concatenate([p.face_material + m for p, m in zip(plants, materials, strict=False)]),
        tuple(m for p in plants for m in p.materials),
    )


def turned(plant: Plant, yaw: float, scale: float, foot: npt.ArrayLike) -> Plant:
    """A plant turned about y by radians, counter-clockwise from above, scaled and moved."""
    c, s = np.cos(yaw), np.sin(yaw)
    about_y = np.array([[c, 0.0, s], [0, 1, 0], [-s, 0, c]])
    moved = scale * plant.positions @ about_y.T + np.asarray(foot, np.float64)
    return replace(plant, positions=moved, normals=plant.normals @ about_y.T)


def texture(pixels: npt.ArrayLike, name: str = "picture") -> Texture:
    """Of (h, w, 4) bytes."""
    return Texture(name, np.ascontiguousarray(pixels, np.uint8))


def arrays_of(plant: Plant) -> bytes:
    """All that an operation could change."""
    held = [plant.positions, plant.normals, plant.uvs, plant.faces, plant.face_material]
    held += [value for value in (plant.colors, plant.exposure) if value is not None]
    held += [t.pixels for m in plant.materials for t in m.textures]
    return b"".join(value.tobytes() for value in held)
