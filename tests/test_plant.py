"""What comes in: arrays checked when a plant is made, and kept from change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vegtool.arrays import checked, unit
from vegtool.plant import Branches, Material, Plant

TRIANGLE = np.array([[0.0, 0, 0], [3, 0, 0], [0, 4, 0]])


def plant(**changes: Any) -> Plant:
    values: dict[str, Any] = {
        "name": "triangle",
        "positions": TRIANGLE,
        "normals": np.tile([0.0, 0, 1], (3, 1)),
        "uvs": np.zeros((3, 2)),
        "faces": [[0, 1, 2]],
        "face_material": [0],
        "materials": (Material("leaf", role="leaf"),),
    }
    return Plant(**{**values, **changes})


def test_a_triangle_measured() -> None:
    """Legs of 3 and 4: area 6, box 3 x 4, half its diagonal 2.5."""
    made = plant()
    assert made.face_areas.tolist() == [6.0]
    assert made.face_area_vectors.tolist() == [[0, 0, 6]]
    assert made.face_centroids == pytest.approx(np.array([[1, 4 / 3, 0]]))
    assert (made.height, made.radius) == (4.0, 2.5)
    assert made.center.tolist() == [1.5, 2, 0]
    assert made.face_is_leaf.tolist() == [True]


def test_bounds_are_of_the_vertices_that_faces_use() -> None:
    more = np.concatenate([TRIANGLE, [[99.0, 99, 99]]])
    made = plant(positions=more, normals=np.tile([0.0, 0, 1], (4, 1)), uvs=np.zeros((4, 2)))
    assert made.bounds.tolist() == [[0, 0, 0], [3, 4, 0]]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"positions": TRIANGLE[:, :2]}, r"positions: expected shape \(n, 3\), got \(3, 2\)"),
        ({"positions": TRIANGLE * np.nan}, "positions: holds NaN"),
        ({"normals": np.zeros((2, 3))}, r"normals: expected shape \(3, 3\)"),
        ({"faces": [[0, 1, 3]]}, r"faces: indices must lie in 0\.\.2, found 0\.\.3"),
        ({"faces": [[0, 1, -1]]}, r"found -1\.\.1"),
        ({"faces": np.zeros((0, 3))}, "at least one face"),
        ({"face_material": [1]}, r"face_material: indices must lie in 0\.\.0"),
        ({"colors": np.ones((3, 3))}, "colors"),
        ({"branches": Branches([0, 0], [-1], [0], "nodes")}, "one branch per face"),
    ],
)
def test_what_does_not_fit_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        plant(**changes)


def test_a_plants_arrays_cannot_be_changed_and_the_callers_stay_free() -> None:
    mine = TRIANGLE.copy()
    made = plant(positions=mine)
    with pytest.raises(ValueError, match="read-only"):
        made.positions[0] = 1
    mine[0] = 7.0
    assert checked("list", [1, 2], (2,), np.int32).dtype == np.int32


def test_branches_know_their_ancestors() -> None:
    """A trunk, a bough on it, a twig on that; a second trunk."""
    made = Branches([0, 1, 2, 3], [-1, 0, 1, -1], [0, 1, 2, 0], "nodes")
    assert made.ancestor_at(0).tolist() == [0, 0, 0, 3]
    assert made.ancestor_at(1).tolist() == [0, 1, 1, 3]
    assert made.ancestor_at(2).tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("parent", "level"), [([-1, 0], [0, 2]), ([-1, 2], [0, 1]), ([1, 0], [1, 1]), ([-2, 0], [0, 1])]
)
def test_branches_that_contradict_themselves(parent: list[int], level: list[int]) -> None:
    with pytest.raises(ValueError, match=r"Branches\."):
        Branches([0, 1], parent, level, "nodes")


def test_unit_vectors_and_what_has_no_direction() -> None:
    vectors = np.array([[3.0, 0, 4], [0, 0, 0]])
    assert unit(vectors) == pytest.approx(np.array([[0.6, 0, 0.8], [0, 0, 0]]))
