"""Pictures and triangles changed one by one, on random levels: what changes, and what may not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from retouch_cases import COUNT, WHITE, in_space, pictures, random_level, random_mesh, within
from scipy.spatial.transform import Rotation

from vegtool.arrays import ByteArray, unit
from vegtool.lod import Level
from vegtool.measure.pictures import client_plant
from vegtool.plant import Plant
from vegtool.refine.retouch import (
    GUTTER,
    elements_of,
    normal_bytes,
    retouched,
    rotated,
    rotation,
)
from vegtool.seeding import generator

LEVELS = {
    "billboards": random_level(mesh=False),
    "billboards of two sides": random_level(mesh=False, opposite=True),
    "hybrid": random_level(),
    "hybrid of two sides": random_level(opposite=True),
    "unlit": random_level(unlit=True),
    "mesh": Level("mesh", mesh=random_mesh()),
}
STEP = 1.5 / 127.5
"""Of a normal's part, that bytes may lose."""


def count_of(level: Level) -> int:
    return int(elements_of(level).max()) + 1


def atlas_of(level: Level) -> tuple[ByteArray, ByteArray]:
    assert level.atlas is not None and level.atlas.normal is not None
    return level.atlas.color, level.atlas.normal


def mesh_of(level: Level) -> Plant:
    assert level.mesh is not None
    return level.mesh


@pytest.mark.parametrize("name", LEVELS)
def test_elements_are_those_of_the_triangles_that_a_client_draws(name: str) -> None:
    """A triangle lies in the plane of its billboard, or has the corners of its triangle."""
    level = LEVELS[name]
    drawn, element = client_plant(level), elements_of(level)
    assert len(element) == len(drawn.faces)
    pictured = 0 if level.billboards is None else len(level.billboards)
    assert (element < pictured).sum() == (level.triangles - level.mesh_triangles)
    for number, corners in zip(element, drawn.corners, strict=True):
        if number < pictured:
            assert level.billboards is not None
            off = (corners - level.billboards.center[number]) @ level.billboards.normal[number]
            assert np.abs(off).max() < 1e-9
        else:
            own = mesh_of(level).corners[number - pictured]
            assert {tuple(c) for c in corners} == {tuple(c) for c in own}


@pytest.mark.parametrize("name", LEVELS)
def test_gains_of_one_and_turns_of_nothing_change_no_byte(name: str) -> None:
    level = LEVELS[name]
    count = count_of(level)
    found = retouched(level, np.ones(count), np.zeros((count, 3)))
    if level.atlas is not None:
        assert found.atlas is not None
        np.testing.assert_array_equal(found.atlas.color, level.atlas.color)
        assert (found.atlas.normal is None) == (level.atlas.normal is None)
        if level.atlas.normal is not None and found.atlas.normal is not None:
            np.testing.assert_array_equal(found.atlas.normal, level.atlas.normal)
    if level.mesh is not None:
        np.testing.assert_array_equal(mesh_of(found).colors, level.mesh.colors)
        np.testing.assert_allclose(mesh_of(found).normals, level.mesh.normals, atol=1e-12)


@pytest.mark.parametrize("opposite", [False, True])
@pytest.mark.parametrize("number", range(COUNT))
def test_one_billboard_changes_and_no_texel_of_another(opposite: bool, number: int) -> None:
    """Its pictures and their gutters: half of the light is sRGB 188 of 255."""
    level = random_level(1, opposite)
    count = count_of(level)
    gain, turn = np.ones(count), np.zeros((count, 3))
    gain[number], turn[number] = 0.5, [0.0, 0.3, 0.2]
    before = [part.copy() for part in atlas_of(level)]
    found = retouched(level, gain, turn)
    changed = [(a != b).any(axis=-1) for a, b in zip(atlas_of(found), before, strict=True)]
    own = np.zeros(changed[0].shape, dtype=bool)
    for which, _, rect in pictures(level):
        if which == number:
            own[within(rect, GUTTER)] = True
    assert not changed[0][~own].any() and not changed[1][~own].any()
    assert changed[0][own].all() and changed[1][own].mean() > 0.9
    np.testing.assert_array_equal(atlas_of(found)[0][..., 3], before[0][..., 3])
    for a, b in zip(atlas_of(level), before, strict=True):
        np.testing.assert_array_equal(a, b)


def test_gains_are_of_linear_light_and_nothing_is_brighter_than_white() -> None:
    level = random_level()
    assert level.atlas is not None
    color = level.atlas.color.copy()
    x, y, _, _ = level.atlas.front[0]
    color[y, x] = (255, 188, 0, 77)
    level = replace(level, atlas=replace(level.atlas, color=color))
    count = count_of(level)
    half, twice = (
        atlas_of(retouched(level, np.full(count, gain), np.zeros((count, 3))))[0][y, x]
        for gain in (0.5, 2.0)
    )
    assert half.tolist() == pytest.approx([188, 137, 0, 77], abs=1)
    assert twice.tolist() == pytest.approx([255, 255, 0, 77], abs=1)


