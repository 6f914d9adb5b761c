"""Normals of leaves bent towards those of an ellipsoid, on crowns that are one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plants import plant_of

from vegtool.arrays import FloatArray, unit
from vegtool.growth import sample
from vegtool.lighting.crown import crown_normals, ellipsoid_normals
from vegtool.plant import Plant
from vegtool.seeding import generator

SIZES = np.array([3.0, 5.0, 2.0])


def shell(count: int = 2000) -> Plant:
    """Leaves all alike on an ellipsoid, spread as over a ball that was stretched to it, so that
    their moments are its own; the front of every second one looks inward."""
    i = np.arange(count) + 0.5
    y, turn = 1 - 2 * i / count, np.pi * i * (1 + 5**0.5)
    r = np.sqrt(1 - y * y)
    ball = np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)
    across = unit(np.cross(ball / SIZES, [0.3, 0.5, 0.8]))
    up = unit(np.cross(ball / SIZES, across))
    up[::2] *= -1
    out = ball * SIZES
    return plant_of(np.stack([out, out + 1e-3 * across, out + 1e-3 * up], axis=1))


def at_faces(plant: Plant) -> FloatArray:
    """(f, 3, 3) normals at the corners of faces."""
    return np.asarray(plant.normals[plant.faces])


def test_none_of_it_is_the_plant_itself() -> None:
    plant = sample("bush", 300)
    assert crown_normals(plant, 0.0) is plant
    wood = replace(plant, materials=tuple(replace(m, role="wood") for m in plant.materials))
    assert crown_normals(wood, 1.0) is wood


def test_all_of_it_is_the_ellipsoids_turned_to_the_front_of_the_leaf() -> None:
    """That of x²/a² + y²/b² + z²/c² is along (x/a², y/b², z/c²); leaves have an extent."""
    plant = shell()
    found = at_faces(crown_normals(plant, 1.0))
    gradient = unit(plant.face_centroids / SIZES**2)
    sign = np.sign((gradient * plant.face_area_vectors).sum(axis=1, keepdims=True))
    assert {-1.0, 1.0} == set(sign.ravel())
    cosine = np.einsum("fki,fi->fk", found, sign * gradient)
    assert cosine.min() > np.cos(np.radians(0.5))


def test_half_of_it_is_half_way() -> None:
    plant = shell()
    whole, half = (crown_normals(plant, share) for share in (1.0, 0.5))
    expected = unit((at_faces(plant) + at_faces(whole)).reshape(-1, 3))
    np.testing.assert_allclose(at_faces(half).reshape(-1, 3), expected, atol=1e-12)


def test_wood_stays_and_inputs_too() -> None:
    """And each leaf has vertices of its own, with what its vertices had."""
    bush = sample("bush", 300)
    random = generator(0, "vertices")
    count = len(bush.positions)
    plant = replace(bush, colors=random.random((count, 4)), exposure=random.random((count, 2)))
    before = plant.normals.copy()
    bent, leaf = crown_normals(plant, 0.8), plant.face_is_leaf
    np.testing.assert_array_equal(plant.normals, before)
    np.testing.assert_array_equal(bent.faces[~leaf], plant.faces[~leaf])
    np.testing.assert_array_equal(bent.normals[:count], plant.normals)
    assert (bent.faces[leaf] >= count).all()
    assert bent.colors is not None and plant.colors is not None
    assert bent.exposure is not None and plant.exposure is not None
    np.testing.assert_array_equal(bent.corners, plant.corners)
    np.testing.assert_array_equal(bent.uvs[bent.faces], plant.uvs[plant.faces])
    np.testing.assert_array_equal(bent.colors[bent.faces], plant.colors[plant.faces])
    np.testing.assert_array_equal(bent.exposure[bent.faces], plant.exposure[plant.faces])
    np.testing.assert_array_equal(bent.face_material, plant.face_material)
    assert (at_faces(bent)[leaf] != at_faces(plant)[leaf]).any()


@pytest.mark.parametrize("species", ["broadleaf", "conifer", "herb"])
def test_on_whole_plants_all_normals_are_unit_and_none_leaves_the_front_of_its_leaf(
    species: str,
) -> None:
    plant = sample(species, 500)
    bent = crown_normals(plant, 1.0)
    np.testing.assert_allclose(np.linalg.norm(bent.normals, axis=1), 1.0)
    leaf = bent.face_is_leaf
    along = np.einsum("fki,fi->fk", at_faces(bent)[leaf], unit(bent.face_area_vectors[leaf]))
    assert along.min() >= -1e-5


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_it_does_not_matter_where_a_plant_stands_and_how_large_it_is(scale: float) -> None:
    plant = sample("broadleaf", 500)
    there = replace(plant, positions=scale * (plant.positions + np.array([30.0, -2.0, 11.0])))
    here = crown_normals(plant, 0.6).normals
    np.testing.assert_allclose(crown_normals(there, 0.6).normals, here, atol=1e-6)


def test_a_crown_that_is_flat_has_normals_across_it() -> None:
    """There is no other way out of it."""
    random = generator(1, "flat")
    at = random.uniform(-1, 1, (50, 1, 3)) * [2.0, 0.0, 1.0]
    corners = at + 0.1 * np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0]])
    corners[::2] = corners[::2, ::-1]
    plant = plant_of(corners)
    found = at_faces(crown_normals(plant, 1.0))
    fronts = unit(plant.face_area_vectors)
    assert {-1.0, 1.0} == set(fronts[:, 1].round())
    np.testing.assert_allclose(found, np.repeat(fronts[:, None], 3, axis=1), atol=1e-9)


CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


@pytest.mark.parametrize(
    "corners",
    [
        [CORNERS],
        [CORNERS, CORNERS[::-1]],
        [CORNERS + 5 * i * np.eye(3)[0] for i in range(6)],
        [1e-6 * CORNERS],
        [CORNERS, np.zeros((3, 3))],
        [np.zeros((3, 3))],
    ],
    ids=["a leaf", "both sides", "in a line", "a speck", "one without area", "a point"],
)
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_crowns_that_are_none_have_normals_all_the_same(corners: FloatArray, share: float) -> None:
    bent = crown_normals(plant_of(corners), share)
    np.testing.assert_allclose(np.linalg.norm(bent.normals, axis=1), 1.0)


def test_in_the_middle_up_is_as_good_as_any() -> None:
    plant = shell()
    middle = (plant.face_areas / plant.face_areas.sum()) @ plant.face_centroids
    faces = np.arange(len(plant.faces))
    np.testing.assert_array_equal(ellipsoid_normals(plant, faces, middle[None]), [[0, 1, 0]])
