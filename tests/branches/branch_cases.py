"""Plants small enough to reason about, and the benchmark's truth, variants and measure."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np

from vegtool.plant import Material, Plant

WOOD, LEAF = Material("bark", role="wood"), Material("leaf", role="leaf")


def benchmark() -> ModuleType:
    """benchmarks/branches.py."""
    path = Path(__file__).parents[2] / "benchmarks" / "branches.py"
    sys.path.append(str(path.parent))  # it imports what benchmarks share
    spec = spec_from_file_location("benchmarks_branches", path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def tube(
    start: tuple[float, ...],
    end: tuple[float, ...],
    radius: tuple[float, float] = (0.1, 0.05),
    rings: int = 4,
    sides: int = 6,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a tapered tube, open at both ends, with a seam of doubled vertices."""
    a, b = np.array(start, float), np.array(end, float)
    axis = (b - a) / np.linalg.norm(b - a)
    side = np.cross(axis, [0.3, 0.5, 0.8])
    side /= np.linalg.norm(side)
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    circle = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(axis, side)
    t = np.linspace(0, 1, rings)
    size = (radius[0] + (radius[1] - radius[0]) * t)[:, None, None]
    points = (a + t[:, None] * (b - a))[:, None] + size * circle
    quad = np.array([[0, sides + 1, 1], [1, sides + 1, sides + 2]])
    corner = (np.arange(rings - 1)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    return points.reshape(-1, 3), (corner[:, None, None] + quad).reshape(-1, 3)


def card(
    foot: tuple[float, ...], tip: tuple[float, ...], width: float = 0.1
) -> tuple[np.ndarray, np.ndarray]:
    """A leaf card whose first edge has its middle at `foot`."""
    a, b = np.array(foot, float), np.array(tip, float)
    side = np.cross(b - a, [0.2, 0.9, 0.4])
    side *= width / 2 / np.linalg.norm(side)
    return np.array([a - side, a + side, b + side, b - side]), np.array([[0, 1, 2], [0, 2, 3]])


def plant_of(
    wood: list[tuple[np.ndarray, np.ndarray]], leaves: list[tuple[np.ndarray, np.ndarray]]
) -> Plant:
    """A plant of these meshes, one after another."""
    meshes = [*wood, *leaves]
    base = np.cumsum([0] + [len(v) for v, _ in meshes])
    positions = np.concatenate([v for v, _ in meshes])
    faces = np.concatenate([f + n for (_, f), n in zip(meshes, base[:-1], strict=True)])
    material = np.concatenate([np.full(len(f), i >= len(wood)) for i, (_, f) in enumerate(meshes)])
    return Plant(
        name="test",
        positions=positions,
        normals=np.tile([0.0, 1.0, 0.0], (len(positions), 1)),
        uvs=np.zeros((len(positions), 2)),
        faces=faces.astype(np.int32),
        face_material=material.astype(np.int32),
        materials=(WOOD, LEAF),
    )


def small_tree() -> Plant:
    """A trunk, two branches, a twig on the first; a leaf on the twig and one on each branch."""
    return plant_of(
        [
            tube((0, 0, 0), (0, 4, 0), (0.2, 0.1)),
            tube((0, 2, 0), (2, 3, 0), (0.08, 0.02)),
            tube((0, 3, 0), (-2, 4, 0), (0.08, 0.02)),
            tube((1, 2.5, 0), (1.5, 2.5, 1), (0.03, 0.01)),
        ],
        [
            card((1.5, 2.5, 1), (1.6, 2.5, 1.4)),
            card((2, 3, 0), (2.3, 3, 0.2)),
            card((-1, 3.5, 0), (-1, 3.9, 0.1)),
        ],
    )