@pytest.mark.parametrize("opposite", [False, True])
def test_normals_turn_in_space_on_whichever_side_they_are_seen(opposite: bool) -> None:
    level = random_level(2, opposite)
    count = count_of(level)
    turn = generator(0, "turns").normal(size=(count, 3)) * 0.3
    found = retouched(level, np.ones(count), turn)
    assert level.billboards is not None
    shared = {0} if opposite else set()  # one picture for two quads cannot turn both ways
    for number, side, rect in pictures(level):
        if number in shared:
            continue
        before, after = (
            in_space(atlas_of(one)[1][within(rect)], level.billboards, number, side)
            for one in (level, found)
        )
        expected = Rotation.from_rotvec(turn[number]).apply(before)
        assert np.abs(after - expected).max() < STEP


def test_a_picture_that_two_quads_share_turns_for_the_front() -> None:
    """What it shows on the back is the mirror image, which turns as it can."""
    level = random_level(3, opposite=True)
    count = count_of(level)
    turn = np.zeros((count, 3))
    turn[0] = [0.2, -0.1, 0.3]
    found = retouched(level, np.ones(count), turn)
    assert level.billboards is not None and level.atlas is not None
    before, after = (
        in_space(atlas_of(one)[1][within(level.atlas.front[0])], level.billboards, 0, 1.0)
        for one in (level, found)
    )
    assert np.abs(after - Rotation.from_rotvec(turn[0]).apply(before)).max() < STEP


def test_the_white_block_stays() -> None:
    level = random_level()
    count = count_of(level)
    found = retouched(level, np.full(count, 0.5), np.full((count, 3), 0.2))
    assert (atlas_of(found)[0][within(WHITE, GUTTER)] == 255).all()
    assert (atlas_of(found)[1][within(WHITE, GUTTER)] == [128, 128, 255]).all()


def test_a_vertex_takes_the_mean_of_its_triangles() -> None:
    level = LEVELS["hybrid"]
    mesh, count = mesh_of(level), count_of(level)
    random = generator(0, "gains")
    gain, turn = random.uniform(0.5, 1.5, count), random.normal(size=(count, 3)) * 0.2
    found = mesh_of(retouched(level, gain, turn))
    assert found.colors is not None and mesh.colors is not None
    for vertex in range(len(mesh.positions)):
        own = np.flatnonzero((mesh.faces == vertex).any(axis=1)) + COUNT
        if not len(own):
            continue
        expected = mesh.colors[vertex, :3] * gain[own].mean()
        np.testing.assert_allclose(found.colors[vertex, :3], expected)
        axis = Rotation.from_rotvec(turn[own].mean(axis=0))
        np.testing.assert_allclose(found.normals[vertex], axis.apply(mesh.normals[vertex].copy()))
    np.testing.assert_array_equal(found.colors[:, 3], mesh.colors[:, 3])


def test_a_mesh_without_colours_keeps_them_and_turns() -> None:
    mesh = replace(random_mesh(), colors=None)
    level = Level("mesh", mesh=mesh)
    found = mesh_of(retouched(level, np.full(8, 2.0), np.full((8, 3), 0.1)))
    assert found.colors is None
    assert np.abs(found.normals - mesh.normals).max() > 0.05


def test_vectors_turn_as_others_turn_them() -> None:
    random = generator(4, "turns")
    vectors, axes = random.normal(size=(100, 3)), random.normal(size=(100, 3))
    axes[0] = 0
    expected = Rotation.from_rotvec(axes).apply(vectors)
    np.testing.assert_allclose(rotated(vectors, axes), expected, atol=1e-12)
    np.testing.assert_array_equal(rotated(vectors, axes)[0], vectors[0])
    for axis in axes[:5]:
        np.testing.assert_allclose(
            rotation(axis), Rotation.from_rotvec(axis).as_matrix(), atol=1e-12
        )


def test_bytes_of_normals_are_read_as_they_were_written() -> None:
    """Straight out is 128, 128, 255, as bakes write it; none is farther off than half a step."""
    assert normal_bytes(np.array([[0.0, 0, 1]])).tolist() == [[128, 128, 255]]
    normal = unit(generator(5, "normals").normal(size=(1000, 3)))
    read = normal_bytes(3.0 * normal) / 127.5 - 1
    assert np.abs(read - normal).max() < 1.01 / 127.5
    again = normal_bytes(read).astype(int)
    assert np.abs(again - normal_bytes(normal)).max() <= 1
