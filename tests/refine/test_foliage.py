"""Leaves as triangles: what they cover, where they lie, how they look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.plants import plant_of
from vegtool.arrays import FloatArray
from vegtool.plant import Material, Plant, Texture
from vegtool.refine.cutouts import cutouts
from vegtool.refine.foliage import Foliage, leaves_of, reduced_leaves
from vegtool.refine.foliage_groups import grouped, mean_of, refilled, settled, split
from vegtool.refine.hits import Rays, distinct, hits, nearest
from vegtool.refine.mesh import joined

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
PIXEL = 1e-3
"""Metres, less than any leaf here."""


def every(plant: Plant) -> np.ndarray:
    return np.arange(len(plant.faces), dtype=np.int32)


def foliage(plant: Plant, triangles: int, factor: float = 1.0) -> Foliage:
    leaves = leaves_of(plant, every(plant))
    assert leaves is not None
    found = reduced_leaves(leaves, triangles, PIXEL, factor)
    assert found is not None
    return found


def areas(mesh: Foliage) -> FloatArray:
    c = mesh.positions[mesh.faces]
    return np.asarray(np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1) / 2)


def crown(count: int, size: float, seed: int = 0) -> FloatArray:
    """(count, 3, 3) leaves of that size, any way round, within a ball of radius 1."""
    random = np.random.default_rng(seed)
    middle = random.normal(size=(count, 3))
    middle *= (random.random(count) ** (1 / 3) / np.linalg.norm(middle, axis=1))[:, None]
    return np.asarray(middle[:, None] + size * random.normal(size=(count, 3, 3)))


def card(pixels: np.ndarray) -> Plant:
    """A square metre that shows all of an image, alpha-tested."""
    plant = plant_of(SQUARE)
    x, y = plant.positions[:, 0], plant.positions[:, 1]
    texture = Texture("leaf", pixels.astype(np.uint8))
    material = Material("leaf", color_texture=texture, alpha_mode="mask", double_sided=True)
    return replace(plant, uvs=np.stack([x, 1 - y], axis=1), materials=(material,))


# what alpha leaves of a face


def test_alpha_says_how_much_is_covered_where_and_of_which_color() -> None:
    pixels = np.zeros((64, 64, 4))
    pixels[..., 0] = 255  # red where nothing shows
    pixels[32:, :] = [0, 255, 0, 255]  # the lower half is green
    cut = cutouts(card(pixels), np.arange(2, dtype=np.int32))
    # the diagonal from the lower left leaves the lower triangle 3/4 covered, the upper one 1/4
    np.testing.assert_allclose(cut.share, [0.75, 0.25], atol=0.02)
    np.testing.assert_allclose(cut.color, [[0, 1, 0], [0, 1, 0]], atol=1e-12)
    middle = np.einsum("fc,fci->fi", cut.at, SQUARE)
    # together they are the lower half of the square
    both = (cut.share[:, None] * middle[:, :2]).sum(axis=0)
    np.testing.assert_allclose(both, [0.5, 0.25], atol=0.02)


def test_faces_that_show_the_same_are_looked_up_once() -> None:
    one = card(np.full((8, 8, 4), 255))
    corners = np.concatenate([SQUARE, SQUARE + np.array([5, 0, 0])])
    two = replace(plant_of(corners), uvs=np.tile(one.uvs, (2, 1)), materials=one.materials)
    assert len(cutouts(two, every(two)).mask) == 2


def test_opaque_faces_are_covered_all_over() -> None:
    plant = plant_of(SQUARE)
    cut = cutouts(plant, every(plant))
    np.testing.assert_allclose(cut.share, 1)
    np.testing.assert_allclose(cut.at, 1 / 3, atol=1e-3)
    # the moment of a triangle's own coordinates: 1/18 along each, -1/36 between two
    np.testing.assert_allclose(cut.moment[0], (3 * np.eye(3) - 1) / 36, atol=1e-3)


# rays


def test_hits_are_those_of_asking_every_ray() -> None:
    corners = crown(12, 0.4)
    rays = replace(Rays.around(corners, 3), cells=24)
    found = hits(rays, corners)
    got = set(zip(found.ray.tolist(), found.face.tolist(), strict=True))
    expected = set()
    step = rays.extent / rays.cells
    for d, view in enumerate(rays.views):
        right = np.cross([0, 1, 0], view)
        right /= np.linalg.norm(right)
        above = np.cross(view, right)
        for y in range(24):
            for x in range(24):
                start = rays.middle + (x - 11.5) * step * right + (y - 11.5) * step * above
                for f, (a, b, c) in enumerate(corners):
                    t = np.linalg.solve(np.stack([b - a, c - a, view], axis=1), start - a)
                    if t[0] >= 0 and t[1] >= 0 and t[0] + t[1] <= 1:
                        expected.add((d * 576 + y * 24 + x, f))
    assert got == expected


def test_the_nearest_of_two_is_the_one_towards_the_viewer() -> None:
    corners = np.concatenate([SQUARE, SQUARE + np.array([0, 0, 0.01])])
    rays = Rays.around(corners)
    found = hits(rays, corners)
    behind = found.face[~nearest(found)]
    toward = rays.views[found.ray[~nearest(found)] // rays.cells**2][:, 2] > 0
    assert ((behind < 2) == toward).all()
    assert (found.front == (rays.views[found.ray // rays.cells**2][:, 2] > 0)).all()


def test_rays_that_meet_a_label_twice_count_once() -> None:
    ray, label = np.array([4, 4, 4, 7]), np.array([0, 0, 1, 1])
    np.testing.assert_array_equal(distinct(ray, label, 3), [1, 2, 0])


# groups


def group(middle: FloatArray, looks: FloatArray, weight: FloatArray, count: int) -> np.ndarray:
    return grouped(middle, looks, looks, np.ones((len(middle), 3)), weight, count, PIXEL)


def test_halves_are_as_many_as_wanted_and_alike_in_weight() -> None:
    random = np.random.default_rng(1)
    features, weight = random.normal(size=(4096, 3)), random.random(4096) + 0.5
    for count in (1, 7, 64):
        total = np.bincount(split(features, weight, count), weight)
        assert len(total) == count
        np.testing.assert_allclose(total, weight.sum() / count, rtol=0.25)


def test_settled_groups_are_as_many_and_nearer_together() -> None:
    random = np.random.default_rng(1)
    features, weight = random.normal(size=(2000, 3)), random.random(2000)

    def spread(labels: np.ndarray) -> float:
        away = features - mean_of(features, weight, labels, 50)[labels]
        return float(weight @ (away**2).sum(axis=1))

    halves = split(features, weight, 50)
    found = settled(features, weight, halves, 50)
    assert len(np.unique(found)) == 50
    assert spread(found) < 0.95 * spread(halves)


def test_leaves_lit_from_different_sides_are_parted_however_they_lie() -> None:
    # crown normals: the fronts of some leaves look out, and the backs of others
    middle = np.random.default_rng(3).normal(size=(200, 3)) * 0.01
    out, over, nth = np.array([[0.0, 1, 0]]), np.ones((200, 3)), np.arange(200)[:, None]
    normal, shading = np.where(nth % 2, out, -out), np.repeat(out, 200, axis=0)
    labels = grouped(middle, normal, shading, over, np.ones(200), 2, PIXEL)
    assert (labels[::2] == labels[0]).all() and labels[0] != labels[1]
    turned = np.where(nth % 3, -1.0, 1.0)  # the same leaves, wound the other way
    again = grouped(middle, normal * turned, shading * turned, over, np.ones(200), 2, PIXEL)
    np.testing.assert_array_equal(again, labels)


def test_groups_that_are_lost_are_made_up_for_where_leaves_spread_most() -> None:
    features = np.array([[0.0], [0.1], [5], [9], [20], [20]])
    weight = np.ones(6)
    labels = refilled(features, weight, np.array([0, 0, 1, 1, 2, 2]), 4)
    assert len(np.unique(labels)) == 4
    assert labels[2] != labels[3] and labels[0] == labels[1]
    both = refilled(features, weight, np.array([0, 0, 0, 0, 1, 1]), 6)
    assert len(np.unique(both)) == 4  # one turn halves each group once


def test_every_group_has_a_leaf_whatever_they_weigh() -> None:
    weight = np.array([1.0, 1e-12, 1e-12, 1e-12, 1e-12])
    middle = np.arange(15.0).reshape(5, 3)
    for count in range(1, 6):
        labels = group(middle, np.tile([0.0, 1, 0], (5, 1)), weight, count)
        assert sorted(set(labels.tolist())) == list(range(count))


def test_leaves_in_one_place_that_look_two_ways_are_parted() -> None:
    middle = np.random.default_rng(2).normal(size=(200, 3)) * 0.01
    looks = np.where(np.arange(200)[:, None] % 2, [[1.0, 0, 0]], [[0.0, 1, 0]])
    labels = group(middle, looks, np.ones(200), 2)
    assert (labels[::2] == labels[0]).all() and (labels[1::2] == labels[1]).all()
    assert labels[0] != labels[1]


# triangles


def test_one_leaf_is_one_triangle_of_its_size_place_and_color() -> None:
    plant = plant_of([[[0, 0, 0], [2, 0, 0], [0, 0, -1]]])
    plant = replace(plant, colors=np.tile([0.2, 0.5, 0.1, 1.0], (3, 1)))
    mesh = foliage(plant, 8)
    assert len(mesh.faces) == 1
    np.testing.assert_allclose(areas(mesh), 1, rtol=0.05)  # as well as rays can tell
    np.testing.assert_allclose(mesh.positions.mean(axis=0), [2 / 3, 0, -1 / 3], atol=0.01)
    np.testing.assert_allclose(mesh.positions[:, 1], 0, atol=1e-9)
    np.testing.assert_allclose(mesh.colors, np.tile([0.2, 0.5, 0.1], (3, 1)))
    np.testing.assert_allclose(mesh.normals, np.tile([0.0, 1, 0], (3, 1)))
    a, b, c = mesh.positions
    assert np.cross(b - a, c - a)[1] > 0  # seen from the same side


def test_leaves_that_lie_on_each_other_cover_as_one() -> None:
    pile = np.concatenate([SQUARE + np.array([0, 0, 1e-4 * i]) for i in range(6)])
    np.testing.assert_allclose(areas(foliage(plant_of(pile), 1)), 1, rtol=0.05)


def test_two_opposite_single_sided_leaves_are_one_leaf() -> None:
    corners = crown(300, 0.1)
    both = plant_of(corners)
    pair = plant_of(np.concatenate([corners, corners[:, ::-1]]), double_sided=False)
    pair = replace(pair, normals=np.concatenate([both.normals, -both.normals]))
    a, b = (leaves_of(plant, every(plant)) for plant in (both, pair))
    assert a is not None and b is not None
    np.testing.assert_allclose(b.area.sum(), a.area.sum())
    assert abs(areas(foliage(pair, 40)).sum() / areas(foliage(both, 40)).sum() - 1) < 0.1


def test_triangles_cover_as_much_as_the_leaves_from_where_nobody_asked() -> None:
    corners = crown(4000, 0.05)
    mesh = foliage(plant_of(corners), 300)
    assert len(mesh.faces) == 300
    rays = replace(Rays.around(corners, 23), cells=200)
    truth = len(np.unique(hits(rays, corners).ray))
    covered = len(np.unique(hits(rays, mesh.positions[mesh.faces]).ray))
    assert abs(covered / truth - 1) < 0.03


def test_triangles_go_where_leaves_are_seen() -> None:
    shell = crown(3000, 0.05)
    middle = shell.mean(axis=1)
    shell += (middle / np.linalg.norm(middle, axis=1)[:, None] - middle)[:, None]
    core = crown(3000, 0.05, seed=1) * 0.5
    mesh = foliage(plant_of(np.concatenate([shell, core])), 200)
    away = np.linalg.norm(mesh.positions.reshape(-1, 3, 3).mean(axis=1), axis=1)
    assert (away > 0.75).mean() > 0.75


def test_normals_are_those_of_the_sides_that_are_shown() -> None:
    # one leaf lies the other way round: from above one sees its back, which is lit from above too
    over = SQUARE[:, :, [0, 2, 1]] * [1, 1, -1]
    plant = plant_of(
        np.concatenate([over, over[:, ::-1] + np.array([0, 0, -1]), over + np.array([0, 0, -2])])
    )
    normals = np.repeat(np.array([[0.0, 1, 0], [0, -1, 0], [0, 1, 0]]), 6, axis=0)
    mesh = foliage(replace(plant, normals=normals), 1)
    np.testing.assert_allclose(mesh.normals, np.tile([0.0, 1, 0], (3, 1)), atol=1e-9)


def test_a_plant_moved_and_scaled_has_its_triangles_moved_and_scaled() -> None:
    corners = crown(500, 0.1)
    a = foliage(plant_of(corners), 60)
    moved = plant_of(corners * 4 + [16, 0, -8])
    leaves = leaves_of(moved, every(moved))
    assert leaves is not None
    b = reduced_leaves(leaves, 60, 4 * PIXEL)
    assert b is not None
    np.testing.assert_allclose(b.positions, a.positions * 4 + [16, 0, -8], atol=1e-6)


def test_the_factor_is_of_the_area() -> None:
    plant = plant_of(crown(500, 0.1))
    one, more = areas(foliage(plant, 60)), areas(foliage(plant, 60, 1.5))
    np.testing.assert_allclose(more, 1.5 * one)


def test_leaves_too_small_for_any_ray_keep_their_area() -> None:
    tiny = SQUARE * 1e-4
    mesh = foliage(plant_of(np.concatenate([tiny, tiny + np.array([1, 0.31, 0.17])])), 4)
    np.testing.assert_allclose(areas(mesh), 0.5e-8, rtol=0.02)


def test_what_cannot_be_drawn_is_none() -> None:
    plant = plant_of(SQUARE)
    leaves = leaves_of(plant, every(plant))
    assert leaves is not None
    assert reduced_leaves(leaves, 0, PIXEL) is None
    assert leaves_of(plant, np.empty(0, dtype=np.int32)) is None
    bare = card(np.zeros((8, 8, 4)))
    assert leaves_of(bare, every(bare)) is None
    points = plant_of(np.zeros((2, 3, 3)))
    assert leaves_of(points, every(points)) is None
    for pixel, factor in ((0.0, 1.0), (np.nan, 1.0), (1.0, -1.0)):
        with pytest.raises(ValueError, match="positive"):
            reduced_leaves(leaves, 1, pixel, factor)


# meshes


def test_meshes_are_joined_with_their_own_vertices() -> None:
    a, b = foliage(plant_of(SQUARE), 2), foliage(plant_of(SQUARE + np.array([0, 0, 1])), 1)
    plant = joined([a, None, b], "both")
    assert plant is not None and plant.colors is not None
    np.testing.assert_array_equal(
        plant.corners, np.concatenate([a.positions[a.faces], b.positions[b.faces]])
    )
    assert plant.materials[0].double_sided and plant.materials[0].alpha_mode == "opaque"
    np.testing.assert_array_equal(plant.colors[:, 3], 1)
    assert joined([None]) is None
