"""A square with fewer triangles: within its budget, in its place, as bright; the same again."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from cards import cards, texture, together

from vegtool.arrays import FloatArray
from vegtool.boxes import error
from vegtool.formats import read_plant
from vegtool.formats.gltf_tile import far_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display, Level
from vegtool.measure.pictures import client_plant, truth
from vegtool.measure.scores import scores
from vegtool.plant import Material, Plant
from vegtool.refine.foliage import Leaves, leaves_of
from vegtool.seeding import generator
from vegtool.tiles import recluster
from vegtool.tiles.far_planes import far_planes, rectangles
from vegtool.tiles.leaf_groups import by_place, leaf_groups
from vegtool.tiles.recluster import drawing, group_of, looks, reclustered

SIDE, AWAY = 64.0, 80.0
"""Metres of ground, and from where it is seen."""
GREEN = Material("green", [0.2, 0.4, 0.1, 1], double_sided=True, role="leaf")
LEAF = Material(
    "leaf", color_texture=texture(np.full((8, 8, 4), (120, 160, 60, 255)), "leaf"),
    alpha_mode="mask", double_sided=True, role="leaf",
)  # fmt: skip
DISPLAY = Display()


def quarter(count: int, material: Material = GREEN, seed: int = 0) -> Plant:
    """Cards over a quarter's ground, up to 6 m high; all of another size, so that no halving has a
    choice that rounding makes."""
    rng = generator(seed, "quarter")
    low, high = np.array([-SIDE / 4, 0, -SIDE / 4]), np.array([SIDE / 4, 6, SIDE / 4])
    middles, half = rng.uniform(low, high, (count, 3)), rng.uniform(0.3, 0.5, count)
    return cards(middles, half, material, rng.normal(size=(count, 3)))


def square(count: int = 250, material: Material = GREEN) -> Plant:
    """Of four quarters of so many cards, about the origin."""
    places = [np.array([x, 0.0, z]) * SIDE / 4 for x in (-1, 1) for z in (-1, 1)]
    return group_of([quarter(count, material, seed) for seed in range(4)], places, "square")


def made(group: Plant, triangles: int) -> Level:
    return reclustered(group, triangles, AWAY, DISPLAY, 1024)


@pytest.fixture(params=[1e9, 0.0], ids=["triangles", "billboards"])
def small(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether groups are drawn as triangles, whatever their size."""
    monkeypatch.setattr(recluster, "SMALL", request.param)
    monkeypatch.setattr(recluster, "LEAST_PIECES", 512)
    monkeypatch.setattr(recluster, "MOST_PIECES", 512)
    monkeypatch.setattr(error, "SAMPLES", 2048)
    return bool(request.param)


def leaves(group: Plant) -> Leaves:
    found = leaves_of(group, np.arange(len(group.faces), dtype=np.int32))
    assert found is not None
    return found


@pytest.mark.parametrize("triangles", [1000, 101, 16, 2])
def test_no_more_triangles_than_asked_for_and_hardly_fewer(small: bool, triangles: int) -> None:
    level = made(square(), triangles)
    assert level.kind == ("mesh" if small else "billboards")
    assert 0.9 * triangles - 1 <= level.triangles <= triangles
    assert level.near_distance_m == AWAY and level.double_sided


def test_a_single_triangle_is_no_billboard(small: bool) -> None:
    assert (made(square(40), 1).kind, made(square(40), 1).triangles) == ("mesh", 1)


def test_it_stays_where_the_square_is(small: bool) -> None:
    """Within what one of 25 groups is wide, a fifth of 64 m: neither is its edge far from that of
    the square, nor are its tips."""
    group = square()
    bounds = client_plant(made(group, 50)).bounds
    assert np.abs(bounds - group.bounds).max() < 12.8


def test_the_error_is_in_metres_and_grows_as_triangles_get_fewer(small: bool) -> None:
    group = square()
    found = [made(group, triangles).geometric_error_m for triangles in (1000, 100, 10)]
    errors = [both[1] for both in found if both is not None]
    assert errors == sorted(errors) and 0 < errors[0] < 2 < errors[-1] < SIDE


def test_it_covers_as_much_and_is_as_bright(small: bool) -> None:
    """To a tenth, of 600 triangles seen by another filter than that by which they were solved."""
    group = square(600)
    level = made(group, 600)
    with PlantBuffers(group) as buffers:
        found = scores(looks(buffers, 2 * AWAY, DISPLAY), level).values
    assert np.abs(found["coverage_bias"].mean()) < 0.1
    assert np.abs(found["color_bias"].mean()) < 0.1


def test_the_same_bytes_twice(small: bool) -> None:
    group = square(150)
    before = [np.copy(getattr(group, f.name)) for f in fields(group) if f.name == "positions"]
    a, b = (far_glb(*drawing(made(group, 60)), "t") for _ in range(2))
    assert a == b
    np.testing.assert_array_equal(group.positions, before[0])


