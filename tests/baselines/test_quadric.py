from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from surfaces import cards, plant_from, sphere, together, tube

from vegtool.baselines.quadric import quadric, shares
from vegtool.baselines.thinning import GROWTH
from vegtool.formats import read_plant
from vegtool.meshes.collapse import roots
from vegtool.plant import Plant


def reduced(plant: Plant, triangles: int) -> Plant:
    mesh = quadric(plant, triangles).mesh
    assert mesh is not None
    return mesh


def closed(plant: Plant) -> bool:
    """Whether every edge, by position, has as many triangles on its one side as on its other."""
    _, place = np.unique(np.round(plant.positions, 9), axis=0, return_inverse=True)
    faces = place.ravel()[plant.faces]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    one, other = (np.unique(e, axis=0, return_counts=True) for e in (edges, edges[:, ::-1]))
    return np.array_equal(one[0], other[0]) and np.array_equal(one[1], other[1])


@pytest.mark.parametrize("triangles", [800, 200, 60])
def test_a_sphere_stays_round_and_closed(triangles: int) -> None:
    """It has a texture seam and a vertex for each triangle at its poles: both are welded."""
    mesh = reduced(sphere(), triangles)
    assert 0.9 * triangles <= len(mesh.faces) <= triangles
    assert closed(mesh)
    # n equal triangles on a sphere: a plane's height over its circle is about 1.2 pi / n
    off = np.abs(np.linalg.norm(mesh.positions, axis=1) - 1)
    assert off.max() < 8 / triangles


def test_attributes_are_those_of_vertices_near_by() -> None:
    """On the unit sphere an original vertex's normal is its position."""
    plant = sphere()
    mesh = reduced(plant, 200)
    pairs = np.concatenate([plant.normals, plant.uvs], axis=1)
    taken = np.concatenate([mesh.normals, mesh.uvs], axis=1)
    assert (np.abs(taken[:, None] - pairs).max(axis=2).min(axis=1) == 0).all()
    assert np.linalg.norm(mesh.normals - mesh.positions, axis=1).max() < 0.3


def test_no_triangle_spans_two_texture_islands() -> None:
    """Both halves of a sphere, welded along the equator, with pictures at u < 1 and u >= 2."""
    whole = sphere()
    south = whole.face_centroids[:, 1] < 0
    count = len(whole.positions)
    plant = plant_from(
        np.tile(whole.positions, (2, 1)),
        whole.faces + count * south[:, None],
        uvs=np.concatenate([whole.uvs, whole.uvs + np.array([2.0, 0.0])]),
    )
    mesh = reduced(plant, 150)
    u = mesh.uvs[mesh.faces, 0]
    assert ((u < 1.5).all(axis=1) | (u > 1.5).all(axis=1)).all()
    assert (u < 1.5).any() and (u > 1.5).any()
    assert closed(mesh)


def test_triangles_are_shared_among_materials_in_proportion() -> None:
    plant = together(sphere(24, 48), cards(1152))  # as many triangles each, 2304
    assert shares(plant, 400) == [200, 200]
    mesh = reduced(plant, 400)
    counts = np.bincount(mesh.face_material)
    assert mesh.materials == plant.materials
    assert 180 <= counts[0] <= 200
    assert counts[1] == 200
    assert mesh.uvs.min() >= 0 and mesh.uvs.max() <= 1


def test_cards_are_kept_whole_and_enlarged() -> None:
    """100 equal squares, 20 triangles: ten of the squares, (100 / 10)^GROWTH times as long."""
    plant = cards(100)
    mesh = reduced(plant, 20)
    assert len(mesh.faces) == 20
    middles = mesh.corners.reshape(10, 6, 3)
    middles = np.stack([(c.min(axis=0) + c.max(axis=0)) / 2 for c in middles])
    originals = plant.positions.reshape(100, 4, 3).mean(axis=1)
    nearest = np.linalg.norm(middles[:, None] - originals, axis=2).min(axis=1)
    assert nearest.max() < 1e-9
    np.testing.assert_allclose(mesh.face_areas, 0.5 * 0.02**2 * 10 ** (2 * GROWTH), rtol=1e-9)


def test_fewer_cards_are_some_of_more() -> None:
    plant = cards(200)
    few, more = (
        {tuple(np.round(m, 6)) for m in mesh.corners.reshape(-1, 6, 3)[:, [0, 2]].mean(axis=1)}
        for mesh in (reduced(plant, 40), reduced(plant, 120))
    )
    assert len(few) == 20 and len(more) == 60
    assert few <= more


