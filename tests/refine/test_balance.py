"""Levels brought to the brightness of their plant from all sides: the algebra, and real levels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hybrids import hybrid_of

from vegtool.arrays import FloatArray, unit
from vegtool.gl.draw import draw
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.leaves import translucent
from vegtool.lighting.light import Light
from vegtool.lod import Display, Level
from vegtool.measure.pictures import client_plant, shot_of
from vegtool.measure.views import around, views
from vegtool.plant import Material, Plant
from vegtool.refine.balance import (
    BRIGHTER,
    MOST_TURN,
    RIDGE,
    Samples,
    _brightness,
    _matrices,
    balanced,
    best_bend,
    ridge,
)
from vegtool.refine.bend import Bend, bent
from vegtool.refine.brightness import (
    LOW_VIEWS,
    PIXELS,
    SUPERSAMPLE,
    VIEWS,
    Brightness,
    brightness_of,
)
from vegtool.refine.color import LEAST_GAIN, MOST_GAIN, luminances, scaled
from vegtool.refine.drawn import drawn
from vegtool.refine.retouch import rotated
from vegtool.seeding import generator

FEW = 24
"""Views, where those of a level are not what matters."""


def random_samples(seed: int, views: int = 3, elements: int = 5, count: int = 400) -> Samples:
    random = generator(seed, "samples")
    view = random.integers(0, views, count)
    normal, plane = (unit(random.normal(size=(count, 3))) for _ in range(2))
    return Samples(
        elements,
        np.bincount(view, minlength=views).astype(np.int32),
        view.astype(np.int32),
        random.integers(0, elements, count).astype(np.int32),
        random.uniform(0.1, 0.6, count),
        random.uniform(0.1, 0.6, count),
        normal,
        np.where((normal * plane).sum(axis=1, keepdims=True) < 0, -plane, plane),
        random.uniform(0, 1, (count, 2)),
        random.uniform(0, 1, count),
        random.random(count) < 0.7,
    )


def made_brightness(views: int, lights: tuple[Light, ...], seed: int = 0) -> Brightness:
    values = generator(seed, "brightness").uniform(0.1, 0.4, (views, len(lights)))
    return Brightness(Display(), (), lights, values)


LIGHTS = (Light(), Light(np.array([-1.0, 0.3, 0.2]), 0.9, 0.5, 0.1), Light(sun=0.0))


@pytest.mark.parametrize("seed", range(3))
def test_rows_add_up_to_the_brightness_of_the_level(seed: int) -> None:
    """As a share of the plant's, light by light and view by view."""
    samples, wanted = random_samples(seed), made_brightness(3, LIGHTS)
    shown, _ = _matrices(samples, wanted, np.array([True, False, True]))
    expected = (_brightness(samples, wanted) / wanted.values)[[0, 2]].T.ravel()
    np.testing.assert_allclose(shown.sum(axis=1), expected)


@pytest.mark.parametrize("element", range(5))
@pytest.mark.parametrize("axis", range(3))
def test_turning_columns_are_the_derivative_by_turns(element: int, axis: int) -> None:
    """By small turns either way of all normals of one element, brightness found anew."""
    samples, wanted = random_samples(7), made_brightness(3, LIGHTS)
    _, turning = _matrices(samples, wanted, np.ones(3, dtype=bool))
    step = 1e-6 * np.eye(3)[axis] * (samples.element == element)[:, None]
    up, down = (
        _brightness(replace(samples, normal=rotated(samples.normal, s)), wanted)
        for s in (step, -step)
    )
    expected = ((up - down) / 2e-6 / wanted.values).T.ravel()
    np.testing.assert_allclose(turning[:, 5 * axis + element], expected, atol=1e-7)
    assert np.abs(expected).max() > 1e-3


def test_views_that_show_nothing_count_for_nothing() -> None:
    samples = random_samples(0)
    none = replace(samples, count=np.array([*samples.count, 0], np.int32))
    wanted = made_brightness(4, LIGHTS)
    shown, turning = _matrices(none, wanted, none.count > 0)
    assert shown.shape == (9, 5) and turning.shape == (9, 15)
    all_rows, _ = _matrices(none, wanted, np.ones(4, dtype=bool))
    assert not all_rows[3::4].any()