def test_a_moved_square_is_the_same_elsewhere(small: bool) -> None:
    """By a power of two, which hardly rounds."""
    group, away = square(150), np.array([4096.0, 0, -8192.0])
    a = made(group, 60)
    b = made(replace(group, positions=group.positions + away), 60)
    one, other = client_plant(a), client_plant(b)
    np.testing.assert_allclose(other.positions - away, one.positions, atol=1e-6)
    if one.colors is not None and other.colors is not None:
        np.testing.assert_allclose(other.colors, one.colors, atol=1e-6)


def test_what_fits_is_as_it_is() -> None:
    group = square(20)
    level = made(group, len(group.faces))
    assert level.mesh is group and level.geometric_error_m == (0.0, 0.0)
    assert made(group, len(group.faces) - 1).mesh is not group


def test_few_pictures_become_one_each(small: bool) -> None:
    """Cards with a picture have one of their own, in one atlas: four quarters are one draw call."""
    if small:
        return
    group = square(5, LEAF)
    level = made(group, 200)
    assert level.billboards is not None
    assert (level.triangles, len(level.billboards)) == (40, 20)
    turn = np.sqrt(2) * np.cos(np.pi / 4 - np.radians(7.5))  # at most, to the nearest of six
    half = np.sqrt(group.face_areas[::2] / 2)
    ratio = np.sort(level.billboards.half_size.max(axis=1)) / np.sort(half)
    assert ratio.min() > 1 - 1e-9 and ratio.max() < turn + 1e-9
    assert level.geometric_error_m is not None and level.geometric_error_m[0] < 1e-6


def test_a_quarter_may_have_nothing(small: bool) -> None:
    """Faces without area cover nothing, as do leaves that alpha cuts away."""
    bare = replace(GREEN, base_color=np.array([0.2, 0.4, 0.1, 0.0]), alpha_mode="mask")
    away = [np.array([16.0, 0, 0]), np.array([-16.0, 0, 0])]
    group = group_of([quarter(60), quarter(60, bare)], away, "half")
    level = made(group, 40)
    assert level.triangles <= 40 and client_plant(level).bounds[0, 0] > -4
    with pytest.raises(ValueError, match="covers something: none"):
        made(group_of([quarter(60, bare)], away[:1], "none"), 40)
    with pytest.raises(ValueError, match="at least one triangle, got 0"):
        made(group, 0)


def test_light_that_is_in_the_colours_stays_there(small: bool) -> None:
    group = square(100, replace(GREEN, unlit=True))
    level = made(group, 60)
    assert level.unlit and client_plant(level).materials[0].unlit
    if level.mesh is not None:
        assert level.mesh.colors is not None
        wanted = np.broadcast_to(GREEN.base_color[:3], level.mesh.colors[:, :3].shape)
        np.testing.assert_allclose(level.mesh.colors[:, :3], wanted, rtol=1e-6)
    else:
        assert level.atlas is not None and level.atlas.normal is None


def test_what_is_written_is_what_is_drawn(small: bool, tmp_path: Path) -> None:
    level = made(square(150), 60)
    triangles, pictures = drawing(level)
    (tmp_path / "t.glb").write_bytes(far_glb(triangles, pictures, "t"))
    found = read_plant(tmp_path / "t.glb")
    wanted = client_plant(level)
    step = float(np.ptp(wanted.positions, axis=0).max()) / 65535
    np.testing.assert_allclose(found.corners, wanted.corners, atol=step)
    assert len(found.materials) == 1 and found.materials[0].double_sided
    assert (found.materials[0].color_texture is None) == small
    if small:
        assert found.colors is not None and wanted.colors is not None
        np.testing.assert_allclose(found.colors, wanted.colors, atol=1 / 65535)


def test_a_group_written_as_it_is_keeps_the_colours_of_its_materials() -> None:
    red = replace(GREEN, base_color=np.array([0.5, 0.1, 0.1, 1]))
    both = together(quarter(5), quarter(7, red))
    triangles, pictures = drawing(made(both, 100))
    assert pictures is None and triangles.colors is not None
    colors = triangles.colors[triangles.indices].reshape(-1, 3, 4)
    assert (colors[:10] == GREEN.base_color).all() and (colors[10:] == red.base_color).all()


# --------------------------------------------------------------------------------- groups, planes


