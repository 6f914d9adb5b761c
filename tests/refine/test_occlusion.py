"""Exposure: what lies inside sees less of the sky than what lies outside, on either side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plants import plant_of

from vegtool.arrays import FloatArray, unit
from vegtool.growth import sample
from vegtool.plant import Material, Plant
from vegtool.refine.occlusion import at_vertices, exposed, exposed_like, exposures
from vegtool.seeding import generator

X, Y, Z = np.eye(3)
LEAF = np.array([[[-0.05, 0, 0], [0.05, 0, 0], [0, 0, 0.05]]])


def shells(layers: int) -> Plant:
    """A ball of small square leaves on concentric spheres, evenly spread, all alike."""
    count = 600
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * i * (1 + 5**0.5)
    r = np.sqrt(1 - z * z)
    out = np.stack([r * np.cos(turn), z, r * np.sin(turn)], axis=1)
    across = np.cross(out, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = np.cross(out, across)
    positions, normals = [], []
    for layer in range(1, layers + 1):
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            positions.append(layer / layers * out + 0.06 * (a * across + b * up))
            normals.append(out)
    at = np.stack(positions, 1).reshape(-1, 3)
    first = 4 * np.arange(len(at) // 4, dtype=np.int32)
    faces = (first[:, None] + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return Plant(
        "ball",
        at,
        np.stack(normals, 1).reshape(-1, 3),
        np.zeros((len(at), 2)),
        faces.astype(np.int32),
        np.zeros(len(faces), np.int32),
        (Material("leaf", double_sided=True, role="leaf"),),
    )


def sheet(corner: FloatArray, u: FloatArray, v: FloatArray, cells: int = 8) -> FloatArray:
    """(f, 3, 3) a rectangle in small triangles, whose front looks along u x v."""
    i, j = (axis.ravel()[:, None] / cells for axis in np.meshgrid(*2 * [np.arange(cells)]))
    a = corner + i * u + j * v
    b, c, d = a + u / cells, a + (u + v) / cells, a + v / cells
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def box(walls: int) -> FloatArray:
    """The walls of a box of one metre about the origin, each so many sheets thick."""
    sides = []
    for u, v in ((X, Y), (Y, Z), (Z, X)):
        for w in (np.cross(u, v), -np.cross(u, v)):
            sides += [sheet(w / 2 - (u + v) / 2, u, v)] * walls
    return np.concatenate(sides)


def test_the_inside_is_darker_than_the_outside() -> None:
    """Of the outermost leaves one side sees the sky, the other the ball."""
    ball = shells(4)
    found = exposures(ball)
    distance = np.linalg.norm(ball.face_centroids, axis=1)
    rings = [found[np.abs(distance - r) < 0.1].mean(axis=0) for r in (0.25, 0.5, 0.75, 1.0)]
    assert np.all(np.diff(np.mean(rings, axis=1)) > 0)
    front, back = rings[-1]
    assert front > 0.75 and back < 0.3
    assert found.min() >= 0 and found.max() <= 1


def test_a_face_alone_sees_all_of_the_sky_on_both_sides() -> None:
    ball = shells(1)
    leaf = replace(ball, faces=ball.faces[:2], face_material=ball.face_material[:2])
    np.testing.assert_allclose(exposures(leaf), 1.0)
    np.testing.assert_allclose(exposures(plant_of(LEAF)), 1.0)


@pytest.mark.parametrize("walls", [1, 4])
def test_within_a_closed_box_it_is_as_dark_as_its_walls_are_thick(walls: int) -> None:
    """A turbid medium: each sheet that covers all of its place once lets 1/e pass. What leans to
    the light hides more of it, but is met by less."""
    found = exposures(plant_of(np.concatenate([LEAF, box(walls)])))
    assert found[0] == pytest.approx(np.exp(-walls), abs=0.03)
    assert found[1:].max() > 0.5, "its outside is not dark"


def test_a_floor_sees_the_sky_from_above_and_its_underside_what_floors_below_leave() -> None:
    """Floor by floor, as far as there is more than the light from aside; and as in a mirror from
    below."""
    floors = 6
    plant = plant_of(
        np.concatenate([sheet(0.1 * k * Y - (X + Z) / 2, Z, X) for k in range(floors)])
    )
    above, below = exposures(plant).reshape(floors, -1, 2).mean(axis=1).T
    assert (plant.face_area_vectors[:, 1] > 0).all()
    assert (np.diff(above[1:]) > 0).all() and above[:2].max() < 0.25
    assert above[-1] > 0.7 and below[-1] < 0.3
    np.testing.assert_allclose(above, below[::-1], atol=1e-6)


def test_a_face_turned_round_changes_sides() -> None:
    plant = sample("bush", 600)
    turned = replace(plant, faces=plant.faces[:, ::-1])
    np.testing.assert_allclose(exposures(turned), exposures(plant)[:, ::-1], atol=1e-12)


def test_strength_is_a_share_of_it_and_none_changes_nothing() -> None:
    ball = shells(3)
    assert exposed(ball, 0.0) is ball
    half, full = exposed(ball, 0.5).exposure, exposed(ball, 1.0).exposure
    assert half is not None and full is not None
    np.testing.assert_allclose(half, (1 + full) / 2)
    assert full.shape == (len(ball.positions), 2)
    assert full.min() >= 0 and full.max() <= 1
    assert ball.exposure is None and ball.colors is None
    assert exposed(ball, 1.0).colors is None


def test_it_does_not_matter_where_a_plant_stands_and_how_large_it_is() -> None:
    plant = sample("conifer")
    there = replace(plant, positions=7.0 * plant.positions + [30.0, 2.0, -11.0])
    assert np.allclose(exposures(plant), exposures(there), atol=1e-6)


def test_a_leaf_that_is_mostly_cut_away_hides_little() -> None:
    """All of it is cut away, so that nothing hides anything."""
    clear = Material("leaf", np.array([1, 1, 1, 0.0]), alpha_mode="mask", role="leaf")
    np.testing.assert_allclose(exposures(replace(shells(3), materials=(clear,))), 1.0)


def test_a_vertex_has_the_mean_of_its_faces_by_area_and_all_where_it_has_none() -> None:
    plant = Plant(
        "fan",
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-3, 0, 0], [9, 9, 9]]),
        np.tile(Z, (5, 1)),
        np.zeros((5, 2)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.zeros(2, np.int32),
        (Material("m"),),
    )
    found = at_vertices(plant, np.array([[0.2, 0.4], [0.6, 0.8]]))
    shared = [0.25 * 0.2 + 0.75 * 0.6, 0.25 * 0.4 + 0.75 * 0.8]
    np.testing.assert_allclose(found, [shared, [0.2, 0.4], shared, [0.6, 0.8], [1, 1]])


def test_a_mesh_made_of_a_plant_has_its_exposure_side_for_side() -> None:
    """The ball's own leaves: about what they had; turned round, the other side's."""
    ball = exposed(shells(4), 1.0)
    mesh = replace(ball, exposure=None)
    found = exposed_like(mesh, ball).exposure
    assert found is not None and ball.exposure is not None
    outer = np.linalg.norm(ball.positions, axis=1) > 0.95
    assert np.abs(found - ball.exposure)[outer].mean() < 0.03
    around = exposed_like(replace(mesh, normals=-mesh.normals), ball).exposure
    assert around is not None
    np.testing.assert_allclose(around, found[:, ::-1])
    assert mesh.exposure is None


def test_a_plant_without_exposure_gives_none() -> None:
    ball = shells(1)
    assert exposed_like(ball, ball) is ball


@pytest.mark.parametrize("count", [1, 3])
def test_few_faces_are_enough(count: int) -> None:
    """Fewer than a vertex looks for."""
    random = generator(0, "faces")
    plant = exposed(plant_of(random.normal(size=(count, 3, 3))), 1.0)
    mesh = replace(sample("bush", 300), branches=None)
    found = exposed_like(mesh, plant).exposure
    assert found is not None
    assert np.isfinite(found).all() and found.min() >= 0 and found.max() <= 1


def test_faces_without_area_see_all_and_break_nothing() -> None:
    plant = plant_of(np.concatenate([LEAF, np.zeros((2, 3, 3)), box(1)]))
    found = exposures(plant)
    np.testing.assert_allclose(found[1:3], 1.0)
    mesh = replace(plant, normals=unit(plant.positions + 0.1))
    assert np.isfinite(np.asarray(exposed_like(mesh, exposed(plant, 1.0)).exposure)).all()
