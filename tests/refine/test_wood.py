"""Reduced wood covers what the wood covers, within its triangles, whatever it is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from wood_cases import all_of, straight, tree, tube, wood

from vegtool.arrays import FloatArray
from vegtool.plant import Material, Plant
from vegtool.refine.hits import Rays, hits, rays_met
from vegtool.refine.wood import Wood, reduced_wood, stems_of, wood_triangles
from vegtool.refine.wood_choice import Screen
from vegtool.refine.wood_mesh import joined

FINE = 1e-3
"""Metres per pixel at which all of these are large on the screen."""
COARSE = 0.5
"""Metres per pixel at which their twigs are thin."""


def reduced(plant: Plant, triangles: int, pixel_m: float = FINE) -> Wood:
    stems = stems_of(plant, all_of(plant))
    assert stems is not None
    made = reduced_wood(stems, triangles, pixel_m)
    assert made is not None
    return made


def covered(corners: FloatArray, like: FloatArray) -> float:
    """What triangles cover in the mean over many views, on grids around others."""
    rays = Rays.around(like, directions=24, cells=300)
    return float(rays_met(rays, hits(rays, corners)).sum() * rays.cell)


def mean_shadow(made: Wood) -> float:
    """What sheets cover of which none hides another: half of their area (Cauchy)."""
    a, b, c = (made.positions[made.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 4)


@pytest.mark.parametrize("triangles", [4, 6, 10, 14, 28, 200])
def test_a_tube_covers_as_much_with_any_number_of_triangles(triangles: int) -> None:
    # two sides of a triangular prism have its outline, so even four triangles do
    plant = wood(straight(np.zeros(3), np.array([1.0, 4, 2]), 0.08))
    made = reduced(plant, triangles)
    assert len(made.faces) <= triangles
    truth = covered(plant.corners, plant.corners)
    assert covered(made.positions[made.faces], plant.corners) == pytest.approx(truth, rel=0.03)


def test_ribbons_cover_as_much_as_thin_tubes_in_the_mean() -> None:
    # a sheet seen from both sides covers half of its area, a tube a quarter
    generator = np.random.default_rng(0)
    ends = generator.normal(size=(300, 2, 3)) * 10
    plant = wood(*(straight(a, b, 0.01) for a, b in ends))
    made = reduced(plant, 300, COARSE)
    assert made.drawn <= len(made.faces) <= 300
    assert mean_shadow(made) == pytest.approx(plant.face_areas.sum() / 4, rel=0.03)


def test_few_triangles_stand_for_all_stems_alike() -> None:
    # the mean over all views of what is drawn stays, even where most stems are left out
    generator = np.random.default_rng(0)
    ends = generator.normal(size=(300, 2, 3)) * 10
    plant = wood(*(straight(a, b, 0.01) for a, b in ends))
    made = reduced(plant, 60, COARSE)
    assert made.stems == 300
    assert 20 < made.drawn <= 60
    assert mean_shadow(made) == pytest.approx(plant.face_areas.sum() / 4, rel=1e-3)


def test_a_curve_is_followed_as_closely_as_its_triangles_allow() -> None:
    turn = np.linspace(0, np.pi, 33)
    path = 3 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    plant = wood(tube(path, np.full(33, 0.1)))
    wrong = []
    rays = Rays.around(plant.corners)
    truth = rays_met(rays, hits(rays, plant.corners))
    for triangles in (8, 24, 80, 320):
        made = reduced(plant, triangles)
        drawn = rays_met(rays, hits(rays, made.positions[made.faces]))
        wrong.append((drawn != truth).sum() / truth.sum())
    assert wrong == sorted(wrong, reverse=True)
    assert wrong[0] > 1  # a straight line in place of half a circle
    assert wrong[-1] < 0.1


@pytest.mark.parametrize("triangles", [2, 3, 7, 20, 55, 150, 1000, 100_000])
@pytest.mark.parametrize("pixel_m", [FINE, COARSE, 20.0])
def test_no_more_triangles_than_asked_for(triangles: int, pixel_m: float) -> None:
    stems = stems_of(plant := tree(), all_of(plant))
    assert stems is not None
    made = reduced_wood(stems, triangles, pixel_m)
    assert made is not None
    assert 0 < len(made.faces) <= triangles
    assert np.isfinite(made.positions).all()
    assert np.allclose(np.linalg.norm(made.normals, axis=1), 1)
    assert made.faces.max() < len(made.positions)


def test_triangles_buy_accuracy() -> None:
    wrong = [reduced(tree(), count, 0.05).wrong_m2 for count in (10, 40, 160, 640)]
    assert wrong == sorted(wrong, reverse=True)


def test_stems_start_on_the_stems_that_they_grow_from() -> None:
    # however straight these have become: at the end of the fine line's nearest point on the coarse
    stems = stems_of(plant := tree(), all_of(plant))
    assert stems is not None
    choice = Screen.of(stems, 0.3).choice(0.5)
    shown = choice.wider > 0
    kept = np.zeros(len(stems.node), dtype=bool)
    kept[stems.first[shown]] = kept[stems.last[shown]] = True
    kept[stems.spans.middle[choice.halved]] = True
    at = joined(stems, np.flatnonzero(kept), shown)
    trunk = at[np.flatnonzero(kept & (stems.stem == 0))]
    assert 2 < len(trunk) < 16  # straightened, but not to one line
    twigs = np.flatnonzero(shown & (stems.host == 0))
    assert len(twigs) > 10
    for start in at[stems.first[twigs]]:
        a, b = trunk[:-1], trunk[1:]
        part = ((start - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
        foot = a + np.clip(part, 0, 1)[:, None] * (b - a)
        assert np.linalg.norm(foot - start, axis=1).min() < 1e-9
    assert (stems.host[1:] == 0).all()


@pytest.mark.parametrize("shift", [0.0, 1e6])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_place_and_size_do_not_matter(shift: float, scale: float) -> None:
    plant = tree()
    moved = replace(plant, positions=plant.positions * scale + shift * scale)
    one, other = reduced(plant, 120, 0.05), reduced(moved, 120, 0.05 * scale)
    assert abs(len(one.faces) - len(other.faces)) <= 4  # roundings may turn a choice
    assert mean_shadow(other) == pytest.approx(mean_shadow(one) * scale**2, rel=1e-2)
    low, high = moved.bounds
    assert (other.positions > low - scale).all()
    assert (other.positions < high + scale).all()


def test_turning_the_plant_changes_no_more_than_directions() -> None:
    plant = tree()
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    turned = replace(plant, positions=plant.positions @ turn.T)
    one, other = reduced(plant, 300, 0.05), reduced(turned, 300, 0.05)
    assert len(other.faces) == pytest.approx(len(one.faces), abs=30)
    truth = covered(turned.corners, turned.corners)
    drawn = [
        covered(one.positions[one.faces], plant.corners),
        covered(other.positions[other.faces], turned.corners),
    ]
    assert drawn[1] == pytest.approx(drawn[0], rel=0.01)
    # twigs that end in points are thicker at their feet, which are inside the trunk
    assert drawn[0] == pytest.approx(truth, rel=0.07)


def test_the_same_wood_makes_the_same_mesh_and_stays_as_it_is() -> None:
    plant = tree()
    before = {name: getattr(plant, name).copy() for name in ("positions", "faces", "colors")}
    faces = all_of(plant)
    one, other = reduced(plant, 90, 0.1), reduced(tree(), 90, 0.1)
    for name in ("positions", "normals", "colors", "faces"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    for name, value in before.items():
        assert np.array_equal(getattr(plant, name), value)
    assert np.array_equal(faces, all_of(plant))


def test_triangles_are_counter_clockwise_from_outside() -> None:
    made = reduced(wood(straight(np.zeros(3), np.array([0.0, 4, 0]), 0.2)), 200)
    a, b, c = (made.positions[made.faces[:, k]] for k in range(3))
    outwards = (a + b + c) / 3 * [1, 0, 1]
    normal = np.cross(b - a, c - a)
    assert ((normal * outwards).sum(axis=1) > 0).all()
    facing = (made.normals[made.faces].mean(axis=1) * normal).sum(axis=1)
    assert (facing > 0).all()


def test_colour_stays_on_its_side_and_in_the_mean() -> None:
    positions, faces = straight(np.zeros(3), np.array([0.0, 4, 0]), 0.2)
    red = np.where(positions[:, :1] > 0, [[1.0, 0, 0]], [[0.0, 0, 1]])
    made = reduced(wood((positions, faces), color=red), 200)
    side = made.positions[:, 0]
    # a step has a first harmonic of 4 / pi of its half height: 0.5 + 0.64 is above 1
    assert (made.colors[side > 0.1, 0] > 0.8).all()
    assert (made.colors[side < -0.1, 0] < 0.2).all()
    corners = made.positions[made.faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    mean = np.average(made.colors[made.faces].mean(axis=1), axis=0, weights=area)
    assert mean == pytest.approx([0.5, 0, 0.5], abs=0.1)


def board(double_sided: bool) -> Plant:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [1, 3, 0], [0, 3, 0]])
    return wood((positions, np.array([[0, 1, 2], [0, 2, 3]])), double_sided=double_sided)


def test_a_sheet_stays_a_sheet_that_faces_its_way() -> None:
    made = reduced(board(double_sided=True), 20)
    assert np.abs(made.normals[:, 2]) == pytest.approx(1, abs=1e-6)
    assert mean_shadow(made) == pytest.approx(3 / 2, rel=1e-6)


def test_a_sheet_seen_from_one_side_covers_half_of_that() -> None:
    assert mean_shadow(reduced(board(double_sided=False), 20)) == pytest.approx(3 / 4, rel=1e-6)


def ball() -> Plant:
    up, turn = np.meshgrid(np.linspace(0, np.pi, 9), np.arange(12) * np.pi / 6, indexing="ij")
    positions = np.stack(
        [np.sin(up) * np.cos(turn), np.cos(up), np.sin(up) * np.sin(turn)], axis=-1
    ).reshape(-1, 3)
    i, j = np.arange(8)[:, None] * 12, np.arange(12)
    a, b = i + j, i + (j + 1) % 12
    faces = np.stack([a, a + 12, b + 12, a, b + 12, b], axis=-1).reshape(-1, 3)
    return wood((positions, faces))


def box() -> Plant:
    positions = np.array([[x, y, z] for x in (0.0, 4) for y in (0.0, 1) for z in (0.0, 0.1)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)]
    return wood((positions, np.array(faces)))


@pytest.mark.parametrize("triangles", [20, 30, 1000])
@pytest.mark.parametrize("shape", [ball, box])
def test_what_is_no_tube_covers_about_as_much(shape: Callable[[], Plant], triangles: int) -> None:
    plant = shape()
    made = reduced(plant, triangles)
    assert len(made.faces) <= triangles
    truth = covered(plant.corners, plant.corners)
    assert covered(made.positions[made.faces], plant.corners) == pytest.approx(truth, rel=0.12)


def test_one_triangle() -> None:
    plant = wood((np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])))
    made = reduced(plant, 2, 10.0)
    assert mean_shadow(made) == pytest.approx(0.5 / 4, rel=0.01)


def test_nothing_to_draw() -> None:
    plant = tree(2)
    assert stems_of(plant, np.empty(0, np.int32)) is None
    point = wood((np.ones((3, 3)), np.array([[0, 1, 2], [0, 0, 1]])))
    assert stems_of(point, all_of(point)) is None
    stems = stems_of(plant, all_of(plant))
    assert stems is not None
    assert reduced_wood(stems, 0, 1.0) is None


@pytest.mark.parametrize("pixel_m", [0.0, -1.0, np.nan, np.inf])
def test_a_pixel_has_a_size(pixel_m: float) -> None:
    stems = stems_of(plant := tree(2), all_of(plant))
    assert stems is not None
    with pytest.raises(ValueError, match="pixel_m: expected a length"):
        reduced_wood(stems, 10, pixel_m)


def test_faces_without_area_and_stray_triangles_do_not_matter() -> None:
    plant = tree(5)
    flat = np.array([[0, 0, 1], [3, 3, 3]], np.int32)
    stray = plant.positions[:3] + np.array([0.3, 0, 0])
    messy = wood(
        (np.concatenate([plant.positions, stray]),
         np.concatenate([plant.faces, flat, [[len(plant.positions) + i for i in range(3)]]])),
    )  # fmt: skip
    made = reduced(messy, 200, 0.05)
    assert mean_shadow(made) > 0


def hidden_tree(leaves: bool) -> Plant:
    """A tree whose upper half is wrapped in leaves."""
    plant = tree()
    if not leaves:
        return plant
    generator = np.random.default_rng(2)
    corners = generator.uniform([-2.5, 6, -2.5], [2.5, 12, 2.5], (4000, 1, 3))
    corners = corners + generator.normal(size=(4000, 3, 3)) * 0.25
    n, count = len(plant.positions), 12_000
    return Plant(
        name="hidden",
        positions=np.concatenate([plant.positions, corners.reshape(-1, 3)]),
        normals=np.tile([0.0, 1.0, 0.0], (n + count, 1)),
        uvs=np.zeros((n + count, 2)),
        faces=np.concatenate([plant.faces, np.arange(n, n + count, dtype=np.int32).reshape(-1, 3)]),
        face_material=np.repeat([0, 1], [len(plant.faces), 4000]).astype(np.int32),
        materials=(*plant.materials, Material("leaf", role="leaf", double_sided=True)),
    )


def test_triangles_go_where_leaves_do_not_hide_the_wood() -> None:
    bare, hidden = hidden_tree(leaves=False), hidden_tree(leaves=True)
    upper = []
    for plant in (bare, hidden):
        stems = stems_of(plant, np.arange(len(bare.faces), dtype=np.int32))
        assert stems is not None
        made = reduced_wood(stems, 150, 0.05)
        assert made is not None
        upper.append((made.positions[made.faces].mean(axis=1)[:, 1] > 6).sum() / len(made.faces))
    assert upper[1] < 0.8 * upper[0]


def test_wood_gets_a_share_of_a_level() -> None:
    shares = []
    for plant in (hidden_tree(leaves=False), hidden_tree(leaves=True)):
        own = np.flatnonzero(plant.face_material == 0).astype(np.int32)
        stems = stems_of(plant, own)
        assert stems is not None
        shares.append(wood_triangles(stems, 1000, 0.05))
    assert 30 <= shares[1] < shares[0] <= 500  # where wood is all there is, it deserves more


@pytest.mark.models
@pytest.mark.parametrize(
    "name, triangles",
    [("eztree_ash_small", 220), ("q_mega_commontree_1", 150), ("sapling_callistemon_bush", 900)],
)
def test_wood_of_real_plants_covers_as_much(models: Path, name: str, triangles: int) -> None:
    from vegtool.formats import read_plant

    file = next(iter([*(models / name).rglob("*.glb"), *(models / name).rglob("*.gltf")]))
    plant = read_plant(file)
    own = np.flatnonzero(~plant.face_is_leaf).astype(np.int32)
    stems = stems_of(plant, own)
    assert stems is not None
    made = reduced_wood(stems, triangles, plant.extent / 200)
    assert made is not None
    assert 0.7 * triangles < len(made.faces) <= triangles
    corners = plant.corners[own]
    truth = covered(corners, corners)
    assert covered(made.positions[made.faces], corners) == pytest.approx(truth, rel=0.05)
