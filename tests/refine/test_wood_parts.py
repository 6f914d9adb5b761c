"""The steps of reducing wood, each beside what it must come to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from wood_cases import all_of, straight, tree, tube, wood

from vegtool.arrays import FloatArray
from vegtool.plant import Material, Plant, Texture
from vegtool.refine.face_texels import face_colors, opacities
from vegtool.refine.hits import Rays, hits, rays_met
from vegtool.refine.wood_choice import THICKEST, Screen
from vegtool.refine.wood_lumps import Surface, lumps
from vegtool.refine.wood_seen import seen_through
from vegtool.refine.wood_stems import Stems, halved, stems_of
from vegtool.srgb import linear_from_srgb


def box(size: FloatArray) -> FloatArray:
    """(12, 3, 3) corners."""
    grid = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)]) * size
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return grid[[[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]]


def stems(plant: Plant) -> Stems:
    found = stems_of(plant, all_of(plant))
    assert found is not None
    return found


def test_the_mean_shadow_of_a_convex_body_is_a_quarter_of_its_surface() -> None:
    corners = box(np.array([1.0, 2, 3]))
    rays = Rays.around(corners, half=True)
    assert rays_met(rays, hits(rays, corners)).sum() * rays.cell == pytest.approx(22 / 4, rel=0.01)


def test_every_stretch_has_the_surface_that_stands_there() -> None:
    plant = wood(straight(np.zeros(3), np.array([0.0, 4, 0]), 0.2, rings=9))
    found = stems(plant)
    assert found.first.tolist() == [0] and found.last.tolist() == [8]
    ring = np.repeat(np.arange(8), 24)
    expected = np.bincount(ring, plant.face_areas) / found.radius**2
    surfaces = np.sort(found.area[1:])  # from whichever end
    assert surfaces == pytest.approx(np.sort(expected))
    assert found.area[0] == 0
    ends = found.node[[0, 8]] * found.radius + found.center
    assert np.sort(ends[:, 1]) == pytest.approx([0, 4], abs=1e-9)


def test_halves_are_those_of_douglas_and_peucker() -> None:
    # the plain recursion, at every tolerance
    generator = np.random.default_rng(3)
    node = np.cumsum(generator.normal(size=(40, 3)), axis=0)
    girth = np.ones(40)

    def plain(a: int, b: int, tolerance: float) -> set[int]:
        line, inner = node[b] - node[a], node[a + 1 : b] - node[a]
        if not len(inner):
            return set()
        part = np.clip(inner @ line / (line @ line), 0, 1)
        away = np.linalg.norm(inner - part[:, None] * line, axis=1)
        if away.max() <= tolerance:
            return set()
        middle = a + 1 + int(away.argmax())
        return {middle} | plain(a, middle, tolerance) | plain(middle, b, tolerance)

    spans = halved(node, girth, np.array([0]), np.array([39]))
    for tolerance in (0.5, 1.0, 2.0, 4.0):
        kept: set[int] = set()
        open_span = np.zeros(len(spans.a), dtype=bool)
        for span in range(len(spans.a)):
            parent = spans.parent[span]
            open_span[span] = (parent < 0 or open_span[parent]) and spans.deviation[
                span
            ] > tolerance
            if open_span[span]:
                kept.add(int(spans.middle[span]))
        assert kept == plain(0, 39, tolerance)


def test_a_price_takes_no_more_than_it_is_worth() -> None:
    screen = Screen.of(stems(tree()), 0.05)
    triangles, wrong = zip(
        *((c.triangles, c.wrong) for c in map(screen.choice, np.geomspace(1e-3, 1e5, 30))),
        strict=True,
    )
    assert list(triangles) == sorted(triangles, reverse=True)
    assert wrong[-1] > 10 * wrong[0]
    assert triangles[-1] <= 2  # everything is shown by one stem


def test_stems_in_place_of_others_show_their_surface() -> None:
    found = stems(tree(200))
    screen = Screen.of(found, 0.5)
    for price in (0.01, 0.3, 1.0):
        choice = screen.choice(price)
        assert (choice.wider @ screen.covered) == pytest.approx(screen.covered.sum())
    few = screen.choice(1000.0)  # but none becomes a club
    assert (few.wider * screen.thick <= np.maximum(screen.thick, THICKEST) + 1e-9).all()
    assert (few.wider > 0).sum() == 1


def root_flare() -> Plant:
    """A trunk whose foot has five roots, so that its rings are no circles."""
    height = np.linspace(0, 6, 14)
    positions, faces = tube(
        np.stack([0 * height, height, 0 * height], axis=1), 1 - height / 10, sides=30
    )
    turn = np.arctan2(positions[:, 2], positions[:, 0])
    foot = np.clip(1 - positions[:, 1] / 4, 0, 1)
    positions[:, [0, 2]] *= (1 + 0.8 * foot * np.cos(5 * turn))[:, None]
    return wood((positions, faces))


def test_what_is_not_round_is_collapsed() -> None:
    found = stems(root_flare())
    (solid,) = found.solids
    counts = [len(lump.faces) for lump in solid.lumps]
    assert counts == sorted(counts, reverse=True)
    assert solid.lumps[0].wrong < 0.01 * solid.lumps[-1].wrong + 1e-12
    assert not stems(tree()).solids


def test_lumps_cover_as_much_as_the_whole() -> None:
    plant = root_flare()
    surface = Surface(
        np.array(plant.positions),
        plant.faces.astype(np.int64),
        np.full((len(plant.faces), 3), 0.5),
        np.stack([0 * np.arange(7), np.arange(7), 0 * np.arange(7)], axis=1).astype(float),
    )
    covered, found = lumps(surface)
    rays = Rays.around(plant.corners)
    assert len(found) > 5
    for lump in found[:-3]:  # the last are too crude to be swollen enough
        drawn = rays_met(rays, hits(rays, lump.positions[lump.faces])).sum() * rays.cell
        assert drawn == pytest.approx(covered, rel=0.05)
        assert np.allclose(np.linalg.norm(lump.normals, axis=1), 1)
        assert lump.colors == pytest.approx(0.5)


def test_colour_is_texture_times_factor_times_vertex_colour_in_linear_light() -> None:
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:, :4, 0] = 0  # the left half has no red
    pixels[..., 1] = 128
    plant = wood((np.eye(3), np.array([[0, 1, 2]])), color=np.array([1.0, 0.5, 0.25]))
    bark = Material("bark", np.array([1.0, 0.5, 1, 1]), Texture("bark", pixels))
    for u, red in ((0.1, 0.0), (0.9, 1.0), (1.9, 1.0), (-0.9, 0.0)):
        uvs = np.full((3, 2), u) + np.array([[0, 0], [0.01, 0], [0, 0.01]])
        painted = replace(plant, materials=(bark,), uvs=uvs)
        green = float(linear_from_srgb(np.array(128 / 255)))
        expected = [red, green * 0.5 * 0.5, 0.25]
        assert face_colors(painted, all_of(plant))[0] == pytest.approx(expected)


def wall(holes: bool) -> tuple[Plant, FloatArray]:
    """A closed wall of leaves around the middle, whole or with every other one cut out."""
    corners = np.concatenate([box(np.full(3, 2.0)) - 1.0])
    middle = (corners[:, [0, 1, 2]] + corners[:, [1, 2, 0]]) / 2
    for _ in range(3):  # four triangles of each
        corners = np.concatenate(
            [
                np.stack([corners[:, 0], middle[:, 0], middle[:, 2]], axis=1),
                np.stack([corners[:, 1], middle[:, 1], middle[:, 0]], axis=1),
                np.stack([corners[:, 2], middle[:, 2], middle[:, 1]], axis=1),
                middle,
            ]
        )
        middle = (corners[:, [0, 1, 2]] + corners[:, [1, 2, 0]]) / 2
    if holes:
        corners = corners[::2]
    n = 3 * len(corners)
    leaf = Material("leaf", role="leaf", double_sided=True)
    return Plant(
        "wall", corners.reshape(-1, 3), np.tile([0.0, 1, 0], (n, 1)), np.zeros((n, 2)),
        np.arange(n, dtype=np.int32).reshape(-1, 3), np.zeros(n // 3, np.int32), (leaf,),
    ), np.zeros((1, 3))  # fmt: skip


def test_leaves_hide_what_is_behind_them() -> None:
    # one closed layer lets 1 / e through by the law, half a layer more
    (whole, points), (half, _) = wall(holes=False), wall(holes=True)
    seen, covered = seen_through(whole, all_of(whole), points)
    through, less = seen_through(half, all_of(half), points)
    assert 0.2 < seen[0] < 0.5 < through[0] < 0.75
    assert covered > less > 0
    outside, _ = seen_through(whole, all_of(whole), np.array([[50.0, 0, 0]]))
    assert outside[0] > seen[0]


def test_what_is_cut_out_hides_nothing() -> None:
    plant, points = wall(holes=False)
    clear = np.zeros((4, 4, 4), np.uint8)
    leaf = replace(plant.materials[0], alpha_mode="mask", color_texture=Texture("leaf", clear))
    gone = replace(plant, materials=(leaf,))
    assert not opacities(gone, all_of(gone)).any()
    seen, covered = seen_through(gone, all_of(gone), points)
    assert seen[0] == 1 and covered == 0
    # a material may be cut away by its factor alone
    leaf = replace(leaf, color_texture=None, base_color=np.array([1.0, 1, 1, 0.4]))
    assert not opacities(replace(gone, materials=(leaf,)), all_of(gone)).any()
