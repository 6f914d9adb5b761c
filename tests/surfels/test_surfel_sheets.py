"""Sheets: which triangles hang together, and what is held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from surfel_cases import ball, both, hills, surface

from vegtool.meshes.pieces import pieces
from vegtool.plant import Plant
from vegtool.surfels.sheets import pairs_of, sheets


def held_places(plant: Plant) -> set[tuple[float, ...]]:
    made = sheets(plant)
    return {tuple(p) for p in plant.positions[plant.faces][made.held[made.faces]].tolist()}


def test_borders_are_held_and_nothing_else() -> None:
    plant = hills(10)
    edge = np.isin(plant.positions[:, [0, 2]], [0, 1]).any(axis=1)
    assert held_places(plant) == {tuple(p) for p in plant.positions[edge].tolist()}
    assert not sheets(ball(2)).held.any()


def test_seams_are_no_borders() -> None:
    """Each triangle with vertices of its own: the same sheet, as they have places in common."""
    plant = ball(2)
    corners = plant.positions[plant.faces].reshape(-1, 3)
    made = sheets(surface(corners, np.arange(len(corners)).reshape(-1, 3)))
    assert not made.held.any()
    assert len(made.positions) == len(plant.positions)
    assert pieces(made.faces)[0] == 1


def test_vertices_are_divided_where_sheets_touch() -> None:
    """Two balls with a place in common have no vertex in common."""
    one = ball(2, 0.0)
    made = sheets(both(one, ball(2, 0.0, (2, 0, 0))))
    assert pieces(made.faces)[0] == 2
    assert len(made.positions) == 2 * len(one.positions)
    assert not made.held.any()


def test_where_three_meet_all_are_held() -> None:
    """A blade on a meadow's line: the line is held, on the meadow too."""
    meadow = hills(10, 0.0)
    x, _, z = meadow.positions.T
    blade = replace(meadow, positions=np.stack([x, z, np.full(len(x), 0.5)], axis=1))
    held = held_places(both(meadow, blade))
    assert {(float(v), 0.0, 0.5) for v in x[:11]} <= held
    assert (float(x[5]), 0.0, float(z[33])) not in held


def test_a_slit_is_no_seam() -> None:
    """Two halves of a meadow that lie a billionth apart: both borders are held."""
    plant = hills(10)
    corners = plant.corners.copy()
    corners[plant.face_centroids[:, 0] > 0.5, :, 0] += 1e-9
    slit = surface(corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    assert len(held_places(slit)) == 40 + 2 * 9 + 2


def test_backs_of_their_own_are_sheets_of_their_own() -> None:
    """Four triangles at each edge, in pairs by their vertices; the rim, where front and back are
    back to back, is held."""
    front = hills(10)
    made = sheets(both(front, replace(front, faces=front.faces[:, ::-1])))
    assert pieces(made.faces)[0] == 2
    assert made.held.sum() == 2 * 40


@pytest.mark.parametrize("turned", [0, 1])
def test_neighbours_may_wind_otherwise(turned: int) -> None:
    """Some triangles looking down do not tear a meadow."""
    plant = hills(10, 0.0)
    faces = plant.faces.copy()
    faces[turned::3] = faces[turned::3, ::-1]
    made = sheets(replace(plant, faces=faces))
    assert pieces(made.faces)[0] == 1
    assert made.held.sum() == 40


def test_triangles_without_area() -> None:
    """Those with two corners at one place belong to no sheet and hold nothing."""
    plant = hills(10)
    line = plant.faces[[100, 101]].copy()
    line[:, 2] = line[:, 1]
    faces = np.concatenate([line, plant.faces])
    with_lines = replace(plant, faces=faces, face_material=np.zeros(len(faces), np.int32))
    assert np.array_equal(np.flatnonzero(~sheets(with_lines).whole), [0, 1])
    assert held_places(with_lines) == held_places(plant)


def test_texture_makes_seams_and_normals_do_not() -> None:
    plant = surface(np.zeros((4, 3)), [[0, 1, 2]], uvs=[[0, 0], [0, -0.0], [0, 1], [0, 0]])
    plant = replace(plant, normals=np.eye(4, 3), colors=np.array([[1, 1, 1, 1]] * 3 + [[0] * 4]))
    seam = sheets(plant).seam
    assert seam[0] == seam[1]
    assert len(np.unique(seam)) == 3


def test_pairs_are_of_two() -> None:
    """A key once, three times, or twice: only the last."""
    one, other = pairs_of(np.array([5, 7, 7, 0, 5, 7, 9, 0]))
    assert set(zip(one.tolist(), other.tolist(), strict=True)) == {(0, 4), (3, 7)}
