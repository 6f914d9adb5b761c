"""Wood of known shape: tubes, boards, balls."""

from __future__ import annotations

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.plant import Material, Plant

Part = tuple[FloatArray, np.ndarray]
"""positions (v, 3), faces (f, 3)."""


def tube(path: FloatArray, radius: FloatArray, sides: int = 12) -> Part:
    """A round tube along a path (n, 3) in the x-y plane, with radii (n,), open at both ends."""
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    across = np.cross(tangent, [0.0, 0.0, 1.0])
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * [0.0, 0.0, 1.0]
    positions = path[:, None] + radius[:, None, None] * ring
    i = np.arange(len(path) - 1)[:, None] * sides
    j = np.arange(sides)
    a, b = i + j, i + (j + 1) % sides
    faces = np.stack([a, b, b + sides, a, b + sides, a + sides], axis=-1)
    return positions.reshape(-1, 3), faces.reshape(-1, 3)


def straight(a: FloatArray, b: FloatArray, radius: float, rings: int = 6, sides: int = 12) -> Part:
    """A straight tube from a to b, tapering to a third, open at both ends."""
    length = float(np.linalg.norm(np.subtract(b, a)))
    along = np.linspace(0, 1, rings)
    upright = np.stack([0 * along, along * length, 0 * along], axis=1)
    positions, faces = tube(upright, radius * (1 - along * 2 / 3), sides)
    axis = np.subtract(b, a) / length
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    return positions @ np.stack([u, axis, np.cross(u, axis)]) + a, faces


def wood(*parts: Part, double_sided: bool = False, color: FloatArray | None = None) -> Plant:
    """A plant of nothing but these parts, grey, or of one colour (3,) or (v, 3)."""
    first = np.cumsum([0, *(len(positions) for positions, _ in parts)])
    positions = np.concatenate([p for p, _ in parts])
    colors = np.ones((len(positions), 4))
    colors[:, :3] = 0.5 if color is None else color
    faces = np.concatenate([f + n for (_, f), n in zip(parts, first[:-1], strict=True)])
    return Plant(
        name="wood",
        positions=positions,
        normals=np.tile([0.0, 1.0, 0.0], (len(positions), 1)),
        uvs=np.zeros((len(positions), 2)),
        faces=faces.astype(np.int32),
        face_material=np.zeros(len(faces), np.int32),
        materials=(Material("bark", role="wood", double_sided=double_sided),),
        colors=colors,
    )


def all_of(plant: Plant) -> np.ndarray:
    """Indices of all of its faces."""
    return np.arange(len(plant.faces), dtype=np.int32)


def tree(twigs: int = 40) -> Plant:
    """A bent trunk with twigs that start on its axis."""
    height = np.linspace(0, 10, 16)
    path = np.stack([0.6 * np.sin(height / 2), height, 0 * height], axis=1)
    generator = np.random.default_rng(1)
    parts = [tube(path, 0.5 - 0.04 * height)]
    for _ in range(twigs):
        at = path[generator.integers(3, 15)]
        out = generator.normal(size=3)
        parts.append(straight(at, at + 2 * out / np.linalg.norm(out), 0.06, sides=6))
    return wood(*parts)