def by_sorting(place: FloatArray, weight: FloatArray, count: int) -> list[set[int]]:
    """Halved one group at a time."""
    todo, done = [(np.arange(len(place)), count)], list[set[int]]()
    while todo:
        rows, wanted = todo.pop()
        if wanted == 1:
            done.append(set(rows.tolist()))
            continue
        axis = np.ptp(place[rows], axis=0).argmax()
        rows = rows[np.argsort(place[rows, axis], kind="stable")]
        low = wanted // 2
        middle = np.cumsum(weight[rows]) - weight[rows] / 2
        cut = int((middle / weight[rows].sum() < low / wanted).sum())
        cut = min(max(cut, low), len(rows) - wanted + low)
        todo += [(rows[:cut], low), (rows[cut:], wanted - low)]
    return done


def test_groups_by_place_are_those_of_halving_one_by_one() -> None:
    rng = generator(2, "place")
    place, weight = rng.random((300, 3)) * (4, 1, 2), rng.random(300)
    for count in (1, 7, 64, 300):
        order, first = by_place(place, weight, count)
        found = [set(rows.tolist()) for rows in np.split(order, first[1:])]
        assert sorted(map(min, found)) == sorted(map(min, by_sorting(place, weight, count)))
        assert all(rows in found for rows in by_sorting(place, weight, count))


@pytest.mark.parametrize("count", [1, 3, 300, 999, 5000])
def test_groups_of_leaves_are_numbered_and_near(count: int) -> None:
    """Of several blocks, each label is used; and no group is much wider than its share of space."""
    found = leaves(square())
    label = leaf_groups(found, count, 1e-4)
    assert len(label) == len(found) == 2000
    used = np.unique(label)
    assert used.tolist() == list(range(len(used)))
    assert 0.95 * min(count, 2000) <= len(used) <= count
    if count == 999:
        wide = [np.ptp(found.middle[label == k], axis=0).max() for k in used]
        assert np.mean(wide) < 0.1


def test_leaves_on_planes_lie_on_those_planes() -> None:
    """Three fields of cards, one on each of three planes, of which each gets a billboard."""
    rng = generator(3, "fields")
    fields_of: list[Plant] = []
    for axis, shift in ((1, 0.0), (0, 40.0), (2, -40.0)):
        middles = rng.uniform(-5, 5, (60, 3))
        middles[:, axis] = shift
        fields_of.append(cards(middles, 0.3, GREEN, np.eye(3)[axis]))
    plant = together(*fields_of)
    found = leaves(plant)
    labels, billboards = far_planes(plant, found, np.arange(len(found)), 3, 1e-3)
    assert len(billboards) == 3
    for own in np.split(labels, 3):
        (number,) = np.unique(own)
        assert billboards.half_depth[number] < 1e-9
    across = np.abs(billboards.normal)[np.argsort(np.abs(billboards.normal).argmax(axis=1))]
    np.testing.assert_allclose(across, np.eye(3), atol=1e-9)
    assert (billboards.normal[:, 1] >= 0).all(), "fronts look up"


def test_rectangles_contain_what_they_show() -> None:
    rng = generator(4, "rectangles")
    corners, own = rng.normal(size=(90, 3, 3)), np.repeat([0, 1, 2], 30)
    normal = rng.normal(size=(3, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    middle = rng.normal(size=(3, 3)) * 0.1
    found = rectangles(corners, own, middle, normal)
    off = corners - found.center[own][:, None]
    for axis, half in ((found.u, found.half_size[:, 0]), (found.v, found.half_size[:, 1]),
                       (found.normal, found.half_depth)):  # fmt: skip
        reach = np.abs(np.einsum("fci,fi->fc", off, axis[own])).reshape(3, -1).max(axis=1)
        np.testing.assert_allclose(reach, half, rtol=1e-9)
    on_plane = np.einsum("ki,ki->k", found.center - middle, normal)
    np.testing.assert_allclose(on_plane, 0, atol=1e-9)


def test_one_sample_tells_as_much_as_many() -> None:
    """Means over all of a picture: those of 64 samples a pixel to 1 %, of which a square of 600
    cards has 10,000."""
    group = square(600)
    with PlantBuffers(group) as buffers:
        quick = looks(buffers, AWAY, DISPLAY)
        for camera, view, found in zip(
            quick.cameras[0], quick.views, quick.references[0], strict=True
        ):
            wanted = truth(buffers, camera, quick.light(view))
            covered = float(wanted[..., 3].sum())
            assert abs(found.covered / covered - 1) < 0.01


def test_a_square_on_a_cliff_is_looked_at_from_farther_away() -> None:
    """160 m high, and seen from 80 m: no eye there sees all of it."""
    low = square(20)
    shift = np.where(low.positions[:, :1] > 0, [[0, 160, 0]], 0)
    with PlantBuffers(replace(low, positions=low.positions + shift)) as buffers:
        found = looks(buffers, AWAY, Display(60.0, 100))
    assert 80 < found.distance_m[0] < 120
    assert all(one.covered > 0 for one in found.references[0])