def test_of_many_elements_fewer_suns_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every second one here."""
    samples, wanted = random_samples(2), made_brightness(3, LIGHTS)
    every, _ = _matrices(samples, wanted, np.ones(3, dtype=bool))
    monkeypatch.setattr("vegtool.refine.balance.FINE", 5)
    monkeypatch.setattr("vegtool.refine.balance.LEAST_SUNS", 1)
    fewer, turning = _matrices(samples, wanted, np.ones(3, dtype=bool))
    np.testing.assert_array_equal(fewer, every.reshape(3, 3, 5)[::2].reshape(6, 5))
    assert turning.shape == (6, 15)


def parts(rows: int, elements: int, seed: int = 0) -> FloatArray:
    """What elements show, rows that sum to BRIGHTER."""
    shown = generator(seed, "parts").uniform(0, 1, (rows, elements))
    return np.asarray(shown * (BRIGHTER / shown.sum(axis=1, keepdims=True)))


def test_where_nothing_is_wrong_nothing_changes() -> None:
    shown = parts(20, 6)
    turning = generator(1, "turning").normal(size=(20, 18)) * 0.1
    gain, turn = ridge(shown, turning)
    np.testing.assert_allclose(gain, 1.0, atol=1e-12)
    np.testing.assert_allclose(turn, 0.0, atol=1e-12)


@pytest.mark.parametrize("turns", [0.0, 0.1])
def test_a_level_too_bright_from_one_side_gets_closer(turns: float) -> None:
    """10 %; and as a whole it gets no worse."""
    shown = parts(20, 6)
    shown[3] *= 1.1
    turning = generator(1, "turning").normal(size=(20, 18)) * turns
    gain, turn = ridge(shown, turning)
    after = shown @ gain + turning @ turn.T.ravel()
    before = shown.sum(axis=1)
    assert abs(after[3] - BRIGHTER) < 0.9 * abs(before[3] - BRIGHTER)
    assert np.linalg.norm(after - BRIGHTER) < np.linalg.norm(before - BRIGHTER)


def test_it_is_the_least_of_errors_and_changes_together() -> None:
    """The primal problem, of least squares, as its oracle: as large as there are elements."""
    shown = parts(12, 5) * generator(2, "wrong").uniform(0.9, 1.1, (12, 1))
    turning = generator(3, "turning").normal(size=(12, 15)) * 0.1
    matrix = np.concatenate([shown, turning], axis=1)
    cost = RIDGE * np.trace(matrix @ matrix.T) / 12
    rows = np.concatenate([matrix, np.sqrt(cost) * np.eye(20)])
    wanted = np.concatenate([BRIGHTER - shown.sum(axis=1), np.zeros(20)])
    change = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    gain, turn = ridge(shown, turning)
    np.testing.assert_allclose(gain, 1 + change[:5])
    np.testing.assert_allclose(turn, change[5:].reshape(3, 5).T)


def test_changes_have_limits() -> None:
    """An element that shows a hundredth of what it should, or a hundred times it."""
    none = np.zeros((3, 3))
    gain, _ = ridge(np.full((3, 1), 0.01), none)
    assert gain == pytest.approx(MOST_GAIN)
    gain, _ = ridge(np.full((3, 1), 100.0), none)
    assert gain == pytest.approx(LEAST_GAIN)
    turning = np.concatenate([np.full((3, 1), 0.02), np.zeros((3, 2))], axis=1)
    _, turn = ridge(np.full((3, 1), 1e-3), turning)
    assert np.linalg.norm(turn) == pytest.approx(MOST_TURN)
    gain, turn = ridge(np.zeros((2, 3)), np.zeros((2, 9)))
    assert (gain == 1).all() and not turn.any(), "nothing can be done"


@dataclass(frozen=True, eq=False)
class Tree:
    """A plant, how bright it is, and a level that is right on the whole."""

    buffers: PlantBuffers
    wanted: Brightness
    level: Level

    @property
    def plant(self) -> Plant:
        return self.buffers.plant


def few_views(buffers: PlantBuffers) -> Brightness:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vegtool.refine.brightness.VIEWS", FEW)
        return brightness_of(buffers, Display())


@pytest.fixture(scope="module")
def tree() -> Iterator[Tree]:
    plant = translucent(sample("broadleaf", 2000), 0.3)
    density = PIXELS / plant.extent
    level = replace(hybrid_of(plant, 60, density), near_distance_m=Display().distance_m(density))
    with PlantBuffers(plant) as buffers:
        yield Tree(buffers, brightness_of(buffers, Display()), level)


def ratios(level: Level, buffers: PlantBuffers) -> FloatArray:
    """(v,) brightness of the level to the plant's, drawn both, from views and under suns that
    balancing has not seen."""
    plant, display = buffers.plant, Display()
    distance = display.distance_m(PIXELS / plant.extent)
    held_out = views("all", 24, 0.5)
    cameras = [around(plant.positions, v.direction, distance, display) for v in held_out]
    lights = [Light(v.sun) for v in held_out]
    shown = luminances(drawn(level, cameras, lights))
    true = [
        draw(buffers, shot_of(camera), light, SUPERSAMPLE)
        for camera, light in zip(cameras, lights, strict=True)
    ]
    return np.asarray(shown / luminances(true))


def error(level: Level, buffers: PlantBuffers) -> float:
    return float(np.sqrt(np.mean((ratios(level, buffers) - BRIGHTER) ** 2)))


@pytest.mark.gl
def test_brightness_is_that_of_what_is_drawn(tree: Tree) -> None:
    assert tree.wanted.values.shape == (VIEWS + LOW_VIEWS, len(tree.wanted.lights))
    for view in (0, VIEWS // 2, VIEWS - 1):
        for number in (0, 5, len(tree.wanted.lights) - 1):
            shot = shot_of(tree.wanted.cameras[view])
            picture = draw(tree.buffers, shot, tree.wanted.lights[number], SUPERSAMPLE)
            found = tree.wanted.values[view, number]
            assert luminances([picture])[0] == pytest.approx(found, rel=2e-3)


@pytest.mark.gl
def test_a_level_is_nearer_to_its_plant_from_where_it_was_not_looked_at(tree: Tree) -> None:
    """By more than half a percent of brightness."""
    found = balanced(tree.level, tree.plant, tree.wanted)
    before, after = error(tree.level, tree.buffers), error(found, tree.buffers)
    assert after < before - 0.005
    assert abs(ratios(found, tree.buffers).mean() - BRIGHTER) < 0.03


@pytest.mark.gl
def test_its_outline_stays_and_inputs_too(tree: Tree) -> None:
    atlas, mesh = tree.level.atlas, tree.level.mesh
    assert atlas is not None and atlas.normal is not None and mesh is not None
    before = atlas.color.copy(), atlas.normal.copy(), np.array(mesh.colors)
    found = balanced(tree.level, tree.plant, tree.wanted)
    for a, b in zip(before, (atlas.color, atlas.normal, mesh.colors), strict=True):
        np.testing.assert_array_equal(a, np.asarray(b))
    assert found.atlas is not None and found.mesh is not None
    np.testing.assert_array_equal(found.atlas.color[..., 3], atlas.color[..., 3])
    np.testing.assert_array_equal(found.mesh.positions, mesh.positions)
    assert found.triangles == tree.level.triangles


@pytest.mark.gl
def test_a_level_of_two_sides_is_balanced_as_well(tree: Tree) -> None:
    """Its pictures behind have frames of their own, its wood stands in it twice."""
    single = tuple(replace(m, double_sided=False) for m in tree.plant.materials)
    plant = replace(tree.plant, materials=single)
    density = PIXELS / plant.extent
    level = replace(hybrid_of(plant, 60, density), near_distance_m=Display().distance_m(density))
    assert not level.double_sided
    with PlantBuffers(plant) as buffers:
        found = balanced(level, plant, few_views(buffers))
        assert error(found, buffers) < error(level, buffers)


@pytest.mark.gl
def test_the_plant_itself_needs_hardly_any_change(tree: Tree) -> None:
    """But for BRIGHTER. It has no colours of its own, so that normals alone may turn: by less than
    what is to be seen."""
    level = Level("mesh", mesh=tree.plant, near_distance_m=tree.level.near_distance_m)
    found = balanced(level, tree.plant, few_views(tree.buffers)).mesh
    assert found is not None and found.colors is None
    cosine = (found.normals * tree.plant.normals).sum(axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 2.0


@pytest.mark.gl
def test_a_level_of_which_nothing_is_seen_stays(tree: Tree) -> None:
    atlas = tree.level.atlas
    assert atlas is not None
    clear = atlas.color.copy()
    clear[..., 3] = 0
    empty = replace(tree.level, kind="billboards", mesh=None, atlas=replace(atlas, color=clear))
    assert balanced(empty, tree.plant, tree.wanted) is empty


@pytest.mark.gl
def test_a_black_plant_is_no_measure(tree: Tree) -> None:
    black = replace(tree.wanted, values=np.zeros_like(tree.wanted.values))
    assert balanced(tree.level, tree.plant, black) is tree.level


@pytest.mark.gl
def test_a_level_that_is_black_is_left_to_be_so(tree: Tree) -> None:
    """No factor makes it brighter."""
    black = scaled(tree.level, 0.0, 0.0)
    found = balanced(black, tree.plant, few_views(tree.buffers))
    assert found.mesh is not None and found.mesh.colors is not None
    assert not found.mesh.colors[:, :3].any()


def test_the_bend_that_was_wrong_is_found() -> None:
    """What a plant shows is that of the same samples, which lean less and look up less."""
    samples = random_samples(5, views=40, count=20_000)
    samples = replace(samples, transmission=np.zeros(20_000))
    lights = tuple(Light(v.sun) for v in views("all", 8))
    made = made_brightness(40, lights)
    level = Level("mesh", mesh=sample("bush", 300))
    for bend in (Bend(), Bend(1.0, 0.7)):
        true = bent(samples.normal, samples.plane, bend, samples.pictured)
        values = _brightness(replace(samples, normal=true), made)
        found = best_bend(level, samples, replace(made, values=values), np.ones(40, dtype=bool))
        assert found == bend


@pytest.mark.gl
def test_of_billboards_the_lean_is_found_too(tree: Tree) -> None:
    samples = random_samples(6, views=40, count=20_000)
    made = made_brightness(40, tuple(Light(v.sun) for v in views("all", 8)))
    true = bent(samples.normal, samples.plane, Bend(lean=0.55), samples.pictured)
    values = _brightness(replace(samples, normal=true), made)
    found = best_bend(tree.level, samples, replace(made, values=values), np.ones(40, dtype=bool))
    assert found == Bend(lean=0.55)


@pytest.mark.gl
def test_a_plain_mesh_of_one_colour_becomes_as_bright_as_the_plant(tree: Tree) -> None:
    """Of its own colours, too dark by a third."""
    plain = Material("plain", double_sided=True)
    count = len(tree.plant.positions)
    mesh = replace(
        tree.plant,
        materials=(plain,),
        face_material=np.zeros(len(tree.plant.faces), np.int32),
        colors=np.tile([0.03, 0.06, 0.01, 1.0], (count, 1)),
        branches=None,
    )
    level = Level("mesh", mesh=mesh, near_distance_m=tree.level.near_distance_m)
    with PlantBuffers(mesh) as buffers:
        wanted = few_views(buffers)
        dark = scaled(level, 1.0, 0.67)
        found = balanced(dark, mesh, wanted)
        assert error(found, buffers) < 0.5 * error(dark, buffers)
        assert len(client_plant(found).faces) == len(mesh.faces)
