"""Point sets and plants that the tests of the boxes share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from vegtool.arrays import FloatArray, IntArray
from vegtool.plant import Material, Plant


def plant_of(corners: FloatArray, double_sided: bool = True) -> Plant:
    """A plant from (f, 3, 3) corners, as a triangle soup of leaves."""
    n = 3 * len(corners)
    return Plant(
        name="test",
        positions=np.asarray(corners, dtype=np.float64).reshape(-1, 3),
        normals=np.tile([0.0, 1.0, 0.0], (n, 1)),
        uvs=np.zeros((n, 2)),
        faces=np.arange(n, dtype=np.int32).reshape(-1, 3),
        face_material=np.zeros(len(corners), dtype=np.int32),
        materials=(Material("leaf", role="leaf", double_sided=double_sided),),
    )


def card(center: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """The two triangles (2, 3, 3) of a rectangle with half sides u, v."""
    a, b, c, d = center - u - v, center + u - v, center + u + v, center - u + v
    return np.array([[a, b, c], [a, c, d]])


def box_points(half: tuple[float, float, float], inside: int = 200, seed: int = 0) -> FloatArray:
    """The corners of a box about the origin, and points within."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    within = np.random.default_rng(seed).uniform(-1, 1, (inside, 3))
    return np.concatenate([signs, within]) * half


def some_rotation(seed: int = 3) -> FloatArray:
    """A rotation matrix (3, 3), no axis of which is close to one of the world's."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def one(points: FloatArray) -> IntArray:
    """Labels that put all the points in cluster 0."""
    return np.zeros(len(points), dtype=np.int32)


def real_plant(name: str) -> Plant:
    """A plant from the folder of real models, or a skipped test."""
    here = Path(__file__).resolve().parents[3] / "shared" / "models"
    path = Path(os.environ.get("VEGTOOL_MODELS", here)) / name / f"{name}.glb"
    if not path.exists():
        pytest.skip(f"needs the real plants (VEGTOOL_MODELS); {path} is not there")
    from vegtool.formats import read_plant

    return read_plant(path)
