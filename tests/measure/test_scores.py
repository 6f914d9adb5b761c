"""Levels beside their truths, on shapes whose pictures are known."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.errors import UsageError
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display, Level
from vegtool.measure import scores as room
from vegtool.measure.metrics import METRICS
from vegtool.measure.scores import outside, scores, spread, truths
from vegtool.measure.views import views
from vegtool.plant import Material, Plant

pytestmark = pytest.mark.gl
SIZES = (25.0, 50.0)


def cube(size: float = 1.0, gray: float = 0.5, move: float = 0.0) -> Plant:
    """A cube, double-sided, with normals of its faces."""
    corners, normals, faces = [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            u = np.roll(normal, 1)
            v = np.cross(normal, u)
            base = len(corners)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corners.append((normal + a * u + b * v) * size / 2 + move)
                normals.append(normal)
            faces += [[base, base + 1, base + 2], [base, base + 2, base + 3]]
    material = Material("gray", base_color=[gray, gray, gray, 1.0], double_sided=True)
    uvs = np.zeros((len(corners), 2))
    return Plant("cube", corners, normals, uvs, faces, [0] * len(faces), (material,))


def level(plant: Plant) -> Level:
    return Level("mesh", mesh=plant)


def test_sizes_come_in_descending_order_with_the_distances_that_give_them() -> None:
    found = truths(cube(), views("all", 2), SIZES)
    assert found.pixels.tolist() == [50.0, 25.0]
    assert found.distance_m == pytest.approx([Display().distance_m(p) for p in (50, 25)])
    assert len(found.cameras) == len(found.references) == 2
    assert all(len(row) == 2 for row in found.references)


def test_a_plant_is_hardly_unlike_itself_and_another_is() -> None:
    """A cube has edges alone that multisampling draws other than 64 samples do."""
    found = truths(cube(), views("all", 3), SIZES)
    same = scores(found, level(cube()))
    other = scores(found, level(cube(gray=0.1)))
    assert set(same.values) == set(METRICS)
    assert same.values["flip"].shape == (2, 3)
    assert same.values["flip"].max() < 0.02
    assert other.values["flip"].min() > 0.1
    assert other.values["color_bias"] == pytest.approx(-0.8, abs=0.05)
    smaller = scores(found, level(cube(0.5**0.5)))
    assert smaller.values["coverage_bias"] == pytest.approx(-0.5, abs=0.08)


def test_a_level_may_be_buffers_or_depend_on_the_view() -> None:
    shown = views("all", 3)
    found = truths(cube(), shown, (25.0,))
    dark = level(cube(gray=0.1))
    expected = scores(found, dark).values["flip"]
    with PlantBuffers(cube(gray=0.1), mipmaps=True) as buffers:
        np.testing.assert_array_equal(scores(found, buffers).values["flip"], expected)
    mixed = scores(found, lambda view: dark if view is shown[1] else level(cube()))
    assert mixed.values["flip"][0, 1] == expected[0, 1]
    assert mixed.values["flip"][0, 0] < 0.02


def test_truths_from_buffers_are_those_from_the_plant() -> None:
    shown = views("ground", 2)
    with PlantBuffers(cube()) as buffers:
        given = truths(cube(), shown, (25.0,), buffers=buffers)
    own = truths(cube(), shown, (25.0,))
    for one, two in zip(given.references[0], own.references[0], strict=True):
        np.testing.assert_array_equal(one.picture, two.picture)


def test_whatever_the_number_of_threads_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = views("all", 5)
    results = []
    for threads in (1, 4):
        monkeypatch.setattr(room, "THREADS", threads)
        results.append(scores(truths(cube(), shown, SIZES), level(cube(0.9))).values)
    for name in METRICS:
        np.testing.assert_array_equal(results[0][name], results[1][name])


def test_a_plant_elsewhere_scores_the_same() -> None:
    shown = views("all", 3)
    here = scores(truths(cube(), shown, SIZES), level(cube(0.9)))
    there = scores(truths(cube(move=5e6), shown, SIZES), level(cube(0.9, move=5e6)))
    for name in METRICS:
        assert here.values[name] == pytest.approx(there.values[name], abs=1e-3)


def test_the_hull_frames_as_all_points_do(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(2000, 3)) + 7.0
    faces = np.arange(1998).reshape(-1, 3)
    material = (Material("m"),)
    plant = Plant("cloud", points, points, points[:, :2], faces, [0] * 666, material)
    flat = Plant("flat", points * [1, 1, 0], points, points[:, :2], faces, [0] * 666, material)
    for each in (plant, flat):
        exact = truths(each, views("all", 4), SIZES).cameras
        monkeypatch.setattr(room, "MANY_POINTS", 10)
        quick = truths(each, views("all", 4), SIZES).cameras
        monkeypatch.undo()
        for row, other in zip(exact, quick, strict=True):
            for camera, twin in zip(row, other, strict=True):
                assert (camera.width, camera.height) == (twin.width, twin.height)
                assert camera.center_px == twin.center_px


def test_sizes_from_within_the_plant_are_left_out() -> None:
    """At 150 degrees an image of 1080 pixels shows a cube 145 pixels large from a side length."""
    sizes, distance_m = outside(cube(), (400.0, 100.0, 25.0), Display(150.0))
    assert sizes.tolist() == [100.0, 25.0]
    assert distance_m[0] == pytest.approx(1.447, abs=0.001)
    with pytest.raises(UsageError, match=r"--fov 170.*narrower"):
        outside(cube(), (400.0, 100.0), Display(170.0))


def test_a_plant_without_extent_is_refused() -> None:
    flat = cube(0.0)
    with pytest.raises(UsageError, match="extent"):
        outside(flat, SIZES, Display())


def test_a_spread_tells_mean_deviation_and_ends() -> None:
    found = spread(np.array([1.0, 3.0]))
    assert (found.mean, found.sd, found.low, found.high) == (2.0, 1.0, 1.0, 3.0)
