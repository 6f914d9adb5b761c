"""Flat ends of closed stems: found where they are, and no stem is askew for them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from vegtool.branches.parts import connected_parts
from vegtool.plant import Material, Plant
from vegtool.refine.wood_ends import flat_ends
from vegtool.refine.wood_stems import stems_of


def capped(sides: int = 12, fan: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """A cylinder two long and a tenth thick along z; its caps around a middle, or fans."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = 0.05 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    points = np.concatenate([ring - up, ring + up, [-up, up]])
    i = np.arange(sides)
    j = (i + 1) % sides
    walls = [np.stack(c, axis=1) for c in ((i, j, j + sides), (i, j + sides, i + sides))]
    if fan:
        a, b = i[1:-1], j[1:-1]
        ends = [np.stack([0 * a, b, a], axis=1), np.stack([0 * a, a, b], axis=1) + sides]
        points = points[:-2]
    else:
        bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
        ends = [np.stack([bottom, j, i], 1), np.stack([top, i + sides, j + sides], 1)]
    return points, np.concatenate([*walls, *ends])


def plant_of(points: np.ndarray, faces: np.ndarray) -> Plant:
    count = len(points)
    normals = np.tile([0.0, 0.0, 1.0], (count, 1))
    return Plant(
        "stem", points, normals, np.zeros((count, 2)), faces.astype(np.int32),
        np.zeros(len(faces), dtype=np.int32), (Material("bark"),),
    )  # fmt: skip


@pytest.mark.parametrize("fan", [False, True])
@pytest.mark.parametrize("sides", [4, 5, 12])
def test_a_capped_cylinder_is_one_straight_stem(sides: int, fan: bool) -> None:
    points, faces = capped(sides, fan)
    turned = points @ trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3].T + [3, -2, 5]
    plant = plant_of(turned, faces)
    stems = stems_of(plant, np.arange(len(faces), dtype=np.int32))
    assert stems is not None and len(stems) == 1 and not stems.solids
    axis = np.diff(stems.node * stems.radius, axis=0).sum(axis=0)
    assert np.linalg.norm(axis) == pytest.approx(2.0), "from end to end"
    walls = plant.face_areas[: 2 * sides].sum()
    assert stems.area.sum() * stems.radius**2 == pytest.approx(walls)


def test_ends_are_those_of_long_closed_parts() -> None:
    points, faces = capped()
    walls = 24
    assert np.flatnonzero(flat_ends(connected_parts(points, faces))).tolist() == [*range(walls, 48)]
    for name, kept in {"no caps": faces[:walls], "one cap": faces[: walls + 12]}.items():
        assert not flat_ends(connected_parts(points, kept)).any(), name
    assert not flat_ends(connected_parts(points * [1, 1, 0.03], faces)).any(), "a disc"
    ball = trimesh.creation.icosphere(2)
    assert not flat_ends(connected_parts(np.asarray(ball.vertices), np.asarray(ball.faces))).any()
