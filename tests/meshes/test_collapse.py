"""Edge collapse: borders, what has become of corners, and attributes that are carried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from surfaces import grid_faces, plant_from

from vegtool.meshes.collapse import Collapsed, carried, edges_collapsed, uncollapsed
from vegtool.meshes.pieces import Surface, all_welded, pieces, welded
from vegtool.plant import Plant


def shell(rows: int = 20, columns: int = 30) -> Plant:
    """A half-open curved sheet on the unit sphere, 2 by 1.2 radians, textured along both: what
    u, v and the normal are at a place is known."""
    down, around = np.mgrid[: rows + 1, : columns + 1]
    u, v = around.ravel() / columns, down.ravel() / rows
    return plant_from(at(u, v), grid_faces(rows, columns), at(u, v), np.stack([u, v], axis=1))


def at(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    a, b = 2 * u - 1, 1.2 * v - 0.6
    return np.stack([np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a)], axis=-1)


def in_metres(plant: Plant, made: Collapsed) -> np.ndarray:
    return made.positions * plant.radius + plant.center


@pytest.mark.parametrize("target", [600, 300, 150])
def test_open_borders_stay_exactly(target: int) -> None:
    """All 100 places at the edge of the sheet are there to the bit, and nowhere else."""
    surface = all_welded(shell())
    made = edges_collapsed(surface, target, 7.0, borders=True)
    u, v = (np.round(np.linspace(0, 1, n), 12) for n in (31, 21))
    edge = np.isin(shell().uvs[:, 0], [0, 1]) | np.isin(shell().uvs[:, 1], [0, 1])
    assert edge.sum() == 2 * (len(u) + len(v)) - 4
    local = (shell().positions - shell().center) / shell().radius
    kept = {tuple(p) for p in made.positions.tolist()}
    assert {tuple(p) for p in local[edge].tolist()} <= kept
    edges = np.sort(np.concatenate([made.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))]))
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 1).sum() == edge.sum()


@pytest.mark.parametrize("target", [600, 300, 150])
def test_attributes_are_those_of_the_place(target: int) -> None:
    """A corner has the texture coordinates and the normal of an original vertex that collapsed
    into it: off by no more than that has moved, which is about an edge of what is left."""
    plant = shell()
    surface = welded(plant, 0)
    made = edges_collapsed(surface, target, 7.0, borders=True)
    left = carried(surface, made)
    assert np.isin(left.corners, surface.corners).all()
    place = in_metres(plant, made)[left.faces]
    uvs, normals = plant.uvs[left.corners], plant.normals[left.corners]
    edge = np.sqrt(2 * 2.4 / len(left.faces))  # metres, of equal triangles on the sheet
    off = np.linalg.norm(at(uvs[..., 0], uvs[..., 1]) - place, axis=-1)
    assert off.max() < 0.7 * edge
    outward = place / np.linalg.norm(place, axis=-1, keepdims=True)
    assert np.degrees(np.arccos((normals * outward).sum(axis=-1).clip(-1, 1))).max() < 60 * edge


def test_corners_at_one_place_of_one_island_have_one_attribute() -> None:
    """No cracks in the texture within an island; across a seam, each side keeps its own."""
    plant = shell()
    right = plant.face_centroids[:, 0] > 0
    count = len(plant.positions)
    two = plant_from(
        np.tile(plant.positions, (2, 1)),
        plant.faces + count * right[:, None],
        np.tile(plant.normals, (2, 1)),
        np.concatenate([plant.uvs, plant.uvs + np.array([2.0, 0.0])]),
    )
    surface = welded(two, 0)
    made = edges_collapsed(surface, 300, 7.0)
    left = carried(surface, made)
    islands, island = pieces(left.corners)
    assert islands == 2
    u = two.uvs[left.corners, 0]
    assert ((u < 1.5).all(axis=1) | (u > 1.5).all(axis=1)).all()
    key = np.stack([left.faces.ravel(), np.repeat(island, 3), left.corners.ravel()], axis=1)
    assert len(np.unique(key, axis=0)) == len(np.unique(key[:, :2], axis=0))


def test_what_has_become_of_corners() -> None:
    """In the order of the triangles that are left; input and its arrays stay as they are."""
    surface = all_welded(shell())
    kept = replace(surface, positions=surface.positions.copy(), faces=surface.faces.copy())
    made = edges_collapsed(surface, 200, 7.0)
    left = uncollapsed(made.vertex)
    assert np.array_equal(np.sort(made.vertex[left]), np.sort(made.faces))
    assert np.array_equal(surface.positions, kept.positions)
    assert np.array_equal(surface.faces, kept.faces)


def test_triangles_without_three_places_are_gone_at_once() -> None:
    """Such ones are no edges of anything; without any others nothing is left."""
    surface = all_welded(shell())
    with_lines = Surface(
        surface.positions,
        np.concatenate([surface.faces[:9, [0, 1, 1]], surface.faces, surface.faces[:9, [2, 2, 2]]]),
        np.concatenate([surface.corners[:9], surface.corners, surface.corners[:9]]),
    )
    one, two = (edges_collapsed(s, 300, 7.0) for s in (surface, with_lines))
    assert np.array_equal(one.faces, two.faces)
    assert np.array_equal(one.positions, two.positions)
    assert np.array_equal(one.vertex, two.vertex[9:-9])
    nothing = edges_collapsed(with_lines.of(np.arange(len(with_lines.faces)) < 9), 4, 7.0)
    assert len(nothing.faces) == len(nothing.positions) == 0
    assert (nothing.vertex == -1).all()
