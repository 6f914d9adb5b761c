"""Normals of a level bent as a whole: arrays, and the bytes of pictures on either side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from retouch_cases import WHITE, in_space, pictures, random_level, random_mesh, within

from vegtool.arrays import FloatArray, unit
from vegtool.lod import Level
from vegtool.refine.bend import Bend, bent, bent_level, lowered
from vegtool.refine.retouch import GUTTER
from vegtool.seeding import generator

STEP = 1.5 / 127.5


def random_normals(seed: int = 0, count: int = 300) -> tuple[FloatArray, FloatArray]:
    """Normals, and planes on whose front they are."""
    random = generator(seed, "normals")
    normal, plane = unit(random.normal(size=(count, 3))), unit(random.normal(size=(count, 3)))
    facing = (normal * plane).sum(axis=1, keepdims=True) < 0
    return normal, np.where(facing, -plane, plane)


ALL = np.ones(300, dtype=bool)


def test_no_bend_changes_nothing() -> None:
    normal, plane = random_normals()
    assert bent(normal, plane, Bend(), ALL) is normal
    level = random_level(opposite=True)
    assert bent_level(level, Bend()).atlas is level.atlas


def test_without_lean_normals_are_the_planes() -> None:
    normal, plane = random_normals()
    np.testing.assert_allclose(bent(normal, plane, Bend(lean=0.0), ALL), plane, atol=1e-7)


def test_normals_that_are_on_no_billboard_do_not_lean_but_are_lowered() -> None:
    normal, plane = random_normals()
    half = ALL.copy()
    half[::2] = False
    found = bent(normal, plane, Bend(0.3, 0.5), half)
    np.testing.assert_array_equal(found[::2], lowered(normal[::2], 0.5))
    assert np.abs(found[1::2] - lowered(normal[1::2], 0.5)).max() > 0.1


@pytest.mark.parametrize("lean", [0.25, 0.7])
def test_the_tangent_of_the_angle_to_the_plane_is_times_the_lean(lean: float) -> None:
    normal, plane = random_normals()
    tangents = []
    for vectors in (normal, bent(normal, plane, Bend(lean), ALL)):
        along = (vectors * plane).sum(axis=1)
        tangents.append(np.linalg.norm(np.cross(vectors, plane), axis=1) / along)
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0)
    np.testing.assert_allclose(tangents[1], lean * tangents[0], rtol=1e-6)


@pytest.mark.parametrize("height", [0.0, 0.6])
def test_the_slope_is_times_the_height(height: float) -> None:
    normal, _ = random_normals()
    found = lowered(normal, height)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    for axis in (0, 2):
        np.testing.assert_allclose(
            found[:, 1] * normal[:, axis], height * normal[:, 1] * found[:, axis], atol=1e-12
        )
    assert (np.sign(found[:, 0]) == np.sign(normal[:, 0])).all()


@pytest.mark.parametrize("opposite", [False, True])
@pytest.mark.parametrize("bend", [Bend(0.4, 1.0), Bend(1.0, 0.6), Bend(0.55, 0.7)])
def test_pictures_are_bent_as_what_is_seen_of_them(opposite: bool, bend: Bend) -> None:
    """So that the level is the one that was found best. Behind, in the frame of the back; gutters
    are their picture's."""
    level = random_level(1, opposite)
    before = level.atlas
    assert before is not None and before.normal is not None and level.billboards is not None
    found = bent_level(level, bend)
    assert found.atlas is not None and found.atlas.normal is not None
    for number, side, rect in pictures(level):
        for gutter in (0, GUTTER):
            old, new = (
                in_space(image[within(rect, gutter)], level.billboards, number, side)
                for image in (before.normal, found.atlas.normal)
            )
            plane = np.tile(side * level.billboards.normal[number], (len(old), 1))
            expected = bent(old, plane, bend, np.ones(len(old), dtype=bool))
            assert np.abs(new - expected).max() < STEP
    np.testing.assert_array_equal(found.atlas.color, before.color)


def test_the_mesh_is_lowered_and_the_white_block_stays() -> None:
    level = random_level()
    found = bent_level(level, Bend(0.5, 0.5))
    assert found.mesh is not None and level.mesh is not None
    assert found.atlas is not None and found.atlas.normal is not None
    np.testing.assert_array_equal(found.mesh.normals, lowered(level.mesh.normals, 0.5))
    assert (found.atlas.normal[within(WHITE, GUTTER)] == [128, 128, 255]).all()


def test_meshes_alone_and_levels_without_normal_textures_have_no_pictures_to_bend() -> None:
    mesh = random_mesh()
    found = bent_level(Level("mesh", mesh=mesh), Bend(0.5, 0.5)).mesh
    assert found is not None
    np.testing.assert_array_equal(found.normals, lowered(mesh.normals, 0.5))
    unlit = random_level(unlit=True)
    assert bent_level(unlit, Bend(0.5, 0.5)).atlas is unlit.atlas


def test_normals_that_are_nothing_stay_nothing() -> None:
    """Straight up without height, or along a plane that none leans from."""
    up = np.array([[0.0, 1, 0]])
    assert not lowered(up, 0.0).any()
    assert not bent(up, np.eye(3)[:1], Bend(lean=0.0), np.ones(1, dtype=bool)).any()
    level = replace(random_level(), mesh=replace(random_mesh(), normals=np.tile(up, (12, 1))))
    mesh = bent_level(level, Bend(height=0.6)).mesh
    assert mesh is not None
    np.testing.assert_array_equal(mesh.normals, np.tile(up, (12, 1)))