def test_wood_keeps_its_largest_branches() -> None:
    """A trunk among 60 three-sided twigs, of which no triangle can go: the twigs go, not it."""
    trunk = tube([0, 0, 0], 0.1, 2.0, 12, 20)
    twigs = [tube([0.1 * i - 3, 2, 0], 0.002, 0.3, 3, 1) for i in range(60)]
    plant = together(trunk, *twigs)
    plant = replace(plant, face_material=np.zeros(len(plant.faces), np.int32))
    mesh = reduced(plant, 60)
    assert 30 <= len(mesh.faces) <= 60
    low, high = mesh.bounds
    np.testing.assert_allclose([low[1], high[1]], [0, 2], atol=0.01)
    trunk_faces = mesh.face_centroids[:, 1] < 2
    width = np.ptp(mesh.corners[trunk_faces][..., 0])
    np.testing.assert_allclose(width, 0.2, atol=0.02)


def test_enough_triangles_change_nothing() -> None:
    plant = sphere(8, 8)
    mesh = reduced(plant, 10_000)
    assert len(mesh.faces) == 8 * 8 * 2 - 2 * 8  # at each pole half of the triangles are flat
    np.testing.assert_allclose(mesh.bounds, plant.bounds, atol=1e-12)


@pytest.mark.parametrize("triangles", [1, 2, 3])
def test_at_least_a_triangle_is_left(triangles: int) -> None:
    """A tetrahedron loses two triangles at once, a square both of them."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    tetrahedron = plant_from(corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    square = plant_from(corners[[0, 1, 2]].repeat(2, axis=0), [[0, 2, 4], [1, 5, 3]])
    for plant in (tetrahedron, square):
        assert 1 <= len(reduced(plant, triangles).faces) <= max(triangles, 2)


def test_a_plant_without_area_is_left_alone() -> None:
    point = plant_from(np.zeros((6, 3)), [[0, 1, 2], [3, 4, 5]])
    assert len(reduced(point, 1).faces) == 2


def test_moved_and_scaled() -> None:
    """All is done about the middle, in plant radii; here every number is exact in binary."""
    plant = together(tube([0, 0, 0], 0.25, 2.0, 8, 16), cards(64))
    plant = replace(plant, positions=np.rint(plant.positions * 2**16) / 2**16)
    moved = replace(plant, positions=plant.positions * 1024 + 2.0**20)
    one, other = reduced(plant, 80), reduced(moved, 80)
    np.testing.assert_array_equal(one.faces, other.faces)
    np.testing.assert_array_equal(one.uvs, other.uvs)
    np.testing.assert_allclose((other.positions - 2.0**20) / 1024, one.positions, atol=1e-9)


def test_the_same_again_and_the_plant_as_it_was() -> None:
    plant = together(sphere(), cards(300))
    before = {n: getattr(plant, n).copy() for n in ("positions", "normals", "uvs", "faces")}
    one, other = reduced(plant, 100), reduced(plant, 100)
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(plant, name), value)
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_colors_come_along() -> None:
    plant = sphere()
    colors = np.concatenate([np.abs(plant.positions), np.ones((len(plant.positions), 1))], axis=1)
    mesh = reduced(replace(plant, colors=colors), 200)
    assert mesh.colors is not None
    np.testing.assert_array_equal(mesh.colors[:, :3], np.abs(mesh.normals))


def test_roots_follow_chains() -> None:
    """3 into 2, 2 into 0, 4 into 1."""
    collapses = np.array([[2, 3], [0, 2], [1, 4]])
    assert roots(6, collapses).tolist() == [0, 1, 0, 0, 1, 5]
    assert roots(2, np.empty((0, 2), np.int64)).tolist() == [0, 1]


@pytest.mark.models
@pytest.mark.parametrize(
    "name", ["eztree_ash_small/eztree_ash_small.glb", "eztree_pine_medium/eztree_pine_medium.glb"]
)
def test_real_trees_reach_their_target(models: Path, name: str) -> None:
    plant = read_plant(models / name)
    for triangles in (4000, 500, 120):
        mesh = reduced(plant, triangles)
        assert 0.9 * triangles <= len(mesh.faces) <= triangles
        assert len(np.unique(mesh.face_material)) == len(np.unique(plant.face_material))
        low, high = plant.bounds
        margin = 0.2 * (high - low)
        assert (mesh.bounds[0] > low - margin).all() and (mesh.bounds[1] < high + margin).all()
        assert mesh.bounds[0, 1] < low[1] + 0.02 * plant.height  # the trunk is still there
